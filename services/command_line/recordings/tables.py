"""Export of joints and tool as CSV: a row for each recorded state, with its publisher's time."""

import csv
from collections.abc import Iterator
from pathlib import Path

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh.recordings.reading import RecordedMessage, RecordingFile
from robomesh.recordings.table import Table, is_due, table_of
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line.recordings.errors import ExportError
from services.command_line.recordings.output import progress
from services.command_line.recordings.span import Span, decoded, needed, topics_of

_REPORT_EACH = 5000


def write_table(file: RecordingFile, span: Span, target: Path) -> int:
    """Write the table and return the number of rows.

    Raises:
        ExportError: If the span has no joints.
        RecordingError: If the file is damaged.
    """
    joints, kinematics = needed(file, "joints"), topics_of(file).get("kinematics")
    first = next((state for _, state in _states(file, joints, span)), None)
    if first is None:
        raise ExportError(f"{file.path.name}: no state of joints in that time")
    table = table_of(first, description_of(file), start_ns=file.layout.start_ns)
    rows = 0
    with target.open("w", newline="", encoding="utf-8") as stream, progress("table") as report:
        writer = csv.writer(stream)
        writer.writerow(table.header)
        for message, state in _with_tool(table, file, joints, kinematics, span):
            writer.writerow(table.row(state, message))
            rows += 1
            if rows % _REPORT_EACH == 0:
                report(span.share(message.received_ns))
    return rows


def _states(file: RecordingFile, joints: str, span: Span) -> Iterator[tuple[RecordedMessage, JointStates]]:
    """Yield the states of a span; skip invalid messages."""
    for message in file.messages((joints,), start_ns=span.start_ns, end_ns=span.end_ns + 1):
        if (state := decoded(JointStates, message.data)) is not None:
            yield message, state


def _with_tool(
    table: Table, file: RecordingFile, joints: str, kinematics: str | None, span: Span
) -> Iterator[tuple[RecordedMessage, JointStates]]:
    """Yield the states of a span, after the table has taken the tool's pose at each."""
    tools: Iterator[RecordedMessage] = iter(())
    if kinematics is not None:
        tools = file.messages((kinematics,), start_ns=span.start_ns, end_ns=span.end_ns + 1)
    tool = next(tools, None)
    for message, state in _states(file, joints, span):
        while tool is not None and is_due(tool, message):
            if (known := decoded(schema.KinematicState, tool.data)) is not None:
                table.take_tool(known, tool)
            tool = next(tools, None)
        yield message, state


def description_of(file: RecordingFile) -> schema.Description | None:
    """Return the robot's description; None: the recording has none."""
    topic = topics_of(file).get("description")
    newest = None if topic is None else file.newest(topic, file.layout.end_ns)
    return None if newest is None else decoded(schema.Description, newest.data)
