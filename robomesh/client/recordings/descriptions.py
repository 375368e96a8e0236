"""Descriptions of recordings, of all sites and of files on this machine."""

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from robomesh import reason_codes as codes
from robomesh.client.robot.samples import utc
from robomesh.contract.keys import WHOLE_SITE, robot_key
from robomesh.errors import RobomeshError
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.names import topic_name
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session

log = logging.getLogger(__name__)

_TIMEOUT_S = 10.0
# Recordings that the error for an unknown name lists.
_MOST_NAMED = 10


@dataclass(frozen=True)
class RecordedTopic:
    """A recorded topic.

    Attributes:
        name: Topic below the robot: "joints".
        key: Name of its channel: "robomesh/shanghai/pt600-1/joints".
        messages: Number of recorded messages.
        lost: Number of messages that the recorder missed.
    """

    name: str
    key: str
    messages: int
    lost: int


@dataclass(frozen=True, repr=False)
class RecordingInfo:
    """Description of a recording.

    Attributes:
        name: Name that its operator chose.
        site, robot: Recorded robot.
        recorder_site: Site whose recorder has the file; empty: it is a file on this machine.
        file: Name of the file.
        start_ns: Zero of the recording's time axis, ns since the Unix epoch: receive time of the first
            message.
        duration_s: [s]
        bytes: Size of the file.
        open: It is still being written.
        problem: Why it is incomplete, for people; empty: it is complete.
        recovered: Its recorder was killed, and the file was completed afterwards.
        part: Part of a split recording, from 1; 0: it was not split.
        note: Note of its operators, of several lines.
        tags: Tags of its operators.
        deleted: It was deleted; only its description is left.
        topics: Recorded topics by their channels' names.
        merged_from: The recordings of a file that was merged; empty: it is one recording.
        message: The description as the recorder sends it.
    """

    name: str
    site: str
    robot: str
    recorder_site: str
    file: str
    start_ns: int
    duration_s: float
    bytes: int
    open: bool
    problem: str
    recovered: bool
    part: int
    note: str
    tags: tuple[str, ...]
    deleted: bool
    topics: tuple[RecordedTopic, ...]
    merged_from: "tuple[RecordingInfo, ...]"
    message: schema.Recording = field(repr=False, compare=False)

    def __repr__(self) -> str:
        of = f" of {self.site}/{self.robot}" if self.robot else ""
        return f"<recording {self.name!r}{of}, {self.start:%Y-%m-%d %H:%M:%S} UTC, {self.duration_s:.1f} s>"

    @property
    def start(self) -> datetime:
        """Start in UTC, to the microsecond."""
        return utc(self.start_ns)


def recording_info(message: schema.Recording, recorder_site: str = "") -> RecordingInfo:
    """Return the description in a recorder's message."""
    topics = (
        RecordedTopic(topic_name(each.topic), each.topic, each.messages, each.lost) for each in message.topics
    )
    return RecordingInfo(
        name=message.name,
        # A file without metadata does not name its site.
        site=message.site or recorder_site,
        robot=message.robot,
        recorder_site=recorder_site,
        file=message.file,
        start_ns=message.start.ToNanoseconds(),
        duration_s=message.duration.ToNanoseconds() * 1e-9,
        bytes=message.bytes,
        open=message.open,
        problem=message.problem,
        recovered=message.recovered,
        part=message.part,
        note=message.note,
        tags=tuple(message.tags),
        deleted=message.deleted,
        topics=tuple(topics),
        merged_from=tuple(map(recording_info, message.merged_from)),
        message=message,
    )


def _log_silent(site: str, error: RobomeshError) -> None:
    log.warning("without the recordings of %s: %s", site, error)


async def list_recordings(
    session: Session,
    *,
    deleted: bool = False,
    on_silent: Callable[[str, RobomeshError], None] = _log_silent,
) -> list[RecordingInfo]:
    """Return the recordings of every site, newest first, without those of recorders that do not answer.

    Args:
        deleted: Deleted recordings too.
        on_silent: Called with the site of a recorder that does not answer.

    Raises:
        RobomeshError: If no recorder answers.
    """
    sites = sorted({key.site for key in await session.present() if key.service == "recorder"})
    answers = await asyncio.gather(
        *(_of_site(session, site, deleted) for site in sites), return_exceptions=True
    )
    found: list[RecordingInfo] = []
    for site, answer in zip(sites, answers, strict=True):
        if isinstance(answer, schema.RecordingList):
            found += [recording_info(recording, site) for recording in answer.recordings]
        elif not isinstance(answer, RobomeshError) or all(
            isinstance(each, RobomeshError) for each in answers
        ):
            raise answer
        else:
            on_silent(site, answer)
    return sorted(found, key=lambda each: each.start_ns, reverse=True)


async def _of_site(session: Session, site: str, deleted: bool) -> schema.RecordingList:
    key = robot_key(site, WHOLE_SITE, "recordings/list")
    answer = await session.ask(key, schema.RecordingListQuery(deleted=deleted), timeout_s=_TIMEOUT_S)
    assert isinstance(answer, schema.RecordingList)
    return answer


async def find_recording(
    session: Session,
    what: str,
    *,
    closed: bool = False,
    only: bool = False,
    on_silent: Callable[[str, RobomeshError], None] = _log_silent,
) -> RecordingInfo:
    """Return the newest recording that `[SITE/]NAME` or `[SITE/]FILE` names.

    Args:
        closed: Skip recordings that are still being written.
        only: Refuse a name that several recordings have.
        on_silent: As for `list_recordings`.

    Raises:
        RecordingError: If no recording has the name; the text lists the newest ones. If several have it, and
            `only`.
        RobomeshError: If no recorder answers.
    """
    site, _, name = what.rpartition("/")
    recordings = await list_recordings(session, on_silent=on_silent)
    found = [
        each
        for each in recordings
        if name in (each.name, each.file) and site in ("", each.recorder_site) and not (closed and each.open)
    ]
    if only and len(found) > 1:
        files = ", ".join(f"{each.recorder_site}/{each.file}" for each in found[:_MOST_NAMED])
        raise RecordingError(codes.RECORDING_AMBIGUOUS(name=what, files=files))
    if found:
        return found[0]
    names = list(dict.fromkeys(f"{each.recorder_site}/{each.name or each.file}" for each in recordings))
    there = ", ".join(names[:_MOST_NAMED]) + (", ..." if len(names) > _MOST_NAMED else "")
    raise RecordingError(codes.RECORDING_NOT_FOUND(name=what, recordings=there or "none"))


def describe_recording(path: Path) -> RecordingInfo:
    """Return the description of a file on this machine.

    Raises:
        RecordingError: If no part of it can be read.
    """
    from robomesh.recordings.files import describe_file
    from robomesh.recordings.writing.capture import is_being_written

    message = describe_file(path)
    if message.problem and is_being_written(path):
        message.open, message.problem = True, ""
    return recording_info(message)
