"""Health and metrics that every process publishes, and the metrics that Prometheus reads."""

import asyncio
import os
import re
import socket
import time
import urllib.request
from pathlib import Path
from types import SimpleNamespace

import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from prometheus_client.parser import text_string_to_metric_families

from robomesh.contract.keys import Key
from robomesh.errors import NoAnswerError
from robomesh.publications import subscription as subscription_module
from robomesh.requests.latencies import Latencies
from robomesh.schemas.robomesh_pb2 import ServiceHealth
from robomesh.service.clock import Clock, Reading, hops_of, read_clock, reading_of
from robomesh.service.health import Served, health_of, listen_when_possible, own_version, present
from robomesh.service.loop_turns import LONG_S, MeasuredLoop
from robomesh.service.metrics import SessionMetrics, serve_metrics
from robomesh.wire.session import open_session
from services.watch.rules import RULES
from tests.site import robomesh, wait_until

ROOT = Path(__file__).resolve().parents[2]
GATEWAY = Served(service="gateway", present_for=(("s", "arm"), ("s", "other")))


async def scraped(url: str) -> dict[str, dict[tuple[tuple[str, str], ...], float]]:
    """Return samples by name and labels, as Prometheus's parser reads them."""
    return await asyncio.to_thread(scrape, url)


def scrape(url: str) -> dict[str, dict[tuple[tuple[str, str], ...], float]]:
    """Return samples as `scraped`; blocks."""
    with urllib.request.urlopen(url, timeout=40.0) as answer:
        text = answer.read().decode()
    found: dict[str, dict[tuple[tuple[str, str], ...], float]] = {}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            found.setdefault(sample.name, {})[tuple(sorted(sample.labels.items()))] = sample.value
    return found


async def test_a_process_tells_who_it_is_and_what_it_has_done(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        gateway.measure("captures", "of its own", lambda: 7)
        gateway.measure("link_up", "of each robot", lambda: {"arm": 1.0})
        async with present(gateway, GATEWAY):
            joints = gateway.declare_publisher("s", "arm", "joints")
            for _ in range(5):
                joints.put(JointStates())
            async for sample in monitor.subscribe("robomesh/s/-/health/*", newest=10):
                health = sample.message()
                if health.published >= 5:
                    break
            there = {("arm", "gateway"), ("other", "gateway")}
            while not there <= {(key.robot, key.service) for key in await monitor.present()}:
                await asyncio.sleep(0.05)
        assert sample.key == f"robomesh/s/-/health/gateway.{gateway.identity}"
        assert (health.service, health.id, health.pid) == ("gateway", gateway.identity, os.getpid())
        assert list(health.robots) == ["arm", "other"]
        assert health.version == own_version()
        assert health.memory_bytes > 1e6
        assert health.open_files > 3
        # Numbers of each robot are in its topics and its metrics.
        assert dict(health.values) == {"captures": 7.0}


async def test_prometheus_reads_counts_ages_latencies_and_the_services_own(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        gateway.measure("units_received_total", "of each robot", lambda: {"arm": 12.0})
        gateway.measure("captures", "of its own", lambda: 3)
        gateway.measure("alarms_active", "by priority", lambda: {"high": 2}, labels=("priority",))
        url = serve_metrics(gateway, "127.0.0.1", 0, {"service": "gateway"})
        monitored = serve_metrics(monitor, "127.0.0.1", 0, {"service": "monitor"})
        async with present(gateway, GATEWAY):
            subscription = monitor.subscribe("robomesh/*/*/joints", newest=100)
            joints = gateway.declare_publisher("s", "arm", "joints")
            while not joints.watched:
                await asyncio.sleep(0.01)
            for _ in range(4):
                joints.put(JointStates())
            for _ in range(4):
                await anext(subscription)
            await read_clock(monitor, "s", gateway.identity)
            joints.close()
            # A closed publisher remains in the counters, also after another declaration.
            gateway.declare_publisher("s", "arm", "lease")
            found, there = await scraped(url), await scraped(monitored)
        topic = (("topic", "joints"),)
        assert found["robomesh_published_total"][topic] == 4
        assert found["robomesh_units_received_total"] == {(("robot", "arm"),): 12.0}
        assert found["robomesh_captures"] == {(): 3.0}
        assert found["robomesh_alarms_active"] == {(("priority", "high"),): 2.0}
        assert found["robomesh_connected"] == {(): 1.0}
        clock = (("request", "clock/*"),)
        assert found["robomesh_request_seconds_count"][clock] == 1
        steps = [
            value
            for labels, value in found["robomesh_request_seconds_bucket"].items()
            if dict(labels)["request"] == "clock/*"
        ]
        assert steps == sorted(steps)
        assert steps[-1] == 1
        assert found["process_resident_memory_bytes"][()] > 1e6
        assert there["robomesh_received_total"][topic] == 4
        assert there["robomesh_lost_total"][topic] == 0
        age = there["robomesh_age_seconds"][(("robot", "arm"), ("site", "s"), ("topic", "joints"))]
        assert 0.0 <= age < 30.0


async def test_processes_that_come_and_go_leave_neither_series_nor_keys(mesh, monkeypatch):
    monkeypatch.setattr(subscription_module, "_FORGET_EACH_S", 0.0)
    monkeypatch.setattr(subscription_module, "_FORGOTTEN_AFTER_S", 0.0)

    async with open_session(mesh) as service, open_session(mesh) as monitor:
        healths = monitor.subscribe("robomesh/s/-/health/*", newest=1, history=False)
        for n in range(3):
            publisher = service.declare_publisher("s", "-", f"health/gateway.{n}")
            while not publisher.watched:
                await asyncio.sleep(0.01)
            publisher.put(ServiceHealth(service="gateway"))
            while healths.received <= n:
                await asyncio.sleep(0.01)
        assert [*healths.ages_s()] == [Key("s", "-", "health/gateway.2")]
        assert (healths.received, healths.skipped) == (3, 2)
        ages = next(
            each for each in SessionMetrics(monitor, {}).collect() if each.name == "robomesh_age_seconds"
        )
        row = {"site": "s", "robot": "-", "topic": "health/*"}
        assert [sample.labels for sample in ages.samples] == [row]


@pytest.mark.slow
async def test_the_heartbeat_ages_while_the_event_loop_hangs(mesh):
    async with open_session(mesh) as session:
        url = serve_metrics(session, "127.0.0.1", 0, {})

        def hangs() -> bool:
            return scrape(url)["robomesh_heartbeat_age_seconds"][()] > 1.5

        wait_until(hangs, what="the heartbeat goes on")  # blocks the event loop
        async with asyncio.timeout(40.0):
            while await asyncio.to_thread(hangs):
                await asyncio.sleep(0.05)


async def test_a_service_without_its_metrics_runs_and_says_so_and_listens_when_it_can(mesh, monkeypatch):
    monkeypatch.setattr("robomesh.service.health._LISTEN_AGAIN_S", 0.1)

    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        served = Served(service="gateway", present_for=(("s", "arm"),), metrics=("127.0.0.1", port))
        async with open_session(mesh) as session, present(session, served):
            measured = health_of(session, served)
            while not (problems := measured().problems):
                await asyncio.sleep(0.02)
            assert problems[0].text.startswith(f"metrics cannot listen on 127.0.0.1:{port}: Address already")
            other.close()
            while measured().problems:
                await asyncio.sleep(0.02)
            assert await asyncio.to_thread(scrape, f"http://127.0.0.1:{port}/metrics")


async def test_a_host_that_cannot_be_found_is_reported_in_the_resolver_s_words(monkeypatch):
    monkeypatch.setattr("robomesh.service.health._LISTEN_AGAIN_S", 0.0)
    process = SimpleNamespace(problems={})

    async def listen():
        if not process.problems:
            raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")
        return process.problems["metrics"].text

    text = await listen_when_possible(process, "metrics", "nowhere", 9, listen)
    assert "cannot listen on nowhere:9: [Errno -2] Name or service not known" in text


async def test_only_the_process_that_is_asked_answers_for_its_clock(mesh):
    async with open_session(mesh) as one, open_session(mesh) as other, open_session(mesh) as asker:
        async with present(one, GATEWAY), present(other, GATEWAY):
            for each in (one, other):
                reading = await read_clock(asker, "s", each.identity, hops=True, timeout_s=40.0)
                assert abs(reading.offset_s) <= reading.round_trip_s / 2 + 1e-3
                # To the router, and from it to the process.
                assert len(reading.hops) == 2
                assert reading.hops[0][1] == reading.hops[1][0]
                assert all(seconds >= 0 for _, _, seconds in reading.hops)
        with pytest.raises(NoAnswerError, match="no answer"):
            await read_clock(asker, "s", "nobody", timeout_s=0.2)


@pytest.mark.parametrize(
    ("times", "offset_s", "round_trip_s"),
    [
        ((0, 10, 10, 20), 0.0, 20.0),
        ((0, 110, 110, 20), 100.0, 20.0),
        ((0, -90, -90, 20), -100.0, 20.0),
        ((0, 110, 150, 60), 100.0, 20.0),  # the owner's processing time is not part of the delay
        ((0, 15, 15, 20), 5.0, 20.0),  # an uneven way: off by less than half the round trip
        ((0, 10, 40, 20), 15.0, 0.0),  # a clock that was set during the request
    ],
)
def test_offset_and_round_trip_come_from_four_times(times, offset_s, round_trip_s):
    reading = reading_of(*(round(each * 1e9) for each in times))
    assert reading.offset_s == pytest.approx(offset_s)
    assert reading.round_trip_s == pytest.approx(round_trip_s)


def test_of_several_readings_the_quickest_counts():
    clock = Clock()
    assert clock.best is None
    for round_trip_s in (0.3, 0.1, 0.2):
        clock.readings.append(Reading(round_trip_s / 2, round_trip_s))
    assert clock.best == Reading(0.05, 0.1)


def test_hops_are_measured_across_clocks_that_differ():
    # a -> r -> b and back; r's clock is 100 s ahead, each way of a hop takes 1 s and 2 s.
    there = [("a", 0.0), ("a", 0.5), ("r", 101.5), ("r", 101.75), ("b", 3.75)]
    back = [("b", 4.0), ("r", 106.0), ("r", 106.5), ("a", 7.5)]
    assert hops_of([*there, *back]) == (("a", "r", 1.0), ("r", "b", 2.0))
    # A return path through another router gives no delay of a hop.
    assert hops_of([*there, ("b", 4.0), ("q", 5.0), ("a", 7.0)]) == ()
    assert hops_of([]) == ()


def test_latencies_are_counted_in_steps():
    latencies = Latencies()
    for seconds in (0.0005, 0.001, 0.02, 99.0, -1.0):
        latencies.add(seconds)
    assert latencies.count == 5
    assert (latencies.counts[0], latencies.counts[3], latencies.counts[-1]) == (3, 1, 1)


METRICS = (ROOT / "docs" / "monitoring.md").read_text(encoding="utf-8")


def test_every_measure_of_a_service_is_in_the_documentation():
    measured = set()
    for file in ROOT.glob("[a-z]*/**/*.py"):
        if file.parts[len(ROOT.parts)] in ("services", "renderer", "protocol_gateway"):
            measured |= set(re.findall(r'measure\(\s*"([a-z_]+)"', file.read_text(encoding="utf-8")))
    assert {"browsers", "views", "captures", "link_up"} <= measured
    for name in measured:
        assert f"`robomesh_{name}`" in METRICS, name


def test_every_alarm_says_what_to_do():
    for code, rule in RULES.items():
        assert (rule.priority is None) == (rule.advice == ""), code


@pytest.mark.parametrize(
    ("given", "expected"),
    [("0.0.0.0:9100", "others can reach"), ("nonsense", "must be HOST:PORT")],
    ids=["beyond loopback", "no address"],
)
@pytest.mark.slow
def test_metrics_stay_on_this_machine_unless_the_site_says_otherwise(given, expected):
    result = robomesh("watch", "--metrics", given)
    assert result.returncode == 2
    assert expected in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_longest_turn_of_the_event_loop_is_in_the_health(mesh):
    async def main():
        async with open_session(mesh) as gateway, open_session(mesh) as monitor, present(gateway, GATEWAY):
            asyncio.get_running_loop().call_soon(time.sleep, 4 * LONG_S)
            async for sample in monitor.subscribe("robomesh/s/-/health/*", newest=10):
                values = sample.message().values
                if values["longest_turn_seconds"] >= 4 * LONG_S and values["long_turns_total"] >= 1:
                    return

    with asyncio.Runner(loop_factory=MeasuredLoop) as runner:
        runner.run(main())
