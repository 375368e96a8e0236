"""The dashboard and the rules, against a real site and, where there is one, a real Prometheus."""

import json
import re
import shutil
import subprocess
import urllib.parse
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from robomesh.contract.topics import Role
from services.command_line.service_settings.metrics_ports import ports, scrape_config
from services.command_line.service_settings.table import SERVICES
from services.pki import Folder, site_keys
from services.site_file import site as site_file
from tests.ports import free_port
from tests.site import ONE_ARM, kill, robomesh, running_site, wait_until

DEPLOY = Path(__file__).resolve().parents[2] / "deploy"
RULES = DEPLOY / "prometheus" / "robomesh.rules.yml"
DASHBOARD = json.loads((DEPLOY / "grafana" / "robomesh.json").read_text(encoding="utf-8"))
PANELS = [panel for panel in DASHBOARD["panels"] if panel["type"] != "row"]
# A panel whose colour says whether something is wrong now.
STATUS = {
    panel["title"]: panel for panel in PANELS if panel.get("options", {}).get("colorMode") == "background"
}
# What Prometheus itself knows, and what the rules record.
OF_PROMETHEUS = {"up", "scrape_duration_seconds", "ALERTS", "robomesh:rules_loaded"}
METRIC = re.compile(r"\b(?:ALERTS|up(?=\{)|(?:robomesh|process|scrape)[_:][a-z_:]+)")
FIRST = ("127.0.0.1", 9101)

needs_prometheus = pytest.mark.skipif(
    shutil.which("prometheus") is None, reason="there is no prometheus on PATH: apt install prometheus"
)
needs_promtool = pytest.mark.skipif(
    shutil.which("promtool") is None, reason="there is no promtool on PATH: apt install prometheus"
)


def queries(panel) -> list[str]:
    return [target["expr"].replace("$job", "robomesh.*") for target in panel["targets"]]


def expressions_of_rules() -> str:
    """Return the text of the rules without comments and sentences."""
    lines = RULES.read_text(encoding="utf-8").splitlines()
    left_out = ("#", "summary:", "action:", "- alert:", "labels:")
    return "\n".join(line for line in lines if not line.lstrip().startswith(left_out))


def colour(panel, value: float) -> str:
    """Return the colour in which Grafana shows a value: its mapping's, else its threshold's."""
    shown = panel["fieldConfig"]["defaults"]
    for mapping in shown["mappings"]:
        if mapping["type"] == "value" and f"{value:g}" in mapping["options"]:
            return mapping["options"][f"{value:g}"]["color"]
    steps = [
        step["color"]
        for step in shown["thresholds"]["steps"]
        if step["value"] is None or value >= step["value"]
    ]
    return steps[-1]


# ------------------------------------------------------------------- the files


def test_panels_have_their_own_places_and_one_data_source():
    assert (DASHBOARD["schemaVersion"], DASHBOARD["uid"]) == (39, "robomesh")
    source, job = DASHBOARD["templating"]["list"]
    assert (source["type"], source["query"], job["allValue"]) == ("datasource", "prometheus", "robomesh.*")
    ids = [panel["id"] for panel in DASHBOARD["panels"]]
    assert len({*ids}) == len(ids)
    taken: set[tuple[int, int]] = set()
    for panel in DASHBOARD["panels"]:
        place = panel["gridPos"]
        cells = {
            (place["x"] + x, place["y"] + y) for x in range(place["w"]) for y in range(place["h"])
        }  # fmt: skip
        assert not cells & taken, panel["title"]
        assert max(x for x, _ in cells) < 24
        taken |= cells
    for panel in PANELS:
        assert panel["type"] in {"stat", "state-timeline", "table", "timeseries"}
        for each in (panel, *panel["targets"]):
            assert each["datasource"] == {"type": "prometheus", "uid": "${source}"}


def test_a_panel_of_the_present_never_shows_the_past_and_never_turns_a_missing_value_into_a_good_one():
    assert {"Services", "Link to the controller", "Joint states", "Alarms of high priority"} <= STATUS.keys()
    for title, panel in STATUS.items():
        # A range query ends with the last value of a dead service.
        assert [(each["instant"], each["range"]) for each in panel["targets"]] == [(True, False)], title
        assert panel["fieldConfig"]["defaults"]["thresholds"]["steps"][0]["value"] is None
        assert colour(panel, float("-inf")) in ("red", "orange"), title
        (special,) = [
            each for each in panel["fieldConfig"]["defaults"]["mappings"] if each["type"] == "special"
        ]
        assert special["options"] == special["options"] | {"match": "null+nan"}
        assert special["options"]["result"]["color"] == "red"
    for panel in PANELS:
        for query in queries(panel):
            assert "vector(" not in query, panel["title"]


@needs_promtool
@pytest.mark.slow
def test_promtool_accepts_the_rules_their_tests_and_the_printed_configuration(tmp_path):
    shutil.copy(RULES, tmp_path)
    config = tmp_path / "prometheus.yml"
    config.write_text(scrape_config(site_file.DEMO, [*SERVICES], FIRST))
    for words in (
        ("check", "rules", RULES),
        ("test", "rules", RULES.with_name("robomesh.test.yml")),
        ("check", "config", config),
    ):
        done = subprocess.run(["promtool", *map(str, words)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


# ---------------------------------------------------------------- a real site


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return a site with keys, whose services serve metrics on free ports."""
    folder = tmp_path_factory.mktemp("site")
    site_keys.prepare(Folder(folder / "keys"), "test", robots=["arm"], border="open", routers=[])
    more = '[keys]\nfolder = "keys"\n[metrics]\nlisten = "127.0.0.1:0"\n'
    with running_site(folder, robots=ONE_ARM, more=more) as running:
        wait_until(lambda: addresses(running).keys() == SERVICES.keys(), what="\n".join(running.log))
        yield running


def addresses(site) -> dict[str, str]:
    """Return HOST:PORT of the metrics of each service, as the site's log has them."""
    lines = (re.match(r"(\w+) +\| info metrics http://(\S+)/metrics$", line) for line in [*site.log])
    return {line[1]: line[2] for line in lines if line}


@pytest.mark.long
@pytest.mark.processes
def test_dashboard_and_rules_ask_for_metrics_and_labels_that_the_services_have(site):
    labels: dict[str, set[str]] = {}

    def read() -> bool:
        for address in addresses(site).values():
            with urllib.request.urlopen(f"http://{address}/metrics", timeout=40.0) as answer:
                for family in text_string_to_metric_families(answer.read().decode()):
                    for sample in family.samples:
                        labels.setdefault(sample.name, set()).update(sample.labels)
        return {"robomesh_pictures_total", "robomesh_alarm"} <= labels.keys()

    # An alarm has a series only while it is active.
    site_keys.issue(Folder(site.folder / "keys"), "li", Role.OPERATOR)
    person = str(site.folder / "keys" / "people" / "li.pem")
    freeze = ("fault", "arm", "freeze", "--connect", site.router.replace("tcp/", "tls/"), "--keys", person)
    wait_until(lambda: robomesh(*freeze).returncode == 0)  # the routers learn the name
    # A service serves metrics before it has registered all of them; the renderer is the last.
    wait_until(read)
    assert robomesh(*freeze, "--off").returncode == 0
    for text in (*(query for panel in PANELS for query in queries(panel)), expressions_of_rules()):
        asked = {*METRIC.findall(text)}
        assert asked
        assert asked <= labels.keys() | OF_PROMETHEUS, asked - labels.keys() - OF_PROMETHEUS
        for name, selector in re.findall(r"(robomesh_[a-z_]+)\{([^}]*)\}", text):
            assert {*re.findall(r"(\w+)=", selector)} <= labels[name] | {"job"}, name


# ----------------------------------------------------------- a real Prometheus


@contextmanager
def prometheus(folder: Path, targets: Mapping[str, str]) -> Iterator[str]:
    """Run Prometheus with the printed configuration and the rules, at short intervals; yield its URL."""
    config = scrape_config(site_file.DEMO, [*targets], FIRST)
    for name, port in ports(FIRST).items():
        config = config.replace(f'"{FIRST[0]}:{port}"', f'"{targets.get(name)}"')
    config = config.replace(" 5s", " 1s").replace(" 2s", " 1s")
    (folder / "prometheus.yml").write_text(config)
    (folder / RULES.name).write_text(re.sub(r"for: \w+", "for: 1s", RULES.read_text(encoding="utf-8")))
    address = f"127.0.0.1:{free_port()}"
    log = folder / "log"
    end_with_the_tests = ("setpriv", "--pdeathsig", "KILL") if shutil.which("setpriv") else ()
    with log.open("w") as output:
        process = subprocess.Popen(
            [
                *end_with_the_tests,
                "prometheus",
                f"--config.file={folder / 'prometheus.yml'}",
                f"--storage.tsdb.path={folder / 'data'}",
                f"--web.listen-address={address}",
            ],
            stdout=output,
            stderr=subprocess.STDOUT,
        )
        try:
            yield f"http://{address}"
            assert process.poll() is None, log.read_text()
        finally:
            process.kill()
            process.wait()


def asked(url: str, query: str) -> list[tuple[dict[str, str], float]]:
    """Return labels and value of each series of a query; empty while Prometheus starts."""
    request = f"{url}/api/v1/query?{urllib.parse.urlencode({'query': query})}"
    try:
        with urllib.request.urlopen(request, timeout=40.0) as answer:
            found = json.load(answer)["data"]["result"]
    except urllib.error.HTTPError as error:
        if error.code == 503:
            return []
        raise AssertionError(f"{query}: {error.read().decode()}") from None
    except OSError:
        return []
    return [(each["metric"], float(each["value"][1])) for each in found]


def colours(url: str, title: str) -> dict[str, str]:
    """Return the colour of each series of a panel, by its service or robot."""
    panel = STATUS[title]
    (query,) = queries(panel)
    return {
        labels.get("robot") or labels.get("service", ""): colour(panel, value)
        for labels, value in asked(url, query)
    }


@pytest.mark.long
@needs_prometheus
@pytest.mark.processes
def test_a_dead_gateway_turns_its_panels_red_and_fires_an_alert(site, tmp_path):
    services = addresses(site)
    with prometheus(tmp_path, services) as url:
        # Losses and restarts of a busy machine are no fault of the panels.
        now = STATUS.keys() - {"Lost, last 5 min", "Restarts, last hour"}

        def red() -> dict[str, dict[str, str]]:
            return {
                title: found
                for title in now
                if not (found := colours(url, title)) or {*found.values()} != {"green"}
            }

        # A service that was never scraped is not on its panel yet.
        wait_until(
            lambda: not red() and colours(url, "Services").keys() == {*services},
            what="a panel is not green, or lacks a service, although all is well",
        )
        for panel in PANELS:
            for query in queries(panel):
                asked(url, query)

        # The supervisor starts another gateway, whose port is another one: for Prometheus it stays dead.
        kill(site.children()["gateway"])
        wait_until(lambda: colours(url, "Services").get("gateway") == "red")
        assert [value for _, value in asked(url, 'up{service="gateway"}')] == [0]
        for title in ("Link to the controller", "Stop", "Joint states"):
            assert colours(url, title) == {"arm": "red"}, title
        wait_until(
            lambda: asked(
                url, 'ALERTS{alertname="RobomeshServiceDown", alertstate="firing", service="gateway"}'
            )
        )
