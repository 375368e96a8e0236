"""Export of joints, tool and signals as CSV: a row for each recorded state, with its publisher's time."""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.message import Message

from robomesh.recordings.reading import RecordedMessage, RecordingFile
from robomesh.recordings.series.table import Table, is_due, table_of
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line.terminal.output import progress
from services.export.errors import ExportError
from services.export.span import Span, decoded, description_of, needed, topics_of

_REPORT_EACH = 5000

AnyMessage = TypeVar("AnyMessage", bound=Message)


def write_table(file: RecordingFile, span: Span, target: Path) -> int:
    """Write the table and return the number of rows.

    Raises:
        ExportError: If the span has no joints.
        RecordingError: If the file is damaged.
    """
    needed(file, "joints")
    first = next((state for _, state in _decoded(file, "joints", JointStates, span)), None)
    if first is None:
        raise ExportError(f"{file.path.name}: no state of joints in that time")
    units: dict[str, str] = {}
    for _, signals in _decoded(file, "signals", schema.Signals, span):
        units |= {each.name: each.unit for each in signals.signals}
    table = table_of(first, description_of(file), units, start_ns=file.layout.start_ns)
    rows = 0
    with target.open("w", newline="", encoding="utf-8") as stream, progress("table") as report:
        writer = csv.writer(stream)
        writer.writerow(table.header)
        for message, state in _with_others(table, file, span):
            writer.writerow(table.row(state, message))
            rows += 1
            if rows % _REPORT_EACH == 0:
                report(span.share(message.received_ns))
    return rows


def _with_others(
    table: Table, file: RecordingFile, span: Span
) -> Iterator[tuple[RecordedMessage, JointStates]]:
    """Yield the states of a span, after the table has taken the tool's pose and the signals at each."""
    tools = _decoded(file, "kinematics", schema.KinematicState, span)
    signals = _decoded(file, "signals", schema.Signals, span)
    tool, signal = next(tools, None), next(signals, None)
    for message, state in _decoded(file, "joints", JointStates, span):
        while tool is not None and is_due(tool[0], message):
            table.take_tool(tool[1], tool[0])
            tool = next(tools, None)
        while signal is not None and is_due(signal[0], message):
            table.take_signals(signal[1], signal[0])
            signal = next(signals, None)
        yield message, state


def _decoded(
    file: RecordingFile, topic: str, kind: type[AnyMessage], span: Span
) -> Iterator[tuple[RecordedMessage, AnyMessage]]:
    """Yield the messages of a topic in a span; skip invalid ones."""
    key = topics_of(file).get(topic)
    if key is None:
        return
    for message in file.messages((key,), start_ns=span.start_ns, end_ns=span.end_ns + 1):
        if (state := decoded(kind, message.data)) is not None:
            yield message, state
