"""Signals of a robot in recordings, plots, tables, Rerun, Python, the terminal and Prometheus."""

import asyncio
import csv
import io
import json

import pytest
from mcap.reader import make_reader
from prometheus_client import CollectorRegistry, generate_latest

import robomesh as client
from robomesh.recordings.reading import RecordingFile
from robomesh.recordings.series.downsampling import SeriesReader, known_values
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.service.metrics import SessionMetrics
from robomesh.wire.session import open_session
from services.command_line.main import run as robomesh_run
from services.recorder import recorder
from services.recorder.reading.answers import Answers
from services.recorder.settings import Settings
from tests.controllers.universal_robots.test_rtde_driver import UR, controller
from tests.protocol_gateway.gateway_site import gateway, until
from tests.recordings import START_NS, Written, joints
from tests.site import robomesh

CURRENT, INPUT = "signals/joint.waist.current", "signals/io.digital_in.3"


def signals(at_s, **others):
    message = schema.Signals()
    message.signals.add(name="io.digital_in.3", on=int(at_s) % 2 == 1)
    message.signals.add(name="joint.waist.current", unit="A", number=at_s / 10)
    message.signals.add(name="program.name", text=f"=weld, {int(at_s)}")
    for name, number in others.items():
        message.signals.add(name=name, unit="kg", number=number)
    return message


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded") / "arm"
    folder.mkdir()
    with Written(folder / "signals.mcap") as file:
        for number in range(1000):
            at_s = number / 100
            file.put("joints", joints(waist=at_s), at_s)
            # None for 4 s; a further signal only at 9 s.
            if number % 10 == 0 and not 400 <= number < 800:
                file.put("signals", signals(at_s, **({"mass": 2.0} if number == 900 else {})), at_s)
    return folder / "signals.mcap"


def test_they_are_plotted_by_name_with_their_units(recorded):
    with RecordingFile(recorded) as file:
        names = [name for name in known_values(file) if name.startswith("signals/")]
        assert names == [INPUT, CURRENT, "signals/mass"]  # a text has no number
        end_ns = file.layout.end_ns
        current, on = SeriesReader().read(
            file, [CURRENT, INPUT], start_ns=file.layout.start_ns, end_ns=end_ns, points=1000
        )
    assert (current.unit, on.unit) == ("A", "")
    assert [current.lowest[0], current.highest[-1]] == pytest.approx([0.0, 0.99])
    assert sorted({*on.lowest.tolist()}) == [0.0, 1.0]


def test_the_recorder_s_history_of_a_robot_has_their_units(recorded):
    request = schema.SeriesRequest(robot="arm", values=[CURRENT], points=100)
    request.start.FromNanoseconds(START_NS)
    request.end.FromNanoseconds(START_NS + 10 * 10**9)
    (series,) = Answers(recorded.parents[1]).series(request).series
    assert series.unit == "A"
    assert series.highest[-1] == pytest.approx(0.99)


def test_a_table_has_a_column_each_and_nothing_where_they_are_stale(recorded, tmp_path):
    out = tmp_path / "out.csv"
    assert robomesh_run(["recordings", "export", str(recorded), str(out)]) == 0
    header, *rows = csv.reader(io.StringIO(out.read_text("utf-8")))
    last = ["io.digital_in.3", "joint.waist.current [A]", "mass [kg]", "program.name"]
    assert header[-4:] == last
    by_time = {round(float(row[3]), 2): row[-4:] for row in rows}
    assert by_time[1.0] == ["1", "0.1", "", "'=weld, 1"]
    assert by_time[1.05] == by_time[1.0]
    assert by_time[9.0] == ["1", "0.9", "2.0", "'=weld, 9"]
    assert by_time[6.5][1] == "0.39"
    assert by_time[7.5] == ["", "", "", ""]


@pytest.mark.slow
def test_rerun_gets_numbers_and_booleans(recorded, tmp_path):
    pytest.importorskip("rerun.chunk")
    from tests.services.test_rerun_export import export

    found = export(recorded, tmp_path / "out.rrd")
    entity = found["/site/arm/signals/joint.waist.current"]
    assert entity["Scalars:scalars"][:3] == [0.0, 0.01, 0.02]
    assert entity["SeriesLines:names"] == ["joint.waist.current [A]"]
    assert "/site/arm/signals/program.name" not in found


def test_python_reads_recorded_ones_with_units(recorded):
    found = client.open_recording(recorded).values(CURRENT, INPUT)
    assert (found[CURRENT].unit, found[INPUT].unit) == ("A", "")
    assert found[CURRENT].values[-1] == pytest.approx(0.99)


async def test_they_are_live_in_python_the_terminal_and_prometheus(mesh, router, tmp_path):
    async def ask(*arguments):
        return await asyncio.to_thread(robomesh, *arguments, "--connect", router)

    async with (
        controller(demo=True) as (port, primary),
        gateway(mesh, tmp_path, port, **UR, ports={"primary": primary}) as site,
    ):
        site.own.declare_presence("hall", "arm", "gateway")
        async with client.connect_async(router) as found:
            robot = await found.robot("hall/arm")
            async with robot.signals() as states:
                state = await anext(aiter(states))
        assert (state["payload.mass"], state.units["payload.mass"]) == (1.2, "kg")
        assert state["safety.mode"] == "normal"
        assert state["io.digital_out.0"] is False
        with pytest.raises(KeyError, match="no signal 'x'; there are io"):
            state["x"]
        names = [name for name in state.values if name.endswith(".current") and name.startswith("joint.")]
        assert len(names) == 6
        listed = await ask("signals", "arm", "payload.", "joint.*.current")
        lines = dict(line.split(None, 1) for line in listed.stdout.splitlines())
        assert lines["payload.mass"] == "1.2 kg"
        assert {name for name in lines if name.startswith("joint.")} == set(names)
        printed = json.loads((await ask("signals", "arm", "--json")).stdout)
        assert printed["signals"]["safety.mode"] == {"value": "normal", "unit": "", "age_s": 0.0}
        assert printed["live"]
        none = await ask("signals", "arm", "counter.")
        assert (none.returncode, none.stderr.count("\n")) == (2, 1)
        assert "has no signal 'counter.'" in none.stderr
        registry = CollectorRegistry()
        registry.register(SessionMetrics(site.own, {}))
        page = generate_latest(registry).decode()
        assert 'robomesh_signal{name="payload.mass",robot="arm",unit="kg"} 1.2' in page
        assert 'name="safety.mode"' not in page
        await site.units(10)
    # Nothing is published without a controller.
    async with gateway(mesh, tmp_path / "off", port, up=False, **UR) as site:
        site.own.declare_presence("hall", "arm", "gateway")
        none = await ask("signals", "arm")
        assert "has no current signals" in none.stderr


async def test_a_recorder_keeps_every_published_message(mesh, tmp_path):
    ask, key = schema.RecorderRequest, "robomesh/hall/arm/recorder/request"
    async with (
        controller(demo=True) as (port, primary),
        gateway(mesh, tmp_path / "gateway", port, **UR, ports={"primary": primary}) as site,
        open_session(mesh) as own,
    ):
        settings = Settings(site="hall", robots=("arm",), folder=tmp_path / "recorded")
        task = asyncio.create_task(recorder.serve(own, settings))
        published = {}
        following = asyncio.create_task(
            watch(site.session.subscribe(site.key("signals"), newest=1000), published)
        )
        try:
            await until(lambda: published)
            await site.session.ask(key, ask(action=ask.TRACE_ON), timeout_s=20.0)
            first = max(published)
            await until(lambda: max(published) >= first + 12)
            answer = await site.session.ask(key, ask(action=ask.TRACE_OFF), timeout_s=20.0)
        finally:
            for each in (following, task):
                each.cancel()
            await asyncio.gather(following, task, return_exceptions=True)
    published, name = published, answer.file
    with (tmp_path / "recorded" / "arm" / name).open("rb") as stream:
        topic = "robomesh/hall/arm/signals"
        found = {m.sequence: m.data for _, _, m in make_reader(stream).iter_messages(topics=[topic])}
    # The first may be from before the recording, and the last may be newer than the watched ones.
    both = sorted(found.keys() & published.keys())
    assert len(both) >= 10
    assert both == list(range(both[0], both[-1] + 1))
    assert all(found[sequence] == published[sequence] for sequence in both)


async def watch(subscription, published):
    async for sample in subscription:
        published[sample.header.sequence] = bytes(sample.payload)
