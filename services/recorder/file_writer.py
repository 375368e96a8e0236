"""One open file of a recording, with the counts of publications that are not in it."""

import time
from collections import Counter
from collections.abc import Callable

from robomesh.contract.header import Header
from robomesh.contract.topics import TOPICS, Topic
from robomesh.publications.wall_clock import WallClock
from robomesh.recordings.changes import set_labels
from robomesh.recordings.writing.capture import Capture
from robomesh.schemas import robomesh_pb2 as schema
from services.recorder.disk import Disk, RecordingLevel, is_recorded

OnPublication = Callable[[Topic, bytes], None]
STATES = frozenset(row.name for row in TOPICS.values() if row.recorded and not row.name.startswith("video/"))


class CaptureSink:
    """A capture as a sink of the robot's subscriptions.

    Args:
        begun_ns: The monotonic clock's time at the capture's start.
        on_publication: Called with every publication, on the subscriptions' thread.
    """

    def __init__(
        self, capture: Capture, disk: Disk, on_publication: OnPublication | None = None, *, begun_ns: int
    ) -> None:
        self.capture = capture
        # Publications that were received but dropped because of the disk, by key.
        self.dropped: Counter[str] = Counter()
        # Publications that were never received, by key; set from the subscriptions.
        self.lost: Counter[str] = Counter()
        # Name, note and tags that people have given it meanwhile.
        self.labels: schema.RecordingChange | None = None
        self._disk, self._on_publication = disk, on_publication
        # The wall clock may be set during a recording: times within a file follow the monotonic clock.
        self._begun_ns = begun_ns
        self._wall_clock, self._clock_was_set = WallClock(), False

    @property
    def age_s(self) -> float:
        """Time since it was opened [s], on the monotonic clock."""
        return (time.monotonic_ns() - self._begun_ns) * 1e-9

    @property
    def missed(self) -> Counter[str]:
        """Publications that are not in the file, by key."""
        return self.lost + self.dropped

    def take(self, key: str, row: Topic, header: Header, payload: bytes, received_ns: int) -> None:
        """Add a publication, unless the recording level excludes it."""
        if self._disk.level is not RecordingLevel.ALL and not is_recorded(self._disk.level, row):
            self.dropped[key] += 1
        else:
            self.capture.add(key, row, header, payload, received_ns=self.log_time_ns(received_ns))
        if self._on_publication is not None:
            self._on_publication(row, payload)

    def log_time_ns(self, received_ns: int) -> int:
        """Convert a time of the monotonic clock to the file's time, ns since the Unix epoch."""
        # Earlier messages describe the state at the start of the file.
        return self.capture.start_ns + max(received_ns - self._begun_ns, 0)

    def clock_was_set(self) -> bool:
        """Return whether the machine's clock was set since the file was begun."""
        self._clock_was_set = self._wall_clock.was_set() or self._clock_was_set
        return self._clock_was_set

    def drained(self) -> None:
        """Release the added publications for writing."""
        self.capture.hand_over()

    def describe(self) -> schema.Recording:
        """Describe the open file."""
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
        recording.start.FromNanoseconds(capture.first_ns)
        recording.duration.FromNanoseconds(time.monotonic_ns() - self._begun_ns)
        missed = self.missed
        for key in sorted(capture.counts.keys() | missed.keys()):
            recording.topics.add(topic=key, messages=capture.counts[key], lost=missed[key])
        if self.labels is not None:
            set_labels(recording, [self.labels])
        return recording
