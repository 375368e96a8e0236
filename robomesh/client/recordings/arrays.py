"""Joint states and values of a recording as NumPy arrays, collected message by message."""

from array import array
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING, Any

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.message import Message

from robomesh.client.robot.samples import PRISMATIC, ROTARY
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.series.publisher_time import PublisherTimes, Recorded
from robomesh.recordings.series.values import signal_units, unit_of, values_of
from robomesh.schemas.robomesh_pb2 import Signals

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]

_UNITS = {ROTARY: "rad", PRISMATIC: "m"}
# Positions in the table that no message contains.
_MOST_ABSENT = 1_000_000


@dataclass(frozen=True, eq=False, repr=False)
class _Recorded:
    """Times of n recorded messages, in the order of their receive times.

    Attributes:
        time_ns: (n,) publisher's times, ns since the Unix epoch.
        time_s: (n,) publisher's times since the recording's start, on its recorder's clock [s].
        received_ns: (n,) receive times on the recorder's clock, ns since the Unix epoch.
        sequence: (n,) publisher's numbers; gaps are messages that were not recorded.
    """

    time_ns: "IntArray"
    time_s: "FloatArray"
    received_ns: "IntArray"
    sequence: "IntArray"

    def __len__(self) -> int:
        return len(self.time_ns)

    @property
    def time(self) -> "NDArray[np.datetime64]":
        """(n,) publisher's times, UTC, to the nanosecond."""
        return self.time_ns.astype("datetime64[ns]")


@dataclass(frozen=True, eq=False, repr=False)
class RecordedJoints(_Recorded):
    """Recorded joint states: n states of k joints, one row for each state.

    `time_ns`, `time`, `received_ns` and `time_s` are its times, (n,); `sequence` has the publisher's numbers.

    Attributes:
        names: Names of the joints, in the order in which the states first name them.
        units: Units of their positions: "rad", or "m" if prismatic; "": the recording does not describe it.
        positions: (n, k) [rad or m]; NaN: absent.
        velocities: (n, k) [rad/s or m/s]; NaN: absent.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    positions: "FloatArray"
    velocities: "FloatArray"

    def __repr__(self) -> str:
        return f"<{len(self)} states of {', '.join(self.names) or 'no joints'}>"

    @property
    def positions_deg(self) -> "FloatArray":
        """(n, k) positions in degrees, of prismatic joints in mm.

        Raises:
            RecordingError: If the recording does not describe a joint, so that its unit is unknown.
        """
        import numpy as np

        unknown = ", ".join(name for name, unit in zip(self.names, self.units, strict=True) if not unit)
        if unknown:
            raise RecordingError(
                f"the recording has no description of {unknown} to convert its position with: use "
                "`positions` (rad, m)"
            )
        factors = np.array([1000.0 if unit == "m" else 180.0 / np.pi for unit in self.units])
        positions: FloatArray = self.positions * factors
        return positions


@dataclass(frozen=True, eq=False, repr=False)
class RecordedValues(_Recorded):
    """A recorded value: the n messages that contain it, with their times as in `RecordedJoints`.

    Attributes:
        name: "kinematics/tool/x".
        unit: "m"; "": none, or unknown.
        values: (n,)
    """

    name: str
    unit: str
    values: "FloatArray"

    def __repr__(self) -> str:
        return f"<{len(self)} values of {self.name}{self.unit and f' [{self.unit}]'}>"


class _Times:
    """Times of messages of one topic."""

    def __init__(self, start_ns: int) -> None:
        self._start_ns = start_ns
        self._publisher_times = PublisherTimes()
        self._sources, self._received, self._sequence = array("q"), array("q"), array("q")
        self._since_start = array("d")

    def __len__(self) -> int:
        return len(self._sources)

    def since_start_s(self, message: Recorded) -> float:
        """Return the publisher's time since the recording's start [s]."""
        return (self._publisher_times.of(message) - self._start_ns) * 1e-9

    def add(self, message: Recorded, since_start_s: float) -> None:
        """Add a message."""
        self._sources.append(message.source_ns)
        self._received.append(message.received_ns)
        self._sequence.append(message.sequence)
        self._since_start.append(since_start_s)

    def arrays(self) -> dict[str, Any]:
        """Return the arrays of a `_Recorded`."""
        import numpy as np

        return {
            "time_ns": np.asarray(self._sources),
            "time_s": np.asarray(self._since_start),
            "received_ns": np.asarray(self._received),
            "sequence": np.asarray(self._sequence),
        }


class JointsCollector:
    """Joint states, as they are read. States may name some joints only, in any order.

    Args:
        types: Type of each described joint: "rotary" or "prismatic".
        start_ns: Start of the recording, ns since the Unix epoch.
    """

    def __init__(self, types: Mapping[str, str], *, start_ns: int) -> None:
        self._types = types
        self._times = _Times(start_ns)
        # Column of each joint: its name, and how many joints of its state before it have the same name.
        self._columns: dict[tuple[str, int], int] = {}
        # Columns of the states from a row on: consecutive states mostly have the same joints.
        self._layouts: list[tuple[int, array[int]]] = []
        self._names: tuple[str, ...] | None = None
        self._positions, self._velocities = array("d"), array("d")

    def add(self, message: Recorded, state: Message) -> None:
        """Add a state.

        Raises:
            RecordingError: If the states have too few joints in common.
        """
        assert isinstance(state, JointStates)
        joints = state.joints
        names = tuple([joint.name for joint in joints])
        if names != self._names:
            self._names = names
            self._layouts.append((len(self._times), self._columns_of(names)))
        self._times.add(message, self._times.since_start_s(message))
        self._positions.extend([joint.position if joint.HasField("position") else nan for joint in joints])
        self._velocities.extend([joint.velocity if joint.HasField("velocity") else nan for joint in joints])
        present = len(self._positions)
        if len(self._times) * len(self._columns) - present > max(_MOST_ABSENT, present):
            raise RecordingError("its joint states have too few joints in common for a table")

    def collected(self) -> RecordedJoints:
        """Return the states."""
        import numpy as np

        times = self._times.arrays()
        count = len(times["time_ns"])
        positions = np.full((count, len(self._columns)), nan)
        velocities = positions.copy()
        ends = [*(row for row, _ in self._layouts), count][1:]
        at = 0
        for (row, columns), end in zip(self._layouts, ends, strict=True):
            shape = end - row, len(columns)
            size = shape[0] * shape[1]
            for table, values in ((positions, self._positions), (velocities, self._velocities)):
                table[row:end, np.asarray(columns)] = np.asarray(values[at : at + size]).reshape(shape)
            at += size
        names = tuple(name for name, _ in self._columns)
        return RecordedJoints(
            **times,
            names=names,
            units=tuple(_UNITS.get(self._types.get(name, ""), "") for name in names),
            positions=positions,
            velocities=velocities,
        )

    def _columns_of(self, names: tuple[str, ...]) -> "array[int]":
        """Return the columns of a state's joints; add columns for new joints."""
        found, seen = array("q"), Counter[str]()
        for name in names:
            found.append(self._columns.setdefault((name, seen[name]), len(self._columns)))
            seen[name] += 1
        return found


class ValuesCollector:
    """Values of one topic, as they are read.

    Args:
        topic: "kinematics".
        names: Names of the values, which begin with the topic.
        start_ns: Start of the recording, ns since the Unix epoch.
    """

    def __init__(self, topic: str, names: Iterable[str], *, start_ns: int) -> None:
        self._topic = topic
        self._all_times = _Times(start_ns)
        self._signal_units: dict[str, str] = {}
        self._wanted = {name: (_Times(start_ns), array("d")) for name in names}

    def add(self, message: Recorded, decoded: Message) -> None:
        """Add a message's values."""
        since_start_s = self._all_times.since_start_s(message)
        if isinstance(decoded, Signals):
            self._signal_units |= signal_units(decoded)
        for own, value in values_of(decoded.DESCRIPTOR.full_name, decoded):
            if (wanted := self._wanted.get(f"{self._topic}/{own}")) is not None:
                times, values = wanted
                times.add(message, since_start_s)
                values.append(value)

    def collected(self, types: Mapping[str, str]) -> dict[str, RecordedValues]:
        """Return the values by name.

        Args:
            types: Type of each described joint: "rotary" or "prismatic".
        """
        import numpy as np

        prismatic = {joint for joint, kind in types.items() if kind == PRISMATIC}
        return {
            name: RecordedValues(
                **times.arrays(),
                name=name,
                unit=unit_of(name, prismatic, self._signal_units),
                values=np.asarray(values),
            )
            for name, (times, values) in self._wanted.items()
        }
