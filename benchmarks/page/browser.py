"""Chromium as the tests of the page start it, and a site of real processes for it."""

import contextlib
import tempfile
from collections.abc import Iterator
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

from tests.browser.conftest import ARGUMENTS, CHROMIUM
from tests.browser.conftest import NO_WEBGL as NO_WEBGL
from tests.browser.conftest import PATIENCE_MS as PATIENCE_MS
from tests.site import RunningSite, running_site
from web import build_page


@contextlib.contextmanager
def chromium() -> Iterator[Browser]:
    """Start a browser without a window."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=ARGUMENTS)
        yield browser
        browser.close()


@contextlib.contextmanager
def site_for_page(robots: str) -> Iterator[RunningSite]:
    """Build the page and run `robomesh up` with these tables of robots."""
    build_page.build()
    with tempfile.TemporaryDirectory() as folder, running_site(Path(folder) / "site", robots=robots) as site:
        yield site
