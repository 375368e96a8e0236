"""One site for all of Define's tests, without robots, which would take processor time."""

import os
from types import SimpleNamespace

import pytest

from tests.site import running_site
from web import build_page


@pytest.fixture(scope="package")
def plant(tmp_path_factory):
    """Yield a site of real processes: its page, and the folder of its robots."""
    build_page.build()
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(os.environ, "XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        with running_site(tmp_path_factory.mktemp("site"), robots="", services=()) as site:
            yield SimpleNamespace(address=site.console.rstrip("/"), robots=site.folder / "robots")
