"""Joints and tool as CSV: a row a recorded state."""

import csv
from collections.abc import Iterator
from pathlib import Path

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from bus.schemas import robomesh_pb2 as schema
from mcap_files.reading import RecordedMessage, RecordingFile
from mcap_files.table import Table, table_of
from services.command_line.recordings.errors import ExportError
from services.command_line.recordings.output import progress
from services.command_line.recordings.span import Span, decoded, needed, topics_of

_TELL_EACH = 5000


def write_table(file: RecordingFile, span: Span, target: Path) -> int:
    """Write the table; the number of its rows.

    Raises:
        ExportError: If there are no joints in it.
        RecordingError: If the file is damaged.
    """
    joints, kinematics = needed(file, "joints"), topics_of(file).get("kinematics")
    first = next((state for _, state in _states(file, (joints,), joints, span) if state is not None), None)
    if first is None:
        raise ExportError(f"{file.path.name}: no state of joints in that time")
    table = table_of(first, description_of(file), start_ns=file.layout.start_ns)
    topics = (joints,) if kinematics is None else (joints, kinematics)
    rows = 0
    with target.open("w", newline="", encoding="utf-8") as stream, progress("table") as tell:
        writer = csv.writer(stream)
        writer.writerow(table.header)
        for time_ns, row in _rows(table, _states(file, topics, joints, span), file.layout.start_ns):
            writer.writerow(row)
            rows += 1
            if rows % _TELL_EACH == 0:
                tell(span.share(time_ns))
    return rows


def _states(
    file: RecordingFile, topics: tuple[str, ...], joints: str, span: Span
) -> Iterator[tuple[RecordedMessage, JointStates | None]]:
    """Messages of a span, those of the joints decoded; what somebody wrote wrong is not among them."""
    for message in file.messages(topics, start_ns=span.start_ns, end_ns=span.end_ns + 1):
        if message.topic != joints:
            yield message, None
        elif (state := decoded(JointStates, message.data)) is not None:
            yield message, state


def _rows(
    table: Table, states: Iterator[tuple[RecordedMessage, JointStates | None]], start_ns: int
) -> Iterator[tuple[int, list[str]]]:
    """A row a state: of those that stood there when the recording began the newest, and no copies."""
    before: list[str] = []
    stood: JointStates | None = None
    for message, state in states:
        if message.received_ns > start_ns and stood is not None:
            before, stood = table.row(stood, start_ns), None
            yield start_ns, before
        if state is None:
            kinematics = decoded(schema.KinematicState, message.data)
            if kinematics is not None:
                table.take_tool(kinematics, message.received_ns)
        elif message.received_ns <= start_ns:
            stood = state
        elif (row := table.row(state, message.received_ns)) != before:
            before = row
            yield message.received_ns, row
    if stood is not None:
        yield start_ns, table.row(stood, start_ns)


def description_of(file: RecordingFile) -> schema.Description | None:
    """What the robot is; None: the recording does not tell."""
    topic = topics_of(file).get("description")
    newest = None if topic is None else file.newest(topic, file.layout.end_ns)
    return None if newest is None else decoded(schema.Description, newest.data)
