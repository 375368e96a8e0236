"""A publisher of every topic, and owner of every request, with hostile values in every field.

Messages are made from the topic table and the protobuf descriptors: a new field or topic needs nothing here.
"""

import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Any

import zenoh
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import Message

from robomesh.contract.endpoints import client_config
from robomesh.contract.header import Header, pack
from robomesh.contract.topics import TOPICS

# A title, a cleared screen, a question that a terminal answers as its keyboard, a colour that no command has,
# C1 controls, direction, zero width, forged lines, rich's markup.
SEQUENCES = (
    "\x1b]0;title\x07\x1b[2J\x1b[6n\x1bc\x1b[38;5;201m\x9b2J\x9d0;t\x9c\x7f\x08\x00\u202e\u2066\u200b\ufeff"
    "\u2028FORGED\rFORGED\x0bFORGED\x85FORGED\nFORGED\r\nFORGED [bold]b[/bold] [/nothing] :smile:"
)
UNKNOWN = 77
ROBOT, REPLAY, IDENTITY = "arm", "replay-1", "li.1"
_EACH_S = 0.2
_DEEPEST = 5


@dataclass
class Values:
    """The values of a hostile message's fields.

    Attributes:
        texts: End of each text, after its field's name.
        enum: Value of each enum; None: its first that is not 0.
        number: Value of each floating-point number.
        integer: Largest integers instead of small ones.
        seconds: Of each time [s]; None: now.
        listed: Number of values of a repeated field.
        fixed: Values by the full names of fields, which lead a command to the others.
    """

    texts: str = ""
    enum: int | None = None
    number: float = 1.5
    integer: bool = False
    seconds: int | None = None
    listed: int = 1
    fixed: Mapping[str, Any] = field(default_factory=dict)

    def message(self, schema: type[Message]) -> Any:
        """Return a message of which every field is set."""
        message = schema()
        self._fill(message, ())
        return message

    def _fill(self, message: Any, above: tuple[str, ...]) -> None:
        descriptor = message.DESCRIPTOR
        if descriptor.full_name in ("google.protobuf.Timestamp", "google.protobuf.Duration"):
            at_s = time.time() if self.seconds is None else self.seconds
            message.seconds = int(at_s) if descriptor.name == "Timestamp" or self.seconds else 2
            return
        for each in descriptor.fields:
            self._set(message, each, (*above, descriptor.full_name))

    def _set(self, message: Any, each: FieldDescriptor, above: tuple[str, ...]) -> None:
        fixed = self.fixed.get(f"{above[-1].removeprefix('robomesh.')}.{each.name}")
        if each.message_type is None:
            value = self._plain(each) if fixed is None else fixed
            if each.is_repeated:
                getattr(message, each.name).extend([value] * self.listed if fixed is None else value)
            else:
                setattr(message, each.name, value)
        elif each.message_type.GetOptions().map_entry:
            key, value = each.message_type.fields
            getattr(message, each.name)[self._plain(key)] = self._plain(value)
        elif each.message_type.full_name not in above and len(above) < _DEEPEST:
            child = getattr(message, each.name)
            for _ in range(self.listed if each.is_repeated else 1):
                part = child.add() if each.is_repeated else child
                part.SetInParent()
                self._fill(part, above)

    def _plain(self, each: FieldDescriptor) -> Any:
        match each.cpp_type:
            case FieldDescriptor.CPPTYPE_STRING if each.type == FieldDescriptor.TYPE_BYTES:
                return self.texts.encode() or b"\x00\x01"
            case FieldDescriptor.CPPTYPE_STRING:
                return f"{name_of(each)}{self.texts}"
            case FieldDescriptor.CPPTYPE_ENUM:
                return each.enum_type.values[1].number if self.enum is None else self.enum
            case FieldDescriptor.CPPTYPE_DOUBLE | FieldDescriptor.CPPTYPE_FLOAT:
                return self.number
            case FieldDescriptor.CPPTYPE_BOOL:
                return True
            case FieldDescriptor.CPPTYPE_UINT64:
                return 2**64 - 1 if self.integer else 1
            case FieldDescriptor.CPPTYPE_INT64:
                return 2**63 - 1 if self.integer else 1
            case FieldDescriptor.CPPTYPE_UINT32:
                return 2**32 - 1 if self.integer else 1
        return 2**31 - 1 if self.integer else 1


def name_of(each: FieldDescriptor) -> str:
    """Return a field's name in texts: `<Alarm.text>`."""
    return f"<{each.containing_type.name}.{each.name}>"


def text_fields(descriptor: Descriptor, above: tuple[str, ...] = ()) -> Iterator[str]:
    """Yield the names of a message's texts, as `Values` writes them."""
    for each in descriptor.fields:
        if each.message_type is None:
            if each.type == FieldDescriptor.TYPE_STRING:
                yield name_of(each)
        elif each.message_type.full_name not in (*above, descriptor.full_name):
            yield from text_fields(each.message_type, (*above, descriptor.full_name))


@contextmanager
def publisher(router: str, site: str, values: Values, *, refuse: bool = False) -> Iterator[None]:
    """Publish every topic, answer every query, and be present, until the block ends.

    Args:
        router: Its endpoint.
        site: Its site's name.
        values: Of all messages.
        refuse: Refuse requests, with a hostile sentence.
    """
    messages = {
        key: values.message(row.history_schema or row.schema).SerializeToString()
        for key, row in _topic_keys(site).items()
    }
    single = {key: values.message(row.schema).SerializeToString() for key, row in _topic_keys(site).items()}

    def answer(query: zenoh.Query) -> None:
        with query:
            for key, payload in messages.items():
                if query.key_expr.intersects(zenoh.KeyExpr(key)):
                    query.reply(key, payload, encoding="application/protobuf")
            key = str(query.key_expr)
            row = None if "*" in key else _request_of(key)
            if row is None:
                return
            if refuse:
                query.reply_err(f"<refusal>{values.texts}".encode(), encoding="text/plain")
                return
            reply = b"bytes" if row.answer is None else values.message(row.answer).SerializeToString()
            query.reply(key, reply, encoding="application/protobuf")

    with ExitStack() as stack:
        session = stack.enter_context(zenoh.open(client_config((router,))))
        stack.enter_context(session.declare_queryable(f"robomesh/{site}/**", answer, complete=True))
        for service in (
            "gateway",
            "kinematics",
            "renderer",
            "recorder",
            "store",
            "watch",
            "player",
            "operator",
        ):
            for robot in (ROBOT, REPLAY, "-"):
                key = f"robomesh/{site}/{robot}/alive/{service}/{IDENTITY}"
                stack.enter_context(session.liveliness().declare_token(key))
        stack.enter_context(
            session.liveliness().declare_token(f"robomesh/{site}/{ROBOT}/alive/\x1b[2J\u202e/\x9b1")
        )
        ended = threading.Event()

        def publish() -> None:
            sequence = 0
            while not ended.wait(_EACH_S):
                sequence += 1
                header = pack(Header(1, sequence, time.time_ns()))
                for key, payload in single.items():
                    session.put(key, payload, attachment=header, encoding="application/protobuf")

        thread = threading.Thread(target=publish)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()


def _topic_keys(site: str) -> dict[str, Any]:
    return {
        f"robomesh/{site}/{robot}/{name.replace('*', IDENTITY)}": row
        for name, row in TOPICS.items()
        for robot in (ROBOT, REPLAY, "-")
    }


def _request_of(key: str) -> Any:
    from robomesh.contract.topics import request
    from robomesh.errors import RobomeshError

    try:
        return request(key.split("/", 3)[3])
    except RobomeshError:
        return None
