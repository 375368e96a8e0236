"""Joints, tool and signals as a table: a row for each recorded state, SI, units in the header.

Reads messages only, no files: the caller passes them in the order of their receive times.
"""

from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from types import MappingProxyType

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh.recordings.series.publisher_time import PublisherTimes, Recorded
from robomesh.recordings.series.values import prismatic_joints
from robomesh.schemas import robomesh_pb2 as schema

# The tool's position is recorded less often than the joints; an older one is omitted.
_TOOL_FOR_NS = 250_000_000
# Longest delay of the tool's states after a clock was set back.
_TOOL_WAITS_NS = 1_000_000_000
# Signals that do not change are recorded once a second, and stale after three.
_SIGNALS_FOR_NS = 3_000_000_000
_TOOL = ("tool x [m]", "tool y [m]", "tool z [m]", "tool speed [m/s]", "clearance [m]")


class Table:
    """The rows of one recording.

    Args:
        joints: Names of the joints in the table's order.
        prismatic: Names of the prismatic joints (unit: metre).
        signals: Units of the signals, by name, in the table's order.
        start_ns: Zero of the column `t [s]`, ns since the Unix epoch.
    """

    def __init__(
        self,
        joints: Iterable[str],
        prismatic: Iterable[str],
        signals: Mapping[str, str] = MappingProxyType({}),
        *,
        start_ns: int,
    ) -> None:
        self._joints, self._start_ns = tuple(joints), start_ns
        self._times = PublisherTimes()
        self._tool: tuple[int, list[str]] = (0, [""] * len(_TOOL))
        self._signals_order = tuple(signals)
        self._no_signals = [""] * len(signals)
        self._signals: tuple[int, list[str]] = (0, self._no_signals)
        sliding = frozenset(prismatic)
        units = ["m" if joint in sliding else "rad" for joint in self._joints]
        named = list(zip(self._joints, units, strict=True))
        self.header = [
            "time",
            "received",
            "sequence",
            "t [s]",
            *(f"{joint} [{unit}]" for joint, unit in named),
            *(f"{joint} velocity [{unit}/s]" for joint, unit in named),
            *_TOOL,
            *(f"{name} [{unit}]" if unit else name for name, unit in signals.items()),
        ]

    def take_tool(self, state: schema.KinematicState, recorded: Recorded) -> None:
        """Set the tool's values for the following rows."""
        pose = [""] * 3
        if len(state.tool_to_base) == 16:
            pose = [repr(state.tool_to_base[index]) for index in (3, 7, 11)]
        v = state.linear_velocity
        speed = repr((v.x**2 + v.y**2 + v.z**2) ** 0.5) if state.HasField("linear_velocity") else ""
        clearance = repr(state.clearance.distance) if state.HasField("clearance") else ""
        self._tool = recorded.source_ns, [*pose, speed, clearance]

    def take_signals(self, state: schema.Signals, recorded: Recorded) -> None:
        """Set the signals of the following rows."""
        values = {each.name: _value(each) for each in state.signals}
        self._signals = recorded.source_ns, [values.get(name, "") for name in self._signals_order]

    def row(self, state: JointStates, recorded: Recorded) -> list[str]:
        """Return the row of a recorded state; missing values are empty."""
        by_name = {joint.name: joint for joint in state.joints}
        joints = [by_name.get(name) for name in self._joints]
        when, tool = self._tool
        signals_ns, signals = self._signals
        return [
            _text(recorded.source_ns),
            _text(recorded.received_ns),
            str(recorded.sequence),
            f"{(self._times.of(recorded) - self._start_ns) * 1e-9:.9f}",
            *("" if joint is None else repr(joint.position) for joint in joints),
            *(repr(joint.velocity) if joint and joint.HasField("velocity") else "" for joint in joints),
            *(tool if abs(recorded.source_ns - when) <= _TOOL_FOR_NS else [""] * len(tool)),
            *(signals if abs(recorded.source_ns - signals_ns) <= _SIGNALS_FOR_NS else self._no_signals),
        ]


def is_due(other: Recorded, state: Recorded) -> bool:
    """Return whether tool or signals apply to the row of a joint state and the rows after it."""
    return other.source_ns <= state.source_ns or other.received_ns + _TOOL_WAITS_NS < state.received_ns


def table_of(
    first: JointStates,
    description: schema.Description | None,
    signals: Mapping[str, str],
    *,
    start_ns: int,
) -> Table:
    """Return the empty table of a recording with the joints of its first state."""
    names = (joint.name for joint in first.joints)
    return Table(names, prismatic_joints(description), dict(sorted(signals.items())), start_ns=start_ns)


def _value(signal: schema.Signal) -> str:
    """Return a signal's value: a number, 1 or 0, or a text."""
    match signal.WhichOneof("value"):
        case "number":
            return repr(signal.number)
        case "on":
            return str(int(signal.on))
        case _:
            # A spreadsheet would calculate a text that begins like a formula.
            return (
                f"'{signal.text}" if signal.text.startswith(("=", "+", "-", "@", "\t", "\r")) else signal.text
            )


def _text(time_ns: int) -> str:
    second, rest = divmod(time_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(second, tz=UTC):%Y-%m-%dT%H:%M:%S}.{rest:09d}Z"
