"""`import robomesh`: states, requests and control, from a real site."""

import asyncio
import gc
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import robomesh
from tests.patience import be_patient
from tests.site import running_site

pytestmark = pytest.mark.processes

DOCUMENT = Path(__file__).parents[2] / "docs" / "python.md"
WAIT_S = 60.0


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    with running_site(tmp_path_factory.mktemp("client"), services=["recorder"]) as running:
        yield running


@pytest.fixture
def mesh(site, monkeypatch):
    be_patient(monkeypatch.setattr)
    with robomesh.connect(site.router, timeout_s=20.0) as connected:
        yield connected


@pytest.fixture
def robot(mesh, site):
    """The arm, at rest and without a latched stop afterwards."""
    deadline = time.monotonic() + WAIT_S
    robot = mesh.robot("arm")
    while robot.last("description") is None and time.monotonic() < deadline:
        time.sleep(0.1)
    yield robot
    with robot.control("test", take="end of the test") as arm:
        if robot.last("controller").message.HasField("stop"):
            arm.reset()
        try:
            arm.speed(100)
        except robomesh.RobomeshError as error:
            raise AssertionError("\n".join(site.log[-40:])) from error  # why its own control ended


def test_joint_states_arrive_with_time_degrees_and_age(robot):
    with robot.joints() as states:
        first, second = next(states), next(states)
    assert first.live
    assert not first.stale
    assert second.time_ns > first.time_ns
    assert second.age_s < WAIT_S
    assert first.names == tuple(joint.name for joint in robot.description().joints)
    assert robot.si(first.positions_deg) == pytest.approx(first.positions)
    assert first[first.names[0]] == first.positions[0]


def test_a_slow_program_gets_the_newest_state_and_the_number_of_skipped_ones(robot):
    with robot.joints() as states:
        before = next(states)
        robot.last("controller")
        while next(states).time_ns < before.time_ns + 300_000_000:
            time.sleep(0.1)
        assert states.skipped > 0


def test_an_unknown_name_is_refused_with_what_there_is(mesh, robot):
    with pytest.raises(
        robomesh.RobotNotFoundError, match="no robot 'nobody' on the mesh; there are: test/arm"
    ):
        mesh.robot("nobody")
    with pytest.raises(robomesh.RobomeshError, match="no topic 'joint'"):
        robot.topic("joint")


def test_a_silent_topic_raises_instead_of_repeating_its_last_value(robot):
    with robot.topic("replay") as states, pytest.raises(robomesh.StaleError, match="no current message"):
        next(states)


def test_motions_wait_for_their_end_and_refusals_carry_their_code(robot):
    with robot.control("ops") as arm:
        arm.home()
        arm.move_joints_deg([10, 80, -80, 0, 0])
        assert next(robot.joints()).positions_deg == pytest.approx([10, 80, -80, 0, 0], abs=0.5)
        with pytest.raises(robomesh.RefusedError) as refused:
            arm.move_joints_deg([1000, 0, 0, 0, 0])
        assert refused.value.code == "joints.outside"
        with robot.control("other", take="it is needed elsewhere"):
            pass
        with pytest.raises(robomesh.RefusedError):
            arm.hold()
    assert not robot.last("controller").message.HasField("stop")


def test_a_jog_runs_while_it_is_held_and_says_how_far(robot):
    with robot.control("ops") as arm:
        arm.home()
        begin = robot.forward(next(robot.joints()).positions)["tool"]
        held = iter([True] * 12)
        result = arm.jog("z", -0.05, held=lambda: next(held, False))
        # A busy machine may be late with a keep-alive.
        assert result.code in ("jog.released", "jog.not_alive")
        assert not result.rotary
        end = robot.forward(next(robot.joints()).positions)["tool"]
        assert np.asarray(end)[2, 3] - np.asarray(begin)[2, 3] == pytest.approx(-result.distance, abs=1e-3)
        with pytest.raises(robomesh.RefusedError) as refused:
            arm.jog(1, 99.0, held=lambda: True)
        assert refused.value.code == "jog.speed"
        with pytest.raises(robomesh.MessageError, match="no axis"):
            arm.jog("w", 0.1, held=lambda: True)
    assert not robot.last("controller").message.HasField("stop")


def test_an_exception_during_a_motion_stops_the_robot(robot):
    with pytest.raises(ZeroDivisionError), robot.control("ops") as arm:  # noqa: PT012
        arm.speed(2)
        arm.move_joints_deg([-100, 20, 30, 0, 0], wait=False)
        raise ZeroDivisionError
    assert robot.last("controller").message.stop.by == "ops"


def test_a_refused_motion_leaves_the_one_before_it_running_and_guarded(robot):
    with pytest.raises(robomesh.RefusedError) as refused, robot.control("ops") as arm:  # noqa: PT012
        arm.speed(2)
        arm.move_joints_deg([-100, 20, 30, 0, 0], wait=False)
        arm.move_joints_deg([1000, 0, 0, 0, 0])
    assert refused.value.code == "joints.outside"
    assert robot.last("controller").message.stop.by == "ops"  # not the gateway, at the end of control


@pytest.fixture
def ctrl_c():
    """Handle SIGINT as in a terminal: a shell starts background jobs with SIGINT ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_during_a_motion_stops_the_robot(robot):
    def press():
        for state in robot.topic("lease"):
            if state.message.motion:
                os.kill(os.getpid(), signal.SIGINT)
                return

    with pytest.raises(KeyboardInterrupt), robot.control("ops") as arm:  # noqa: PT012
        arm.speed(2)
        pressing = threading.Thread(target=press)
        pressing.start()
        arm.move_joints_deg([100, 20, 30, 0, 0])
    pressing.join()
    assert robot.last("controller").message.stop.by == "ops"


@pytest.mark.parametrize("what", ["hung", "stopped", "killed"])
def test_the_robot_is_stopped_when_its_script_is(robot, site, what):
    arguments = ("-m", "tests.robomesh.unattended_script", "hung", site.router)
    with subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE, text=True) as script:
        try:
            assert script.stdout.readline() == "moving\n"
            if what != "hung":
                script.send_signal(signal.SIGSTOP if what == "stopped" else signal.SIGKILL)
            wait_for(robot, "lease", lambda lease: not lease.holder)
            wait_for(robot, "controller", lambda state: state.HasField("stop"))
        finally:
            script.kill()


def wait_for(robot, topic, condition):
    deadline = time.monotonic() + WAIT_S
    for state in robot.topic(topic):
        if condition(state.message):
            return
        assert time.monotonic() < deadline


def test_a_script_that_does_not_disconnect_ends(robot, site):
    arguments = ("-m", "tests.robomesh.unattended_script", "forgetful", site.router)
    ended = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, timeout=WAIT_S)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "moving\n", "")


def test_the_asynchronous_form_reads_and_moves(site, robot):
    async def main():
        async with robomesh.connect_async(site.router, timeout_s=20.0) as mesh:
            arm_robot = await mesh.robot("test/arm")
            async for state in arm_robot.joints():
                assert len(state.positions_deg) == 5
                break
            async with arm_robot.control("ops") as arm:
                await arm.home()
                moving = asyncio.create_task(arm.move_joints_deg([-100, 20, 30, 0, 0]))
                async for lease in arm_robot.topic("lease"):
                    if lease.message.motion:
                        break
                moving.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await moving
            assert arm.stopped.sent

    asyncio.run(main())


def test_a_recording_of_a_site_is_the_same_over_the_mesh_and_as_a_file(mesh, site, robot, tmp_path):
    arguments = ("record", "arm", "--name", "notes", "--view", "-", "--connect", site.router)
    with subprocess.Popen([sys.executable, "-m", "services.command_line.main", *arguments]) as recording:
        try:
            wait_for(robot, "recording", lambda state: state.name == "notes" and state.open)
            with robot.control("ops") as arm:
                arm.home()
            opened = mesh.open_recording("test/notes")
            assert opened.info.open
            while not len(opened.joints()):
                time.sleep(0.1)
            while_open = opened.joints()
            recording.send_signal(signal.SIGINT)
            assert recording.wait(WAIT_S) == 0
        finally:
            recording.kill()
    wait_for(robot, "recording", lambda state: state.name == "notes" and not state.open)
    deadline = time.monotonic() + WAIT_S
    while (info := mesh.recordings()[0]).open:
        assert time.monotonic() < deadline
        time.sleep(0.1)
    over_mesh, on_disk = (
        mesh.open_recording(info),
        robomesh.open_recording(mesh.fetch_recording(info, tmp_path)),
    )
    states, same = over_mesh.joints(), on_disk.joints()
    assert states.units == ("rad",) * 5
    assert len(states) > 10
    assert states.time_ns.tolist() == same.time_ns.tolist()
    assert states.positions_deg.tolist() == same.positions_deg.tolist()
    assert while_open.time_s.tolist() == states.time_s[: len(while_open)].tolist()
    assert [event.code for event in over_mesh.events()] == [event.code for event in on_disk.events()]
    tool = over_mesh.values("kinematics/tool/x")["kinematics/tool/x"]
    assert (tool.unit, len(tool) > 3) == ("m", True)
    with pytest.raises(robomesh.RecordingError, match="there are test/notes"):
        mesh.open_recording("other/notes")


def test_the_last_joint_state_is_a_joint_state(robot):
    state = robot.last("joints")
    assert len(state.positions_deg) == 5
    assert repr(state).startswith(f"<state of test/arm at {state.time:%H:%M:%S.%f}: waist ")


def test_a_wait_for_an_event_ends_in_time(robot):
    with robot.events(history=False) as events:
        # Events of earlier tests may arrive late.
        until_none = iter(lambda: events.next(timeout_s=0.1), None)
        with pytest.raises(TimeoutError, match=r"robomesh/test/arm/events/\*\*: no message within 0\.1 s"):
            list(until_none)
        assert repr(events) == "<stream of robomesh/test/arm/events/**>"


def test_errors_of_values_have_their_code_and_a_program_needs_no_text(robot):
    with robot.control("ops") as arm:
        with pytest.raises(robomesh.MessageError) as wrong:
            arm.move_joints_deg([1, 2, 3])
        assert (wrong.value.code, wrong.value.reason.values["joints"]) == ("joints.count", "5")
        with pytest.raises(robomesh.MessageError, match=r"write Path\('square\.program'\)"):
            arm.run("square.program")
        assert arm.home().text == "done"


def test_a_connection_that_is_no_longer_used_ends(site):
    def threads():
        return sum(thread.name == "robomesh" for thread in threading.enumerate())

    before = threads()
    states = [robomesh.connect(site.router, timeout_s=20.0).robot("arm").joints() for _ in range(3)]
    gc.collect()
    assert next(states[0]).positions  # the stream keeps its connection
    assert threads() == before + 3
    states.clear()
    gc.collect()
    deadline = time.monotonic() + WAIT_S
    while threads() > before:
        assert time.monotonic() < deadline
        time.sleep(0.1)


@pytest.mark.parametrize(
    "error",
    [
        robomesh.RobotNotFoundError("arm", ["a/arm", "b/arm"], ["a/arm"]),
        robomesh.StaleError("a/arm/joints", 1.0, 2.0, None),
        robomesh.QuotaError("too much", again_s=2.0),
        robomesh.RecordingError("damaged"),
        robomesh.MotionError("stopped", text="it was stopped"),
    ],
)
def test_errors_keep_their_text_and_fields_between_processes(error):
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))


def test_the_document_names_everything_public():
    text = DOCUMENT.read_text(encoding="utf-8")
    assert [name for name in robomesh.__all__ if f"`{name}" not in text] == []
    assert all(getattr(robomesh, name) is not None for name in robomesh.__all__)


def test_importing_the_package_alone_imports_no_zenoh():
    code = "import sys, robomesh; print('zenoh' in sys.modules, 'numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False False\n"
