"""`robomesh up --metrics`: which process of a site serves Prometheus where."""

from pathlib import Path

import pytest

from services.command_line.site.metrics_ports import extra_with_metrics, with_metrics
from services.command_line.site.up import programs
from services.errors import ListenError
from services.site_file import site as site_file
from services.supervisor import Program
from tests.site import robomesh

MONITORING = (Path(__file__).resolve().parents[2] / "docs" / "monitoring.md").read_text(encoding="utf-8")
ALL = programs(site_file.DEMO, None, "tcp/127.0.0.1:7447")


def places(text):
    return {each.name: each.arguments[-1] for each in text if "--metrics" in each.arguments}


def test_every_service_of_a_site_has_a_port_of_its_own_in_the_documented_order():
    found = places(with_metrics(ALL, ("127.0.0.1", 9101)))
    assert list(found.values()) == [f"127.0.0.1:{9101 + number}" for number in range(len(found))]
    assert {"gateway", "router", "watch"} <= found.keys()
    assert "simulate pt600" not in found
    assert ", ".join(found) in MONITORING


def test_a_site_without_robots_starts_nothing_that_would_end_at_once():
    empty = site_file.DEMO.model_copy(update={"robot": ()})
    names = [each.name for each in programs(empty, None, "tcp/127.0.0.1:7447")]
    assert names == ["router", "console", "recorder", "player", "watch", "renderer"]


def test_port_0_is_a_free_one_for_each_and_without_an_address_nobody_serves():
    assert set(places(with_metrics(ALL, ("::1", 0))).values()) == {"[::1]:0"}
    assert with_metrics(ALL, None) == ALL


def test_what_is_started_from_the_page_takes_a_free_port():
    made = [Program(name="gateway two", arguments=("gateway",), required=False)]
    extra = extra_with_metrics(lambda: {"two": lambda: made}, ("127.0.0.1", 9101))
    (make,) = extra().values()
    assert places(make()) == {"gateway two": "127.0.0.1:0"}


def test_more_services_than_ports_are_refused():
    with pytest.raises(ListenError, match="at most 65528 is right"):
        with_metrics(ALL, ("127.0.0.1", 65530))


@pytest.mark.slow
def test_up_refuses_metrics_that_others_could_read_before_anything_starts():
    result = robomesh("up", "--metrics", "0.0.0.0:9101")
    assert result.returncode == 2
    assert "others can reach" in result.stderr
    assert len(result.stderr.splitlines()) == 1
