"""`robomesh robot verify`: a controller's joints, compared with the Cartesian position that it computes."""

import asyncio
import tempfile
from collections.abc import Awaitable, Callable, Mapping
from datetime import UTC, datetime
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

from robomesh import reason_codes as codes
from robomesh.client.robot.robot import AsyncRobot
from robomesh.files.atomic_write import write_atomically
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line.terminal import discovery
from services.command_line.terminal.output import print_json, print_line
from services.errors import ServiceError

if TYPE_CHECKING:
    from robots.kinematics.joints import FloatArray, Joints
    from robots.kinematics.verification import Placement, Sample, Verification
    from robots.kinematics.verification_record import VerificationRecord

_REST_S = 1.0
_STILL = 2e-4  # of a joint at rest [rad] or [m]: more than the noise of encoders
_SIGNALS_WITHIN_S = 10.0
_TOO_MANY_POSES = 40
# Poses are comparable while these are the same.
_VALID_FOR = {
    "robot": "another robot",
    "joints_sha256": "another model or mapping of the joints",
    "software": "another version of the controller's software",
}
_AXES = ("x", "y", "z", "rx", "ry", "rz")


class VerificationError(ServiceError):
    """The robot cannot be verified."""


def verify(robot: str, connect: str, out: Path | None, *, base: str, flange: str, as_json: bool) -> bool:
    """Take poses of an arm that a person moves; print, and keep, whether model and controller agree.

    Args:
        out: File of the result. Until there is one, poses are kept beside it, and the next call goes on.
        base, flange: Links at the controller's base frame and flange; empty: "base" and "tool0", as in the
            URDFs of ROS-Industrial, else the model's base and the link of its tool.

    Raises:
        VerificationError: If the robot cannot be verified.
    """
    poses = None if out is None else out.with_name(f"{out.name}.unfinished")
    record = discovery.run(_verify(robot, connect, base, flange, poses))
    if out is not None and poses is not None:
        _write(out, record)
        poses.unlink(missing_ok=True)
    if as_json:
        print_json(record.model_dump(mode="json"))
    else:
        for line in _lines(record, out):
            print_line(line)
    return record.agrees


async def _verify(
    name: str, connect: str, base: str, flange: str, poses: Path | None
) -> "VerificationRecord":
    from robots.kinematics.verification import verify

    async with discovery.attached(connect) as session:
        place = await discovery.find(session, name)
        robot = AsyncRobot(session, *place)
        state = await _state(robot)
        description = await robot.description()
        joints, placement = _model(description, base, flange)

        samples: list[Sample] = []

        def record() -> "VerificationRecord":
            return _record(str(place), description, state, joints, verify(placement, joints, samples))

        async def keep() -> None:
            """Keep the poses, of which the newest was taken with the model and software of all others."""
            nonlocal state
            state = _of_same(place, state, await _state(robot))
            if poses is not None:
                _write(poses, record())

        samples += [] if poses is None else _kept(poses, record())
        await _take(samples, robot, joints, _tool(description), keep)
        for each in state.link_reasons:
            if each.code == codes.JOINTS_INVALID.name:
                _say(f"{place}: {each.text}")
        return record()


def _of_same(
    place: discovery.RobotAddress, before: schema.ControllerState, now: schema.ControllerState
) -> schema.ControllerState:
    """Return the present state; while a link is down, the software is not known.

    Raises:
        VerificationError: If the model or the software is another one than before.
    """
    for key in ("joints_sha256", "software"):
        one, other = getattr(before, key), getattr(now, key)
        if one and other and one != other:
            raise VerificationError(f"{place}: its model or its controller's software has changed meanwhile")
        setattr(now, key, other or one)
    return now


def _write(file: Path, record: "VerificationRecord") -> None:
    try:
        write_atomically(file, (record.model_dump_json() + "\n").encode())
    except OSError as error:
        raise VerificationError(f"{file}: cannot be written: {error.strerror}") from None


def _kept(file: Path, now: "VerificationRecord") -> list["Sample"]:
    """Return the poses that an interrupted comparison left; empty without one.

    Raises:
        RobotError: If the file cannot be read.
        VerificationError: If it is damaged, or its poses are of something else.
    """
    import numpy as np

    from robots.kinematics.verification import Sample
    from robots.kinematics.verification_record import read_record

    if not file.exists():
        return []
    kept = read_record(file)
    for what, words in _VALID_FOR.items():
        one, other = getattr(kept, what), getattr(now, what)
        if one and other and one != other:
            raise VerificationError(f"{file}: its poses are of {words}: delete it, or give another --out")
    try:
        samples = [
            Sample(
                positions=np.reshape(each.positions, len(kept.joints)),
                tool_to_base=np.reshape(each.tool_to_base, (4, 4)),
                tool_to_flange=np.reshape(each.tool_to_flange, (4, 4)),
            )
            for each in kept.poses
        ]
    except ValueError:
        raise VerificationError(f"{file}: is damaged: delete it, and take the poses again") from None
    _say(f"{file}: {len(samples)} poses are there, from {kept.time}")
    return samples


async def _state(robot: AsyncRobot) -> schema.ControllerState:
    """Return what the comparison will be valid for; without a gateway, nothing."""
    sample = await robot.last("controller")
    state = schema.ControllerState() if sample is None else sample.message
    assert isinstance(state, schema.ControllerState)
    return state


def _model(description: schema.Description, base: str, flange: str) -> tuple["Joints", "Placement"]:
    """Return the joints of a site's description, and the placement of its flange in the base frame."""
    from robots.descriptions.description import load
    from robots.kinematics.model import build_model, link_placements
    from robots.schema.poses import inverse

    with tempfile.TemporaryDirectory() as folder:
        urdf = Path(folder) / "robot.urdf"
        urdf.write_text(description.urdf, "utf-8")
        model = build_model(load(urdf))
    names = model.link_names
    tool = next(frame.link for frame in description.frames if frame.name == "tool")
    base = base or ("base" if "base" in names else names[0])
    flange = flange or ("tool0" if "tool0" in names else tool)
    for link in (base, flange):
        if link not in names:
            raise VerificationError(f"{link!r} is no link of the model: {', '.join(names)}")
    here, there = names.index(base), names.index(flange)

    def placement(positions: "FloatArray") -> "FloatArray":
        links = link_placements(model, positions)
        flange_to_base: FloatArray = inverse(links[here]) @ links[there]
        return flange_to_base

    return model.joints, placement


def _tool(description: schema.Description) -> "FloatArray":
    import numpy as np

    tool = next(frame for frame in description.frames if frame.name == "tool")
    return np.array(tool.frame_to_link).reshape(4, 4)


async def _take(
    samples: list["Sample"],
    robot: AsyncRobot,
    joints: "Joints",
    tool: "FloatArray",
    keep: Callable[[], Awaitable[None]],
) -> None:
    """Add a sample of each pose in which the arm rests, until they are enough; `keep` each."""
    from robots.kinematics.verification import POSES, unlike, unmoved

    if len(samples) >= POSES and not unmoved(joints, samples):
        return
    signals = _Signals(robot, tool)
    following = asyncio.create_task(signals.follow())
    try:
        await signals.first()
        _say(
            f"move {robot} from its own panel to {POSES} poses, each joint by 20 degrees or more in all, and "
            "let it rest in each"
        )
        rest = _Rest()
        silent = False
        async with robot.joints(on_stale="yield") as states:
            async for state in states:
                if state.stale != silent:
                    silent = state.stale
                    _say(f"{robot} sends no joints: waiting" if silent else f"{robot} sends joints again")
                if silent:
                    rest = _Rest()
                    continue
                positions = _in_order(joints, state.names, state.positions)
                if not rest.lasts(positions, state.time_ns) or not unlike(joints, positions, samples):
                    continue
                sample = signals.sample(positions, rest.since_ns)
                if sample is None:
                    continue
                samples.append(sample)
                await keep()
                lacking = unmoved(joints, samples)
                if len(samples) >= POSES and (not lacking or len(samples) >= _TOO_MANY_POSES):
                    return
                more = f" ({'; '.join(lacking)})" if len(samples) >= POSES else ""
                _say(f"pose {len(samples)} of {max(POSES, len(samples) + 1)} taken: move on{more}")
        raise VerificationError(f"{robot} sends no joints any more")  # the session was closed
    finally:
        following.cancel()
        await asyncio.gather(following, return_exceptions=True)


class _Rest:
    """How long an arm has rested.

    Attributes:
        since_ns: Begin of the rest, ns since the Unix epoch.
    """

    def __init__(self) -> None:
        self.since_ns = 0
        self._at: FloatArray | None = None

    def lasts(self, positions: "FloatArray", time_ns: int) -> bool:
        """Take a state; return whether the arm has rested for a second."""
        if self._at is None or abs(positions - self._at).max() > _STILL:
            self._at, self.since_ns = positions, time_ns
        return time_ns - self.since_ns >= _REST_S * 1e9


class _Signals:
    """The newest signals of a robot; `tool`: its tool on the flange, if the controller does not report it."""

    def __init__(self, robot: AsyncRobot, tool: "FloatArray") -> None:
        self._robot = robot
        self._tool = tool
        self._numbers: dict[str, tuple[float, int]] = {}  # with their times
        self._arrived = asyncio.Event()

    async def follow(self) -> None:
        """Keep the newest signals until cancelled."""
        async with self._robot.topic("signals", on_stale="yield") as messages:
            async for message in messages:
                self._numbers = {
                    each.name: (each.number, message.time_ns - round(each.age_s * 1e9))
                    for each in message.message.signals
                    if each.HasField("number")
                }
                if self._vector("tool.pose") is not None:
                    self._arrived.set()

    async def first(self) -> None:
        """Wait for the controller's Cartesian position.

        Raises:
            VerificationError: If there is none.
        """
        try:
            async with asyncio.timeout(_SIGNALS_WITHIN_S):
                await self._arrived.wait()
        except TimeoutError:
            text = f"{self._robot} reports no Cartesian position (signals tool.pose.x to tool.pose.rz)"
            raise VerificationError(f"{text}: only a controller that does can be verified") from None

    def sample(self, positions: "FloatArray", since_ns: int) -> "Sample | None":
        """Return the sample of an arm at rest; None: the signals are from before the rest."""
        from robots.kinematics.verification import Sample

        pose, offset = self._vector("tool.pose"), self._vector("tool.offset")
        if pose is None or pose[1] < since_ns + _REST_S * 0.5e9:
            return None
        return Sample(
            positions=positions,
            tool_to_base=_placement(pose[0]),
            tool_to_flange=self._tool if offset is None else _placement(offset[0]),
        )

    def _vector(self, name: str) -> tuple[tuple[float, ...], int] | None:
        found = [self._numbers.get(f"{name}.{axis}") for axis in _AXES]
        if not all(found):
            return None
        values = [each for each in found if each is not None]
        return tuple(value for value, _ in values), min(time_ns for _, time_ns in values)


def _placement(vector: tuple[float, ...]) -> "FloatArray":
    """Convert a position [m] and a rotation vector [rad] to a (4, 4) placement."""
    import numpy as np

    from robots.schema.poses import axis_rotation

    placement = np.eye(4)
    placement[:3, :3] = axis_rotation(np.array(vector[3:]), float(np.linalg.norm(vector[3:])))
    placement[:3, 3] = vector[:3]
    return placement


def _in_order(joints: "Joints", names: tuple[str, ...], positions: tuple[float, ...]) -> "FloatArray":
    import numpy as np

    of: Mapping[str, float] = dict(zip(names, positions, strict=True))
    return np.array([of[name] for name in joints.names])


def _record(
    place: str,
    description: schema.Description,
    state: schema.ControllerState,
    joints: "Joints",
    found: "Verification",
) -> "VerificationRecord":
    from robots.kinematics.verification_record import VerificationRecord, VerifiedPose

    return VerificationRecord(
        robot=place,
        time=datetime.now(UTC).isoformat(timespec="seconds"),
        agrees=found.agrees,
        model=description.name,
        joints_sha256=state.joints_sha256,
        software=state.software,
        joints=joints.names,
        poses=tuple(
            VerifiedPose(
                positions=tuple(each.sample.positions.tolist()),
                distance_m=each.distance_m,
                angle_rad=each.angle_rad,
                tool_to_base=tuple(each.sample.tool_to_base.ravel().tolist()),
                tool_to_flange=tuple(each.sample.tool_to_flange.ravel().tolist()),
            )
            for each in found.deviations
        ),
        unmoved=found.unmoved,
        suspects=found.suspects,
    )


def _lines(record: "VerificationRecord", out: Path | None = None) -> list[str]:
    distance = max(each.distance_m for each in record.poses)
    angle = max(each.angle_rad for each in record.poses)
    most = f"at most {1000 * distance:.2f} mm and {degrees(angle):.3f}° in {len(record.poses)} poses"
    if record.agrees:
        lines = [f"{record.robot}: model and controller agree ({most})"]
        return [*lines, f'  in the site file: verified = "{out}"'] if out is not None else lines
    lines = [f"{record.robot}: model and controller differ: {most}; 1 mm and 0.1° are allowed"]
    lines += [
        f"  pose {number}: {1000 * each.distance_m:.2f} mm, {degrees(each.angle_rad):.3f}°"
        for number, each in enumerate(record.poses, start=1)
    ]
    lines += [f"  {each}" for each in record.unmoved]
    lines += [f"  all poses agree if: {each}" for each in record.suspects]
    if not record.suspects and not record.unmoved:
        lines.append("  no single joint, frame or unit explains it: is it the right model?")
    return lines


def _say(text: str) -> None:
    print_line(text, err=True)
