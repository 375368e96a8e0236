"""A value of an enum that a newer program has added is shown as its number, and ends no program of today."""

import re
from pathlib import Path

import pytest
from foxglove_schemas_protobuf.Log_pb2 import Log

from robomesh.client.robot import samples
from robomesh.contract.activity import activity_words
from robomesh.contract.enum_names import enum_name, enum_word
from robomesh.contract.topics import REQUESTS, TOPICS
from robomesh.recordings.series.values import values_of
from robomesh.schemas import robomesh_pb2 as schema
from services.foxglove import messages as foxglove
from tests.hostile import UNKNOWN, Values

ROOT = Path(__file__).resolve().parents[2]
VALUES = Values(enum=UNKNOWN)
SCHEMAS = {row.schema for row in TOPICS.values()} | {row.answer for row in REQUESTS.values() if row.answer}


def test_a_name_is_the_values_and_an_unknown_values_its_number():
    mode = schema.ControllerState.Mode
    assert enum_name(mode, mode.MODE_UNKNOWN) == "MODE_UNKNOWN"
    assert enum_word(mode, mode.MODE_UNKNOWN) == "unknown"
    assert enum_name(mode, UNKNOWN) == enum_word(mode, UNKNOWN) == "77"


def test_no_module_reads_the_name_of_an_enum_elsewhere():
    parts = (ROOT / part for part in ("robomesh", "services", "protocol_gateway", "renderer"))
    found = [
        str(path)
        for part in parts
        for path in part.rglob("*.py")
        if re.search(r"(?<!x509)\.Name\(", path.read_text())
    ]
    assert found == []


@pytest.mark.parametrize("schema", sorted(SCHEMAS, key=lambda each: each.DESCRIPTOR.full_name))
def test_series_take_every_message(schema):
    message = VALUES.message(schema)
    assert all(isinstance(each, float) for _, each in values_of(schema.DESCRIPTOR.full_name, message))


def test_the_client_library_shows_numbers():
    event = samples.event_of("hall", "arm", VALUES.message(schema.Event))
    alarm = samples.alarm_of(VALUES.message(schema.Alarm))
    assert (event.severity, alarm.priority, alarm.state) == ("77", "77", "77")


def test_a_log_of_foxglove_has_an_unknown_severity_in_its_text():
    log = Log.FromString(foxglove.log_of(VALUES.message(schema.Event).SerializeToString(), "arm"))
    assert log.level == Log.UNKNOWN
    assert log.message.endswith("severity 77")


def test_activity_is_its_number():
    assert "77" in activity_words(schema.ControllerState(activity=UNKNOWN))
