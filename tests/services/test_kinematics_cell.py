"""Kinematics of a cell: clearances of arms to fixtures and to each other, and their events."""

import asyncio
from contextlib import asynccontextmanager

import numpy as np
import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh import reason_codes as codes
from robomesh.contract import quotas
from robomesh.files.worker import Worker
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from robots.collision import build_cell, outside_clearance, own_nearest
from robots.descriptions.cells import CellDescription, CellRobot, Fixture
from robots.kinematics.model import tool_placement
from services import kinematics
from services.kinematics import answers
from services.kinematics.cell_state import CellState
from services.site_file.tables.fixtures import Fixture as FixtureRow
from services.site_file.tables.fixtures import fixture_shape
from tests.conftest import last_value, run
from tests.refusals import refused
from tests.site import alive

NAMES = ("waist", "shoulder", "elbow", "wrist", "roll")
HOME = np.radians([0.0, 90.0, -90.0, 0.0, 0.0])


def at(x, y, z):
    placement = np.eye(4)
    placement[:3, 3] = x, y, z
    return placement


POST = fixture_shape(FixtureRow(cell="a", name="post", cylinder=(40.0, 1000.0), color="#c9a227"))
CELL = CellDescription(
    robots=(
        CellRobot(name="left", model="pt600", base_to_site=at(0.0, 0.45, 0.0)),
        CellRobot(name="right", model="pt600", base_to_site=at(0.0, -0.45, 0.0)),
    ),
    fixtures=(Fixture("post", (POST,), at(0.6, 0.0, 0.5), POST.color),),
)
BUILT = build_cell(CELL)


@asynccontextmanager
async def cell_service(mesh, *, simulated=True):
    """Run the service of the cell; yield a session for its gateways and one for a monitor."""
    async with open_session(mesh) as service, open_session(mesh) as gateway, open_session(mesh) as monitor:
        robots = tuple(
            kinematics.RobotSettings(name=robot.name, cell_description=CELL, cell="a", simulated=simulated)
            for robot in CELL.robots
        )
        task = asyncio.create_task(kinematics.serve(service, kinematics.Settings(site="hall", robots=robots)))
        try:
            yield gateway, monitor
        finally:
            task.cancel()
            (outcome,) = await asyncio.gather(task, return_exceptions=True)
            assert isinstance(outcome, asyncio.CancelledError), outcome


@asynccontextmanager
async def publishing(gateway, poses):
    """Publish joint states of the robots' poses, by name, at 50 Hz; changing the dictionary moves a robot."""

    async def publish():
        publishers = {}
        while True:
            for name, positions in list(poses.items()):
                if name not in publishers:
                    publishers[name] = gateway.declare_publisher("hall", name, "joints")
                message = JointStates()
                message.timestamp.GetCurrentTime()
                for joint, position in zip(NAMES, positions, strict=True):
                    message.joints.add(name=joint, position=position)
                publishers[name].put(message)
            await asyncio.sleep(0.02)

    task = asyncio.create_task(publish())
    try:
        yield poses
    finally:
        task.cancel()


async def until(session, topic, predicate):
    """Return the first live message of a topic of the left arm that meets the predicate."""
    async for sample in session.subscribe(f"robomesh/hall/left/{topic}", newest=10):
        if sample.live and predicate(message := sample.message()):
            return message
    raise AssertionError("the subscription ended")


async def test_the_description_lists_the_cells_fixtures_and_their_shapes_are_served(mesh):
    async with cell_service(mesh) as (_, monitor):
        for robot in ("left", "right"):
            description = await last_value(monitor, f"robomesh/hall/{robot}/description")
            (fixture,) = description.fixtures
            assert (fixture.name, fixture.color, description.cell) == ("post", "#c9a227", "a")
            assert fixture.fixture_to_site == at(0.6, 0.0, 0.5).ravel().tolist()
            assert (description.warning_distance, description.stop_distance) == (0.05, 0.01)
            glb = await monitor.ask_bytes(f"robomesh/hall/{robot}/mesh/{fixture.mesh}", timeout_s=40.0)
            assert glb.startswith(b"glTF")


async def test_clearance_counts_the_other_robot_only_while_it_reports_its_position(mesh):
    left = np.radians([-57.0, 90.0, -67.0, 0.0, 0.0])
    right = np.radians([69.0, 79.0, -73.0, 0.0, 0.0])

    async with (
        cell_service(mesh) as (gateway, monitor),
        publishing(gateway, {"left": left, "right": right}) as poses,
    ):
        state = await until(monitor, "kinematics", lambda m: m.HasField("clearance") and not m.not_counted)
        expected = outside_clearance(BUILT, "left", left, {"right": right})
        assert expected.pair[1].startswith("right/")
        assert state.clearance.distance == pytest.approx(expected.distance_m, abs=1e-9)
        assert (state.clearance.first, state.clearance.second) == tuple(
            f"hall/{name}" for name in expected.pair
        )
        points = [(p.x, p.y, p.z) for p in (state.clearance.first_point, state.clearance.second_point)]
        assert np.subtract(*points) @ np.subtract(*points) == pytest.approx(expected.distance_m**2)
        nearest = own_nearest(BUILT, "left", left)
        # GJK's result depends on the pose measured before, within its tolerance.
        assert state.own_clearance.distance == pytest.approx(nearest.distance_m, abs=1e-6)
        del poses["right"]
        state = await until(monitor, "kinematics", lambda m: m.not_counted)
        assert list(state.not_counted) == ["right"]
        assert state.clearance.second == "hall/post"
        event = await until(monitor, "events/kinematics", lambda m: m.code == "kinematics.not_counted")
        assert event.values["robot"] == "right"
        poses["right"] = right
        await until(monitor, "kinematics", lambda m: not m.not_counted)


async def test_an_arm_with_unproven_joints_has_no_clearance_and_counts_for_no_other(mesh):
    left, right = np.radians([[-57.0, 90.0, -67.0, 0.0, 0.0], [69.0, 79.0, -73.0, 0.0, 0.0]])

    async with (
        cell_service(mesh) as (gateway, monitor),
        publishing(gateway, {"left": left, "right": right}),
    ):
        await until(monitor, "kinematics", lambda m: m.HasField("clearance") and not m.not_counted)
        controllers = {
            name: gateway.declare_publisher("hall", name, "controller") for name in ("left", "right")
        }
        controllers["right"].put(schema.ControllerState(joints_unproven=True))
        state = await until(monitor, "kinematics", lambda m: m.not_counted)
        assert list(state.not_counted) == ["right"]
        controllers["left"].put(schema.ControllerState(joints_unproven=True))
        state = await until(monitor, "kinematics", lambda m: m.joints_unproven)
        assert not state.HasField("clearance")
        # The pose of its tool is shown.
        assert len(state.tool_to_base) == 16
        assert not state.HasField("own_clearance")
        for each in controllers.values():
            each.put(schema.ControllerState())
        await until(monitor, "kinematics", lambda m: m.HasField("clearance") and not m.not_counted)


async def test_the_joints_of_a_real_arm_count_only_after_its_gateway_has_said_that_they_are_proven(mesh):
    async with (
        cell_service(mesh, simulated=False) as (gateway, monitor),
        publishing(gateway, {"left": HOME, "right": HOME}),
    ):
        state = await until(monitor, "kinematics", lambda m: m.joints_unproven)
        assert not state.HasField("clearance")
        gateway.declare_publisher("hall", "left", "controller").put(schema.ControllerState())
        state = await until(monitor, "kinematics", lambda m: m.HasField("clearance"))
        assert list(state.not_counted) == ["right"]
        gateway.declare_publisher("hall", "right", "controller").put(schema.ControllerState())
        await until(monitor, "kinematics", lambda m: m.HasField("clearance") and not m.not_counted)


async def test_late_joiners_receive_the_events_of_an_arm_near_a_post(mesh):
    near = np.radians([-36.87, 15.0, -30.0, 0.0, 0.0])
    assert 0 < outside_clearance(BUILT, "left", near, {}).distance_m < 0.01
    async with cell_service(mesh) as (gateway, monitor), publishing(gateway, {"left": HOME}) as poses:

        async def kept():
            return (await last_value(monitor, "robomesh/hall/left/events/kinematics")).events

        async def reported(code):
            while code not in [event.code for event in await kept()]:
                await asyncio.sleep(0.05)

        await until(monitor, "kinematics", lambda m: m.HasField("clearance"))
        poses["left"] = near
        await reported("kinematics.clearance.stop")
        poses["left"] = HOME
        await reported("kinematics.clearance.stop.over")
        events = await kept()
        found = [(event.severity, event.code) for event in events if "clearance" in event.code]
        assert found == [
            (schema.Event.WARNING, "kinematics.clearance.warning"),
            (schema.Event.ERROR, "kinematics.clearance.stop"),
            (schema.Event.INFO, "kinematics.clearance.warning.over"),
            (schema.Event.INFO, "kinematics.clearance.stop.over"),
        ]
        assert {event.values["second"] for event in events if "clearance" in event.code} == {"post"}


async def test_frames_repeat_the_fixtures_about_once_a_second(mesh):
    async with cell_service(mesh) as (gateway, monitor), publishing(gateway, {"left": HOME}):
        fixture_times_ns, between = [], 0
        async for sample in monitor.subscribe("robomesh/hall/left/frames", newest=100):
            frames = {each.child_frame_id: each for each in sample.message().transforms}
            assert "hall/left/tool" in frames
            if "hall/post" in frames:
                fixture_times_ns.append(sample.header.source_time_ns)
            else:
                between += bool(fixture_times_ns)
            if len(fixture_times_ns) == 2:
                break
        assert frames["hall/post"].parent_frame_id == "hall"
        assert frames["hall/post"].translation.x == pytest.approx(0.6)
        assert between
        assert fixture_times_ns[1] - fixture_times_ns[0] > 0.8e9


def test_inverse_and_check_run_in_processes_that_end_with_the_service(mesh, monkeypatch):
    workers = []

    def keep(*args, **kwargs):
        workers.append(Worker(*args, **kwargs))
        return workers[-1]

    async def main():
        async with cell_service(mesh) as (gateway, monitor), publishing(gateway, {"left": HOME}):
            await until(monitor, "frames", lambda m: True)
            key = "robomesh/hall/left/kinematics"
            pose = tool_placement(BUILT.arms["left"].model, HOME).ravel().tolist()
            request = schema.InverseRequest(pose=pose, task=2, near=HOME)
            answer = await monitor.ask(f"{key}/inverse", request, timeout_s=60.0)
            assert answer.solutions[0].joint_positions == pytest.approx(HOME.tolist(), abs=1e-6)
            request = schema.CheckRequest(program="move_joints 30 90 -90 0 0\nhome\n")
            answer = await monitor.ask(f"{key}/check/li", request, timeout_s=60.0)
            assert answer.ok, answer
            assert answer.duration_s > 1.0
            assert codes.CHECK_NOTE_LEFT_OUT(name="right").text in answer.notes
            # The quota allows a client two concurrent checks; these two wait until the third was refused.
            monkeypatch.setattr(quotas, "_AGAIN_S", 60.0)
            started, release = asyncio.Semaphore(0), asyncio.Event()
            ask = Worker.ask

            async def blocked_ask(*args, **kwargs):
                started.release()
                await release.wait()
                return await ask(*args, **kwargs)

            with monkeypatch.context() as patch:
                patch.setattr(Worker, "ask", blocked_ask)
                two = [
                    asyncio.create_task(monitor.ask(f"{key}/check/li", request, timeout_s=30.0))
                    for _ in range(2)
                ]
                for _ in two:
                    await started.acquire()
                with refused(codes.QUOTA_AT_ONCE, quota="checks", most="2"):
                    await monitor.ask(f"{key}/check/li", request, timeout_s=20.0)
                release.set()
                assert all(answer.ok for answer in await asyncio.gather(*two))
            with refused(codes.JOINT_COUNT_OF_FIELD, field="start", count="2", robot="left", joints="5"):
                await monitor.ask(f"{key}/check/li", schema.CheckRequest(program="home", start=[0.0, 0.0]))
            with refused(codes.CHECK_START_UNKNOWN, robot="right"):
                await monitor.ask(
                    "robomesh/hall/right/kinematics/check/li", schema.CheckRequest(program="home")
                )
            with refused(codes.INVERSE_POSE):
                await monitor.ask(f"{key}/inverse", schema.InverseRequest(pose=[1.0] * 3, task=1))
            children = [each.pid for each in workers]
            assert all(alive(pid) for pid in children)
            monkeypatch.setattr(answers, "_CHECK_S", 1e-6)
            with refused(codes.WORKER_GAVE_UP):
                await monitor.ask(f"{key}/check/li", schema.CheckRequest(program="home"))
            return children

    monkeypatch.setattr(kinematics.kinematics, "Worker", keep)
    children = run(main(), timeout_s=180.0)
    assert len(children) == 2
    assert not any(alive(pid) for pid in children)


def test_clearances_are_cached_until_a_robot_moves():
    now = [0.0]
    cell_state = CellState({"left": 1.0, "right": 2.0}, lambda: now[0])
    assert cell_state.positions("left") is None
    cell_state.update("left", HOME)
    cell_state.update("right", HOME)
    near = cell_state.proximity(BUILT, "left", HOME)
    cell_state.update("left", HOME.copy())
    assert cell_state.proximity(BUILT, "left", HOME.copy()) is near
    cell_state.update("right", HOME + 0.1)
    assert cell_state.proximity(BUILT, "left", HOME) is not near
    now[0] = 1.5
    assert cell_state.positions("left") is None
    assert cell_state.others("left")[1] == ()
    now[0] = 2.5
    assert cell_state.proximity(BUILT, "left", HOME).not_counted == ("right",)
