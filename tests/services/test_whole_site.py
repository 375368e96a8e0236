"""A site as real processes: commanded, recorded, killed part by part."""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from math import degrees, radians

import pytest
from mcap.reader import make_reader

from robomesh import reason_codes as codes
from robomesh.contract.keys import parse_key
from robomesh.contract.topics import topic
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from services.errors import TRY_AGAIN
from tests.conftest import last_value, rest_is_long, run
from tests.ports import free_port
from tests.refusals import refused
from tests.site import ONE_ARM, alive, kill, robomesh, running_site, site_file, wait_until

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    with running_site(tmp_path_factory.mktemp("site")) as running:
        yield running


async def last_positions(session) -> list[float]:
    """Return joint positions in degrees, the next live ones."""
    async for sample in session.subscribe("robomesh/test/arm/joints", history=False):
        return [degrees(joint.position) for joint in sample.message().joints]
    raise AssertionError


def test_list_names_the_robot_and_every_service_with_its_health(site):
    wanted = {
        "gateway",
        "kinematics",
        "player",
        "recorder",
        "renderer",
        "router",
        "console",
        "simulator",
        "watch",
        "store",
    }
    found = {}

    def all_there():
        found.update(json.loads(site.command("list", "--json").stdout))
        healthy = {each["service"] for each in found["services"] if each["round_trip_s"] is not None}
        return healthy == wanted and found["sites"][0]["alarms"] is not None

    wait_until(all_there, 60.0, "not every service is on the mesh with its health")
    (robot,) = found["robots"]
    assert (robot["site"], robot["robot"], robot["link"], robot["mode"]) == ("test", "arm", "up", "remote")
    assert robot["age_s"] < 1.0
    for service in found["services"]:
        # All have one clock: what differs is what the way is uncertain by.
        assert abs(service["clock_offset_s"]) <= service["round_trip_s"] / 2 + 1e-3
        assert service["version"]
        assert service["memory_bytes"] > 1e6


def test_joints_arrive_where_they_were_sent_and_the_recording_holds_all_that_a_monitor_saw(site):
    target = [12.0, 34.5, -20.0, 15.0, -40.0]

    async def watch():
        """Return all messages on `joints` between trace on and trace off."""
        async with open_session(site.mesh) as session:
            seen = []

            async def collect(states):
                async for sample in states:
                    seen.append((sample.header.publisher, sample.header.sequence, sample.payload))

            async def send(*words):
                result = await asyncio.to_thread(site.command, "send", "arm", *words, "--json")
                answer = json.loads(result.stdout)
                assert answer["accepted"], answer
                assert result.returncode == 0

            await send("trace", "on")
            while (await recordings(session))[0].topics == []:
                await asyncio.sleep(0.05)
            states = session.subscribe("robomesh/test/arm/joints", newest=20_000, history=False)
            collector = asyncio.create_task(collect(states))
            await send("move", *map(str, target))
            assert await last_positions(session) == pytest.approx(target, abs=0.02)
            collector.cancel()
            await send("trace", "off")
            while (await recordings(session))[0].open:
                await asyncio.sleep(0.05)
            return seen, (await recordings(session))[0], states.lost("robomesh/test/arm/joints")

    async def recordings(session):
        answer = await session.ask("robomesh/test/-/recordings/list", timeout_s=30.0)
        return answer.recordings

    seen, recording, lost = run(watch(), timeout_s=60.0)
    assert len(seen) > 25
    assert lost == 0
    file = site.folder / "recordings" / "arm" / recording.file
    with file.open("rb") as stream:
        recorded = {
            message.data
            for _, channel, message in make_reader(stream).iter_messages()
            if channel.topic == "robomesh/test/arm/joints"
        }
    assert {payload for _, _, payload in seen} <= recorded
    info = json.loads(robomesh("recordings", "info", str(file), "--json").stdout)
    counts = {topic["topic"].rsplit("/", 1)[-1]: topic for topic in info["topics"]}
    assert counts["joints"]["lost"] == 0
    assert {"joints", "controller", "frames", "description", "free"} <= set(counts)


async def test_home_brings_the_joints_home(site):
    result = site.command("send", "arm", "home")
    assert result.returncode == 0, result.stderr + result.stdout

    async with open_session(site.mesh) as session:
        description = await last_value(session, "robomesh/test/arm/description")
        homes = [degrees(joint.home) for joint in description.joints]
        assert await last_positions(session) == pytest.approx(homes, abs=0.02)


@pytest.fixture
def slow(site):
    """Slow down the arm, so that a motion takes longer than a busy machine needs for a command."""
    assert site.command("send", "arm", "speed", "10").returncode == 0
    yield
    assert site.command("send", "arm", "speed", "100").returncode == 0


@pytest.mark.usefixtures("slow")
def test_a_stop_needs_no_control_ends_the_motion_and_latches_until_reset(site):
    mover = subprocess.Popen(
        [
            *(sys.executable, "-m", "services.command_line.main", "send", "arm"),
            *("move", "-140", "0", "0", "0", "0", "--connect", site.router, "--json"),
        ],
        stdout=subprocess.PIPE,
        text=True,
    )

    async def main():
        async with open_session(site.mesh) as session:
            async for sample in session.subscribe("robomesh/test/arm/lease", newest=50):
                if sample.message().motion:
                    break
            stopped = await asyncio.to_thread(site.command, "send", "arm", "stop", "--json")
            assert json.loads(stopped.stdout)["accepted"]
            positions = await last_positions(session)
            while (again := await last_positions(session)) != positions:
                positions = again
            assert positions[0] > -139.0

    run(main())
    out, _ = mover.communicate(timeout=20)
    answer = json.loads(out)
    assert not answer["accepted"]
    assert "stop" in answer["text"]
    assert mover.returncode == 1
    refused = site.command("send", "arm", "home")
    assert refused.returncode == 1
    assert "stop 1 is latched" in refused.stdout
    assert site.command("send", "arm", "reset").returncode == 0
    assert site.command("send", "arm", "home").returncode == 0


@pytest.mark.usefixtures("slow")
def test_ctrl_c_on_send_stops_the_robot(site):
    mover = subprocess.Popen(
        [
            *(sys.executable, "-m", "services.command_line.main", "send", "arm"),
            *("move", "140", "0", "0", "0", "0", "--connect", site.router),
        ],
        stdout=subprocess.PIPE,
        text=True,
    )

    async def until_moving():
        async with open_session(site.mesh) as session:
            async for sample in session.subscribe("robomesh/test/arm/lease", newest=50):
                if sample.message().motion:
                    return

    run(until_moving())
    mover.send_signal(signal.SIGINT)
    out, _ = mover.communicate(timeout=20)
    assert "interrupted" in out
    assert mover.returncode == 1
    assert site.command("send", "arm", "reset").returncode == 0


def test_a_move_beyond_a_limit_is_refused_in_words_and_audited(site):
    result = site.command("send", "arm", "move", "0", "0", "131", "0", "0")
    assert result.returncode == 1
    assert "elbow" in result.stdout
    assert "131.00°" in result.stdout
    assert "110.00°" in result.stdout

    async def main():
        async with open_session(site.mesh) as session:
            audit = await last_value(session, "robomesh/test/arm/audit")
            entry = next(entry for entry in reversed(audit.entries) if entry.request == "MOVE_ABSOLUTE")
            assert entry.outcome == schema.AuditEntry.REFUSED
            assert "110.00°" in entry.text
            with refused(codes.LEASE_NONE):
                await session.ask(
                    "robomesh/test/arm/command/intruder",
                    schema.CommandRequest(command=schema.CommandRequest.HOME, lease="guessed", id=1),
                )

    run(main())
    log = site.folder / "audit" / "test" / "arm.jsonl"
    assert robomesh("audit", "verify", str(log)).returncode == 0
    lines = log.read_bytes().splitlines(keepends=True)
    forged = site.folder / "forged.jsonl"
    forged.write_bytes(
        b"".join(lines).replace(b'"REFUSED"', b'"ACCEPTED"').replace(b'"refused"', b'"accepted"')
    )
    assert robomesh("audit", "verify", str(forged)).returncode == 1


async def test_forward_kinematics_is_answered_and_wrong_counts_are_refused(site):
    async with open_session(site.mesh) as session:
        key = "robomesh/test/arm/kinematics/forward"
        sample = [radians(q) for q in (100.0, 30.45, 92.66, -67.10, -25.85)]
        answer = await session.ask(key, schema.ForwardRequest(joint_positions=sample))
        x, y, z = (answer.tool_to_base[index] for index in (3, 7, 11))
        assert (x, y, z) == pytest.approx((-0.0281, 0.1594, 0.8528), abs=1e-4)
        with refused(codes.JOINT_COUNT_OF_FIELD):
            await session.ask(key, schema.ForwardRequest(joint_positions=[0.0]))


def test_snapshot_saves_a_picture(site, tmp_path):
    out = tmp_path / "top.png"
    result = site.command("snapshot", "arm", "top", str(out))
    assert result.returncode == 0, result.stderr
    assert out.read_bytes().startswith(b"\x89PNG")


def test_the_layout_for_other_viewers_names_topics_and_services_that_there_are(site, tmp_path):
    path = tmp_path / "layout.json"
    written = site.command("foxglove", "--robot", "arm", "--layout", str(path))
    assert (written.returncode, written.stderr) == (0, "")
    layout = json.loads(path.read_text())
    with urllib.request.urlopen(f"{site.console.rstrip('/')}/layout/test/arm.json", timeout=20) as answer:
        assert json.load(answer) == layout
    panels = layout["configById"]
    keys = [
        panels["Image!video"]["imageMode"]["imageTopic"],
        panels["RawMessages!controller"]["topicPath"],
        *(
            each["value"].partition(".")[0]
            for name in ("joints", "tool")
            for each in panels[f"Plot!{name}"]["paths"]
        ),
    ]
    assert {parse_key(key).topic for key in keys} == {"video/free", "controller", "joints", "kinematics"}
    assert all(topic(parse_key(key).topic) for key in keys)
    assert len(panels["Plot!joints"]["paths"]) == 5
    commands = {each["serviceName"] for name, each in panels.items() if name.startswith("CallService")}
    assert commands == {f"robomesh/test/arm/{name}" for name in ("stop", "home", "hold", "resume", "reset")}
    assert "add --robot" in site.command("foxglove", "--layout", str(path)).stderr
    nowhere = site.command("foxglove", "--robot", "arm", "--layout", str(tmp_path / "no" / "layout.json"))
    assert nowhere.returncode == 2
    with pytest.raises(urllib.error.HTTPError) as unknown:
        urllib.request.urlopen(f"{site.console.rstrip('/')}/layout/test/nobody.json", timeout=20)
    assert unknown.value.code == 504
    unknown.value.close()


def test_monitor_prints_a_line_a_state(site):
    result = site.command("monitor", "arm", "--json", "--count", "5")
    rows = [json.loads(line) for line in result.stdout.splitlines()]
    assert len(rows) == 5
    assert [row["sequence"] for row in rows[1:]] == list(range(rows[1]["sequence"], rows[1]["sequence"] + 4))
    assert list(rows[0]["joints"]) == ["waist", "shoulder", "elbow", "wrist", "roll"]
    assert {"control": "", "clearance": None, "program": None}.items() <= rows[0].items()


@pytest.mark.parametrize(
    "victim",
    rest_is_long(4, ["gateway", "kinematics", "console", "router", "simulate", "recorder", "renderer"]),
)
async def test_a_killed_service_comes_back_and_the_others_did_not_notice(site, victim):
    before = site.children()
    kill(before[victim])
    wait_until(
        lambda: site.children().get(victim, before[victim]) != before[victim], what=f"{victim} did not return"
    )
    after = site.children()
    assert {name: pid for name, pid in after.items() if name != victim} == {
        name: pid for name, pid in before.items() if name != victim
    }

    async with open_session(site.mesh) as session:
        for topic in ("joints", "frames", "controller"):
            async for sample in session.subscribe(f"robomesh/test/arm/{topic}", history=False):
                assert sample.live
                break


@pytest.fixture
def controller():
    """Yield the address of a simulated controller that outlives the site, as a real one does."""
    process = subprocess.Popen(
        [sys.executable, "-m", "services.command_line.main", "simulate", "--listen", "127.0.0.1:0", "--demo"],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process.stdout.readline().strip().removeprefix("listening on ")
    finally:
        process.kill()
        process.communicate()


def unit_of(controller: str) -> str:
    """Return the unit that a controller sends now."""
    host, port = controller.split(":")
    received = b""
    with socket.create_connection((host, int(port)), timeout=20.0) as connection:
        while received.count(b"TIME") < 3:
            received += connection.recv(4096)
    return received.decode().split("TIME")[1]


def test_ctrl_c_waits_until_what_moves_is_stopped_and_what_is_recorded_is_closed(tmp_path, controller):
    robots = f'[[robot]]\nname = "arm"\nmodel = "pt600"\ncontroller = "tcp://{controller}"\n'
    robots += "stop_proven = true\n"
    with running_site(tmp_path, robots=robots, services=["recorder"]) as running:
        children = running.children()
        assert len(children) == 5
        for words in (("speed", "10"), ("trace", "on")):
            assert running.command("send", "arm", *words).returncode == 0
        mover = subprocess.Popen(
            [
                *(sys.executable, "-m", "services.command_line.main", "send", "arm"),
                *("move", "-140", "0", "0", "0", "0", "--connect", running.router),
            ],
            stdout=subprocess.PIPE,
            text=True,
        )

        async def until_moving_and_recorded():
            async with open_session(running.mesh) as session:
                async for sample in session.subscribe("robomesh/test/arm/lease", newest=50):
                    if sample.message().motion:
                        break
                async for sample in session.subscribe("robomesh/test/arm/recording", newest=50):
                    if sample.message().open:
                        return

        try:
            run(until_moving_and_recorded(), timeout_s=60.0)
            # Both get no time at all, as on a busy machine, until the supervisor says that it waits.
            slow = {name: children[name] for name in ("gateway", "recorder")}
            for pid in slow.values():
                kill(pid, signal.SIGSTOP)
            os.killpg(running.process.pid, signal.SIGINT)
            for name in slow:
                wait_until(lambda name=name: any(f"waiting for {name}: " in line for line in running.log))
            for pid in slow.values():
                kill(pid, signal.SIGCONT)
            assert running.process.wait(20.0) == 0
            assert not [name for name, pid in children.items() if alive(pid)]
        finally:
            mover.kill()
            mover.communicate()
    wait_until(lambda: "stopped" in unit_of(controller), what="the controller was not stopped")
    unit = unit_of(controller)
    assert float(unit.split("ABSOLUTE.DEG*")[1].split(";")[0]) > -139.0, unit
    recordings = [*(tmp_path / "recordings").glob("arm/*.mcap")]
    assert recordings
    for each in recordings:
        with each.open("rb") as stream:
            assert make_reader(stream).get_summary().statistics.message_count
    log = tmp_path / "audit" / "test" / "arm.jsonl"
    assert robomesh("audit", "verify", str(log)).returncode == 0
    entries = [json.loads(line) for line in log.read_text().splitlines()]
    # The program that moved the arm may have asked for more, which is refused and in the log too. On a busy
    # machine its renewals may have had no answer: then it requests the stop itself, and the gateway none.
    # The resumed gateway may first stop because it has heard nothing of the controller; then the program
    # releases control before the gateway ends it.
    requests = [each["request"] for each in entries]
    stopped = requests.index("STOP")
    assert requests.index("MOVE_ABSOLUTE") < stopped, requests
    ended = next(
        each
        for each in entries[stopped:]
        if each["request"] in ("REVOKE", "RELEASE", "EXPIRE") and each["outcome"] == "ACCEPTED"
    )
    # On a busy machine the program may not have renewed its lease in time.
    assert ended["request"] == "RELEASE" or (ended["request"], ended["why"]["code"]) in (
        ("REVOKE", "lease.ended.gateway"),
        ("EXPIRE", "lease.ended.expired"),
    )


def test_ctrl_c_again_ends_a_site_that_still_waits(tmp_path):
    with running_site(tmp_path, services=["recorder"]) as running:
        # One that has just been started has nothing to close, and is not waited for.
        wait_until(lambda: running.command("alive", "test/recorder").returncode == 0)
        children = running.children()
        kill(children["recorder"], signal.SIGSTOP)
        os.killpg(running.process.pid, signal.SIGINT)
        wait_until(lambda: any("waiting for recorder: closing" in line for line in running.log))
        os.killpg(running.process.pid, signal.SIGINT)
        # Not the time after which the recorder is killed anyway.
        running.process.wait(20.0)
        wait_until(lambda: not any(alive(pid) for pid in children.values()))
        assert not [line for line in running.log if "did not end within" in line]


def test_no_orphan_outlives_a_killed_supervisor(tmp_path):
    with running_site(tmp_path, services=()) as running:
        children = running.children()
        kill(running.process.pid)
        running.process.wait()
        wait_until(lambda: not any(alive(pid) for pid in children.values()), 5.0, "orphans")


def test_a_monitor_at_a_second_site_sees_the_firsts_robot(site, tmp_path):
    robots = ONE_ARM.replace('"arm"', '"other"')
    more = f'connect = ["{site.router}"]'
    with running_site(tmp_path, name="second", robots=robots, more=more, services=()) as second:

        def both_seen() -> bool:
            found = json.loads(second.command("list", "--json").stdout)["robots"]
            return {(row["site"], row["robot"], row["link"]) for row in found} == {
                ("test", "arm", "up"),
                ("second", "other", "up"),
            }

        wait_until(both_seen)
        rows = second.command("monitor", "test/arm", "--json", "--count", "3").stdout.splitlines()
        assert all(json.loads(row)["key"] == "robomesh/test/arm/joints" for row in rows)
        assert second.command("send", "test/arm", "home").returncode == 0


def test_bad_input_is_one_line_that_names_it_and_exit_status_2(tmp_path):
    router = f"tcp/127.0.0.1:{free_port()}"
    unreadable = tmp_path / "broken.toml"
    unreadable.write_text("site = [")
    unknown = site_file(
        tmp_path,
        robots=ONE_ARM.replace("pt600", "pt6000"),
        router=router,
        console=f"127.0.0.1:{free_port()}",
    )
    no_address = site_file(
        tmp_path / "known", robots=ONE_ARM, router=router, console=f"127.0.0.1:{free_port()}"
    )
    there = "tcp://127.0.0.1:5400"
    two = site_file(
        tmp_path / "two",
        robots=ONE_ARM + ONE_ARM.replace('"arm"', '"arm-2"'),
        router=router,
        console=f"127.0.0.1:{free_port()}",
    )
    mesh = tmp_path / "base.wrl"
    mesh.write_text("not a mesh")
    command_lines = {
        ("up", str(tmp_path / "none.toml")): "none.toml",
        ("up", str(unreadable)): "broken.toml",
        ("kinematics", "--site", str(unknown)): "pt6000",
        ("gateway", "--site", str(no_address)): "--controller arm=",
        (
            "gateway",
            "--site",
            str(two),
            *("--controller", f"arm={there}", "--controller", f"arm-2={there}"),
        ): "127.0.0.1:5400 is given twice, to robot arm's controller and to robot arm-2's controller",
        ("list", "--connect", router): "no router",
        ("list", "--connect", "nonsense"): "nonsense",
        ("monitor", "arm", "--connect", router): "no router",
        ("send", "arm", "jump"): "jump",
        ("shapes", "info", str(mesh)): "base.wrl",
        ("simulate", "--listen", "nowhere"): "nowhere",
        ("simulate", "--robot", "pt6000"): "pt6000",
        ("robot", "show", "pt6000"): "pt6000",
    }
    with ThreadPoolExecutor(4) as together:
        results = list(together.map(lambda arguments: robomesh(*arguments), command_lines))
    for (arguments, words), result in zip(command_lines.items(), results, strict=True):
        assert result.returncode == 2, (arguments, result)
        assert words in result.stderr, (arguments, result.stderr)
        assert "Traceback" not in result.stderr
        assert len(result.stderr.strip().splitlines()) == 1, result.stderr


def test_a_taken_port_ends_up_with_one_line_and_a_status_that_says_to_try_again(site, tmp_path):
    path = site_file(tmp_path, robots=ONE_ARM, router=site.router, console=f"127.0.0.1:{free_port()}")
    result = robomesh("up", str(path))
    assert result.returncode == TRY_AGAIN
    user = f"process {site.process.pid} (robomesh up)"
    assert f"cannot listen on {site.router.removeprefix('tcp/')}: {user} uses the port. " in result.stderr
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
