"""One file that is being recorded: what goes into it, and what does not."""

import time
from collections import Counter
from collections.abc import Callable

from mcap_files.capture import Capture
from robomesh.header import Header
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.topics import TOPICS, Topic
from robomesh.wall_clock import WallClock
from services.recorder.disk import Disk, Taken, takes

Saw = Callable[[Topic, bytes], None]
STATES = frozenset(row.name for row in TOPICS.values() if row.recorded and not row.name.startswith("video/"))


class Part:
    """A capture as a sink of the intake.

    Args:
        begun_ns: The monotonic clock's time at the capture's start.
        saw: Told of every publication, on the intake's thread.
    """

    def __init__(self, capture: Capture, disk: Disk, saw: Saw | None = None, *, begun_ns: int) -> None:
        self.capture = capture
        # Publications that came and that the disk could not take, by key.
        self.given_up: Counter[str] = Counter()
        # Told by the intake once it is attached.
        self.lost: Counter[str] = Counter()
        self._disk, self._saw = disk, saw
        # The clock may be set while it is recorded: within a file time goes on as it did at its beginning.
        self._begun_ns = begun_ns
        self._wall_clock, self._clock_was_set = WallClock(), False

    @property
    def age_s(self) -> float:
        """How long it has been open [s], whatever the clock was set to."""
        return (time.monotonic_ns() - self._begun_ns) * 1e-9

    @property
    def missed(self) -> Counter[str]:
        """Publications that are not in the file, by key."""
        return self.lost + self.given_up

    def take(self, key: str, row: Topic, header: Header, payload: bytes, received_ns: int) -> None:
        """Write a publication, if there is room."""
        if self._disk.taken is not Taken.ALL and not takes(self._disk.taken, row):
            self.given_up[key] += 1
        else:
            self.capture.add(key, row, header, payload, received_ns=self.log_time_ns(received_ns))
        if self._saw is not None:
            self._saw(row, payload)

    def log_time_ns(self, received_ns: int) -> int:
        """Return the file's time of a time of the monotonic clock, ns since the Unix epoch."""
        # What was told before is part of what was so when it began.
        return self.capture.start_ns + max(received_ns - self._begun_ns, 0)

    def clock_was_set(self) -> bool:
        """Return whether the machine's clock was set since the file was begun."""
        self._clock_was_set = self._wall_clock.was_set() or self._clock_was_set
        return self._clock_was_set

    def swept(self) -> None:
        """It may be written."""
        self.capture.hand_over()

    def describe(self) -> schema.Recording:
        """The file as it is now."""
        capture, about = self.capture, self.capture.about
        recording = schema.Recording(
            site=about["site"],
            robot=about["robot"],
            name=about["name"],
            started_by=about["started_by"],
            cause=about.get("cause", ""),
            part=int(about.get("part", "0")),
            file=capture.path.name,
            open=True,
            bytes=capture.size,
            attachments=capture.attached,
        )
        recording.start.FromNanoseconds(capture.start_ns)
        recording.duration.FromNanoseconds(time.monotonic_ns() - self._begun_ns)
        missed = self.missed
        for key in sorted(capture.counts.keys() | missed.keys()):
            recording.topics.add(topic=key, messages=capture.counts[key], lost=missed[key])
        return recording
