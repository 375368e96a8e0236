"""`[metrics]` and `robomesh up --metrics`: which process of a site serves Prometheus where."""

import re
from pathlib import Path

import pytest

from robomesh.errors import ListenError
from services.command_line.main import run
from services.command_line.service_settings.metrics_ports import (
    extra_with_metrics,
    first_address,
    own_address,
    scrape_config,
    with_metrics,
)
from services.command_line.service_settings.table import SERVICES
from services.command_line.site.up import programs
from services.errors import SiteFileError
from services.site_file import site as site_file
from services.site_file.tables.router import Metrics
from services.supervisor import SupervisedProgram
from tests.site import robomesh

MONITORING = (Path(__file__).resolve().parents[2] / "docs" / "monitoring.md").read_text(encoding="utf-8")
ALL = programs(site_file.DEMO, None, "tcp/127.0.0.1:7447")
WITHOUT_ROBOTS = site_file.DEMO.model_copy(update={"robot": ()})


def places(text):
    return {each.name: each.arguments[-1] for each in text if "--metrics" in each.arguments}


def metered(listen, *, insecure=False):
    router = site_file.DEMO.router.model_copy(update={"insecure": insecure})
    return site_file.DEMO.model_copy(update={"metrics": Metrics(listen=listen), "router": router})


def test_every_service_of_a_site_has_a_port_of_its_own_in_the_documented_order():
    found = places(with_metrics(ALL, ("127.0.0.1", 9101)))
    assert list(found.values()) == [f"127.0.0.1:{9101 + number}" for number in range(len(found))]
    assert {"gateway", "router", "watch"} <= found.keys()
    assert "simulate pt600" not in found
    assert ", ".join(found) in MONITORING
    assert ", ".join([*found][1:]) in " ".join(Metrics.__doc__.split())


def test_a_service_has_the_same_port_in_every_site():
    some = programs(WITHOUT_ROBOTS, None, "tcp/127.0.0.1:7447")
    all_of_them = places(with_metrics(ALL, ("127.0.0.1", 9101)))
    assert places(with_metrics(some, ("127.0.0.1", 9101))).items() <= all_of_them.items()


def test_a_service_that_runs_alone_has_the_same_port_as_under_a_supervisor():
    site = metered("127.0.0.1:9101")
    together = places(with_metrics(ALL, first_address(site, "")))
    alone = {name: "{}:{}".format(*own_address(site, "", name)) for name in SERVICES}
    assert alone == together
    assert own_address(site, "127.0.0.1:7", "watch") == ("127.0.0.1", 7)
    assert own_address(site, "", "gateway", started=True) == ("127.0.0.1", 0)
    assert own_address(site_file.DEMO, "", "watch") is None


def test_a_site_without_robots_starts_nothing_that_would_end_at_once():
    names = [each.name for each in programs(WITHOUT_ROBOTS, None, "tcp/127.0.0.1:7447")]
    assert names == ["router", "console", "recorder", "player", "watch", "renderer", "store"]


def test_port_0_is_a_free_one_for_each_and_without_an_address_nobody_serves():
    assert set(places(with_metrics(ALL, ("::1", 0))).values()) == {"[::1]:0"}
    assert with_metrics(ALL, None) == ALL


def test_what_is_started_from_the_page_takes_a_free_port():
    made = [SupervisedProgram(name="gateway two", arguments=("gateway",), required=False)]
    extra = extra_with_metrics(lambda: {"two": lambda: made}, ("127.0.0.1", 9101))
    (make,) = extra().values()
    assert places(make()) == {"gateway two": "127.0.0.1:0"}


def test_more_services_than_ports_are_refused():
    with pytest.raises(ListenError, match="the port must be at most 65527"):
        with_metrics(ALL, ("127.0.0.1", 65530))
    with pytest.raises(ListenError, match="the port must be at most 65527"):
        first_address(metered("127.0.0.1:65530"), "")


def test_metrics_of_the_site_file_stay_on_this_machine_unless_it_says_otherwise():
    with pytest.raises(ListenError, match=r"\[metrics\] listen = '0.0.0.0:9101' would .* others can reach"):
        own_address(metered("0.0.0.0:9101"), "", "watch")
    assert own_address(metered("0.0.0.0:9101", insecure=True), "", "router") == ("0.0.0.0", 9101)


def test_an_address_of_metrics_that_is_none_is_named(tmp_path):
    path = tmp_path / "site.toml"
    path.write_text('site = "plant"\n[metrics]\nlisten = "9101"\n')
    with pytest.raises(SiteFileError, match="must be HOST:PORT"):
        site_file.load(path)


def test_the_scrape_configuration_names_every_service_with_its_site():
    written = scrape_config(site_file.DEMO, ["router", "gateway"], ("::1", 9101))
    assert re.findall(r'targets: \["(.*)"\]\n +labels: \{ site: "(.*)", service: "(.*)" \}', written) == [
        ("[::1]:9101", "demo", "router"),
        ("[::1]:9102", "demo", "gateway"),
    ]
    watch = scrape_config(site_file.DEMO, ["watch"], ("::1", 9101))
    assert 'service: "watch", page: "http://127.0.0.1:8080/#/events" }' in watch
    with pytest.raises(ListenError, match="choose a port"):
        scrape_config(site_file.DEMO, ["router"], ("127.0.0.1", 0))


def test_the_scrape_configuration_is_printed_for_a_site_file(tmp_path, capsys):
    path = tmp_path / "site.toml"
    path.write_text('site = "plant"\n')
    assert run(["metrics", str(path)]) == 2
    assert "write [metrics] with" in capsys.readouterr().err
    path.write_text('site = "plant"\n[metrics]\nlisten = "127.0.0.1:9101"\n')
    assert run(["metrics", str(path)]) == 0
    printed = capsys.readouterr().out
    assert '["127.0.0.1:9104"]\n        labels: { site: "plant", service: "console" }' in printed
    assert "gateway" not in printed  # the site has no robots


@pytest.mark.slow
def test_up_refuses_metrics_that_others_could_read_before_anything_starts():
    result = robomesh("up", "--metrics", "0.0.0.0:9101")
    assert result.returncode == 2
    assert "others can reach" in result.stderr
    assert len(result.stderr.splitlines()) == 1
