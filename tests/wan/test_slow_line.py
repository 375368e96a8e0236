"""A slow line of 2 Mbit/s with more video than it carries: requested data arrives completely."""

import pytest

from tests.wan.network import Network, missing
from tests.wan.sites import PORT, Probe, Site

pytestmark = [pytest.mark.long, pytest.mark.processes]

VIDEO = "robomesh/plant/arm/video/free"
MESH = "robomesh/plant/arm/mesh/base"
SHAPE_BYTES = 250_000


def test_a_shape_arrives_whole_beside_more_video_than_the_line_carries(tmp_path):
    if why := missing():
        pytest.skip(why)
    with Network() as network:
        plant = Site(network.host("plant"), "plant", tmp_path / "plant", router="line_mbit = 2")
        hub = Site(network.host("hub"), "hub", tmp_path / "hub")
        line = network.link(plant.host, hub.host)
        plant.links = (f"tcp/{line.far}:{PORT}",)
        for site in (hub, plant):
            site.start("router")
        beside, away = Probe(plant.host), Probe(hub.host)
        sha256 = beside.do("hold_shape", "plant", "arm", SHAPE_BYTES)
        beside.do("pour", "plant", "arm", "free", 8.0, 30.0)
        away.do("watch", VIDEO)
        away.wait_for("samples", VIDEO)
        line.change(delay_ms=40.0, rate_bps=2e6)
        away.do("samples", VIDEO)
        answer = away.do("shape", MESH, 60.0)
        assert answer.get("sha256") == sha256, answer
        assert away.wait_for("samples", VIDEO), "the video goes on"
