"""One site for all tests of programs."""

from types import SimpleNamespace

import pytest

from tests.site import running_site
from web import build_page

# A post next to the arm: the forearm hits it between 0 and 60 degrees of the waist.
SITE = """
[[robot]]
name = "arm"
model = "pt600"
cell = "a"
check = "require"

[[fixture]]
cell = "a"
name = "post"
cylinder = [40.0, 900.0]
pose = { xyz = [300.0, 200.0, 450.0], rpy = [0.0, 0.0, 0.0] }
"""


@pytest.fixture(scope="package")
def plant(tmp_path_factory):
    """Yield a site of an arm next to a post: its page, and the site."""
    build_page.build()
    with running_site(tmp_path_factory.mktemp("site"), robots=SITE, services=["store"]) as site:
        yield SimpleNamespace(address=site.console.rstrip("/"), site=site)
