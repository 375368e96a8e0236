"""Rules of a site's router, without a router."""

import pytest

from robomesh.contract.access_rights import Principal, may
from robomesh.contract.topics import Role


@pytest.mark.parametrize("topic", ["joints", "joints/@adv/pub/1"])
def test_a_hub_publishes_for_every_site_but_ours(topic):
    hub = Principal(name="router.hub", role=Role.ROUTER, sites=("*",))
    sites = [site for site in ("here", "there") if may(hub, "here", "put", f"robomesh/{site}/arm/{topic}")]
    assert sites == ["there"]
