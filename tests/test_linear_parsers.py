"""Every parser of untrusted text takes time in proportion to its length: no peer can occupy a process.

Each parser's input is grown from the parser's own alphabet: one piece of text, repeated, between a head that
leads to the part under test and a tail that it does not expect. The processor time of this thread is compared
for an input and one an eighth as long. A quadratic parser takes 64 times as long, a linear one 8 times.
"""

import contextlib
import gc
import itertools
import math
import random
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import pytest

from controllers.fanuc import data as fanuc_data
from controllers.fanuc import srtp
from controllers.fanuc.ftp import files
from controllers.fanuc.ftp import protocol as ftp
from controllers.fanuc.rmi import messages as rmi
from controllers.opcua import facts
from controllers.opcua.driver import OPCUA, OpcUaDriver
from controllers.universal_robots.interfaces import dashboard, packages, primary, rtde_messages
from controllers.yaskawa import hses
from protocol_gateway.authority.audit_entry import chain_link, parse_line
from protocol_gateway.driver_parts import pendant_text, signal_names
from protocol_gateway.legacy.requests import requests_of
from protocol_gateway.unit_protocol.grammar import type_code
from protocol_gateway.unit_protocol.records import read_number, speed_percent
from protocol_gateway.unit_protocol.stream import Unit, UnitStream
from robomesh import reasons, texts
from robomesh.contract import keys, messages
from robomesh.contract.topics import REQUESTS
from robots.descriptions.description import load
from robots.kinematics.joints import JointType, joints_of
from robots.programs.text import parse_program
from robots.schema.bounded_toml import check_bounds, parse_toml
from robots.shapes.files.declared_size import _named
from robots.shapes.files.vrml.lexer import Kind, Lexer
from robots.shapes.files.vrml.source import Source

pytestmark = pytest.mark.slow

LONG, TIMES = 16 * 1024, 8
MOST_GROWTH = 20.0
"""Between the 8 of a linear parser and the 64 of a quadratic one."""
QUICK_S = 0.004
"""An input that takes less is not compared: a quadratic parser takes far longer for `LONG` characters."""
MOST_ALONE, MOST_RANDOM = 100, 30
NUMBER = "\N{NUMERO SIGN}"
"""In a piece: the number of its repetition."""
READ_BYTES, SMALL_BYTES = 16 * 1024, 61


@dataclass(frozen=True)
class Parser:
    """A parser under test.

    Attributes:
        parse: Function that parses one input, or raises an exception.
        alphabet: Pieces of text that its grammar names.
        heads, tails: Begins and ends of inputs.
    """

    parse: Callable[[str], object]
    alphabet: Sequence[str]
    heads: Sequence[str] = ("",)
    tails: Sequence[str] = ("", "\n", "x\n")

    def inputs(self, chance: random.Random) -> Iterator[tuple[str, str, str]]:
        """Yield heads, repeated pieces and tails: each piece alone, then random sequences of two to four."""
        alone = [*itertools.product(self.heads, self.alphabet, self.tails)]
        yield from chance.sample(alone, min(len(alone), MOST_ALONE))
        for _ in range(MOST_RANDOM):
            piece = "".join(chance.choices(self.alphabet, k=chance.randint(2, 4)))
            yield chance.choice(self.heads), piece, chance.choice(self.tails)


class Stream(Protocol):
    """A parser of the bytes of a connection."""

    def receive(self, data: bytes) -> Any:
        """Take the next bytes."""
        ...


def stream(make: Callable[[], Stream], size: int = READ_BYTES) -> Callable[[str], None]:
    """Return a function that gives a new stream its input in pieces."""

    def parse(text: str) -> None:
        parser, data = make(), text.encode("latin-1")
        for begin in range(0, len(data), size):
            parser.receive(data[begin : begin + size])

    return parse


def by_bytes(parse: Callable[[bytes], object]) -> Callable[[str], object]:
    return lambda text: parse(text.encode("latin-1"))


def of_file(steps: Callable[[], files.Steps[Any]]) -> Callable[[str], object]:
    def parse(text: str) -> object:
        reading = files.Reading(steps())
        stream(lambda: reading)(text)
        return reading.result()

    return parse


def legacy_units(text: str) -> None:
    for event in UnitStream().receive(text.encode("latin-1")):
        if isinstance(event, Unit):
            requests_of(event.records, JOINTS)


class OpcUa:
    """The driver, after its process has reported two axes."""

    def __init__(self) -> None:
        self._driver = OpcUaDriver((JointType.ROTARY,) * 2, {})
        self._driver.opened(OPCUA, 0.0)
        self.receive(facts.encode(facts.Found((facts.Item("mode"), facts.Item("program")), "server", 0.05)))

    def receive(self, data: bytes) -> None:
        self._driver.received(OPCUA, data, 0.0)


class Dashboard:
    """The client, which awaits the answer to a question."""

    def __init__(self) -> None:
        self._dashboard = dashboard.Dashboard()
        self._dashboard.ask(0.0)

    def receive(self, data: bytes) -> None:
        self._dashboard.receive(data, 0.0)


class Rtde:
    """Packages of RTDE, decoded."""

    def __init__(self) -> None:
        self._stream = rtde_messages.RtdeStream()

    def receive(self, data: bytes) -> None:
        for package in self._stream.receive(data):
            if isinstance(package, packages.Package):
                self._stream.decode(package)


class Replies:
    """Replies of FTP, with the port that each may name."""

    def __init__(self) -> None:
        self._stream = ftp.ReplyStream()

    def receive(self, data: bytes) -> None:
        for reply in self._stream.receive(data):
            assert reply.port is None or reply.port


def json_requests(text: str) -> None:
    for request in (messages.schema.CommandRequest, messages.schema.ProgramRequest):
        with contextlib.suppress(Exception):
            messages.decode_request(request, text.encode("latin-1"), messages.JSON)


def protobuf_requests(text: str) -> None:
    for row in REQUESTS.values():
        if row.request is not None:
            with contextlib.suppress(Exception):
                messages.decode_request(row.request, text.encode("latin-1"), messages.PROTOBUF)


def vrml_tokens(text: str) -> None:
    lexer = Lexer(Source(Path("a.wrl"), text))
    while lexer.kind is not Kind.END:
        if not (lexer.is_mark("[") and lexer.number_list() is not None):
            lexer.advance()


JOINTS = joints_of(load("pt600"))
NUMBERS = ("0", "1", "9", ".", "-", "+", "e", " ", "*")
JSON = (*'{}[]:,"\\1-.e ', "\\u0000", "true", "null", '"a"', "\xe9")
UNITS = ("@", "#", "*", "&", ";", "1", " ", "\r", "-", "ABSOLUTE.DEG", "COMMAND", "speed=", "stop", "\xff")
FANUC = (" ", "\n", "\r", ":", "1", "9", ".", "-", "*", "[", "]", "a", '"', "Group #: 1\n", "Joint   1:")
POSITION_HEADS = (
    "",
    "$VERSION: a",
    "Group #: 1\nCURRENT JOINT POSITION:\nJoint   1:",
    "Group #: 1\nCURRENT JOINT POSITION:\nFrame #: ",
    "Group #: 1\nCURRENT USER FRAME POSITION:\nCFG:",
)
TOOL = (
    "    [1,1] = \n  Group: 1   Config: N D B, 0, 0, 0\n"
    "  X: 1.0   Y: 1.0   Z: 1.0\n  W: 1.0   P: 1.0   R: 1.0\n"
)
BYTES = ("\0", "\x01", "\x03", "\n", "\x12", "\x14", "\x7f", "\x80", "\xff", "\0\x03M", "\0\x04S\x01", "a")
TOML = (*"\\\"'.a1 \n[]{}=,#", '.\\"', '"""', "'''", "a.", "[a]\n", f"[{NUMBER}]\n", f"{NUMBER}=1\n")

PARSERS: dict[str, Parser] = {
    "units": Parser(
        stream(UnitStream), UNITS, ("", "1#", "1#ABSOLUTE.DEG*", "1#COMMAND*speed="), ("", "@", "x@")
    ),
    "units in small pieces": Parser(stream(UnitStream, SMALL_BYTES), UNITS, tails=("", "@")),
    "units of old client programs": Parser(
        legacy_units, UNITS, ("1#COMMAND*", "1#COMMAND*speed="), ("@", "x@")
    ),
    "number of a unit": Parser(read_number, NUMBERS),
    "type of a record": Parser(type_code, NUMBERS),
    "speed of a unit": Parser(speed_percent, ("speed", "=", " ", *NUMBERS), ("", "speed", "speed=")),
    "CURPOS.DG": Parser(of_file(partial(files.position, 1)), FANUC, POSITION_HEADS),
    "IOSTATE.DG": Parser(
        of_file(files.inputs_and_outputs),
        ("DIN[ 1] ON\n", "[", "]", "ON", *FANUC),
        ("IO STATUS::\n", "IO STATUS::\nDIN["),
    ),
    "SFTYSIG.DG": Parser(
        of_file(files.safety),
        ("TRUE", "a", "  ", *FANUC),
        ("STOP SIGNALS::\n", "STOP SIGNALS::\na", "STOP SIGNALS"),
    ),
    "ERRACT.LS": Parser(
        of_file(files.active_alarms), ("A", "00110110", *FANUC), ("ERRACT.LS \n", 'ERRACT.LS \n1"a"b"c"')
    ),
    "NUMREG.VA": Parser(
        of_file(files.registers), ("  [1] = 1 \n", "Uninitialized", "=", *FANUC), ("[*NUMREG*]$NUMREG \n", "")
    ),
    "SYSFRAME.VA": Parser(
        of_file(partial(files.tools, 1)),
        (TOOL, TOOL[:-9], *FANUC),
        ("[*SYSTEM*]$MNUTOOL \n", "[*SYSTEM*]$MNUTOOLNUM \n"),
    ),
    "FTP": Parser(stream(Replies), ("227 ", "227-", "1,", ",", "(", "9", " ", "\r\n", "\n"), ("", "227 ")),
    "FTP in small pieces": Parser(stream(Replies, SMALL_BYTES), ("227-", "227 1", ",", "\n"), ("", "227-\n")),
    "RMI": Parser(stream(rmi.LineStream), (*JSON, "\r\n", "\r", " ")),
    "RMI in small pieces": Parser(stream(rmi.LineStream, SMALL_BYTES), ("a", " ", "\r\n", "\r")),
    "message of RMI": Parser(by_bytes(rmi.read), JSON, ("", '{"Command":"FRC_Abort",', "[")),
    "SNPX": Parser(stream(srtp.AnswerStream), BYTES, ("", "\x01" + "\0" * 55)),
    "alarm of SNPX": Parser(
        by_bytes(lambda data: fanuc_data.alarms(data[: len(data) // 200 * 200])),
        ("SRVO", "-", "0", " ", "\0", "\x01"),
    ),
    "text of a pendant": Parser(
        by_bytes(pendant_text.text), ("a", "\xe9", "\x83\x5c", "\0", "\xff", " ", "\n"), tails=("",)
    ),
    "name of a signal": Parser(
        signal_names.unit_of, ("a", ".", "_", "1", "joint."), ("", "joint."), ("", "\n", ".x")
    ),
    "dashboard": Parser(stream(Dashboard), ("true", "Stopped", "\n", "\r", " ", "\x1b", "\xe9")),
    "dashboard in small pieces": Parser(stream(Dashboard, SMALL_BYTES), ("a", " ", "\n")),
    "primary interface": Parser(
        stream(primary.PrimaryStream), BYTES, ("", "\0\0\x7f\0\x14", "\0\x0f\0\0\x10", "\0\0\0\x05\x14")
    ),
    "primary in small pieces": Parser(
        stream(primary.PrimaryStream, SMALL_BYTES), BYTES, ("", "\0\0\x7f\0\x14")
    ),
    "RTDE": Parser(stream(Rtde), BYTES, ("", "\0\x7fM")),
    "HSES": Parser(by_bytes(hses.decode), BYTES, ("", "YERC")),
    "fact of OPC UA": Parser(by_bytes(facts.decode), JSON, ("", '{"values":', '{"found":[')),
    "OPC UA": Parser(
        stream(OpcUa),
        (*JSON, "\n", '{"alive":true}\n', '{"values":[[0,1.0,null,true]]}\n'),
        ("", '{"values":[[0,"'),
    ),
    "OPC UA in small pieces": Parser(stream(OpcUa, SMALL_BYTES), ("[", '"', "a", "\n", '{"alive":true}\n')),
    "key": Parser(
        keys.parse_key,
        ("a", f"{NUMBER}/", "/", "*", "-", ".", "_", "A"),
        ("", "robomesh/", "robomesh/a/b/"),
        ("", "/"),
    ),
    "key of presence": Parser(
        keys.parse_presence_key, ("a", "/", "."), ("", "robomesh/a/b/alive/"), ("", "/")
    ),
    "name": Parser(keys.check_name, ("a", "-", "_", "A", " ")),
    "chunk": Parser(keys.check_chunk, ("a", "-", ".", "A", "/")),
    "text for people": Parser(texts.one_line, ("a", "\n", "\x1b[", "\u202e", "\xe9", "\0"), tails=("",)),
    "text for a terminal": Parser(
        texts.for_terminal, ("a", "\n", "\x1b[", "\u202e", "\xe9", "\0"), tails=("",)
    ),
    "title of a file": Parser(
        lambda text: texts.is_file_title(text, LONG * 2), ("a", ".", "\u202e", "/", " "), tails=("",)
    ),
    "reason of a refusal": Parser(reasons.pairs_of, ("a=1", "&", "%", "%41", "=", "cause."), tails=("",)),
    "request as JSON": Parser(
        json_requests,
        JSON,
        ("", '{"command":"', '{"joint_positions":[', '{"by":"', '{"lease":'),
        ("", "}", '"}', "]}"),
    ),
    "request as protobuf": Parser(protobuf_requests, BYTES, tails=("",)),
    "entry of an audit log": Parser(
        by_bytes(lambda line: (chain_link(line), parse_line(line))),
        (*JSON, '"previous":"'),
        ("", '{"hash":"' + "0" * 64 + '","number":1,'),
        ("", "}\n", "x\n"),
    ),
    "program": Parser(
        lambda text: parse_program(text, JOINTS),
        (
            "move_joints ",
            "1",
            ".",
            "e",
            "-",
            " ",
            "\n",
            "#",
            "a",
            "point p = joints ",
            "repeat 2\n",
            f"point p{NUMBER} = joints 0\nmove_joints q{NUMBER}\n",
            "end\n",
        ),
        ("", "move_joints "),
    ),
    "bounds of TOML": Parser(check_bounds, TOML, ("", 'a="', 'a="""', "a='''", "[", "a=["), ("", '"', "x")),
    "TOML": Parser(parse_toml, TOML, ("", 'a="', 'a="""', "a='''", "[", "a=["), ("", '"', "x")),
    "materials of OBJ": Parser(
        partial(_named, "mtllib"), (" ", "\r", "\t", "a", "mtllib"), ("", "mtllib a"), ("", "\0")
    ),
    "VRML": Parser(
        vrml_tokens,
        ("1", ".", "e", "0x", "+", "-", " ", ",", "\n", "#", '"', "\\", "[", "]", "{", "a"),
        ("", "[", '"'),
        ("", "]", "x"),
    ),
}
"""All parsers of untrusted text in a process that carries a stop, and of files that people upload."""


@pytest.mark.parametrize("name", PARSERS)
def test_parser_takes_time_in_proportion_to_its_input(name: str) -> None:
    parser = PARSERS[name]
    for head, piece, tail in parser.inputs(random.Random(name)):
        growth = growth_of(parser.parse, lambda length: grown(head, piece, tail, length))  # noqa: B023
        assert growth < MOST_GROWTH, (
            f"{head!r} + {piece!r} x n + {tail!r}: {TIMES} times the text, {growth:.0f} times as long"
        )


def grown(head: str, piece: str, tail: str, length: int) -> str:
    times = length // len(piece)
    if NUMBER not in piece:
        return head + piece * times + tail
    return head + "".join(piece.replace(NUMBER, str(number)) for number in range(times)) + tail


def growth_of(parse: Callable[[str], object], text: Callable[[int], str]) -> float:
    """Return by what factor the time grows, 0 if the long input is quick; the least of some attempts."""
    short = long = growth = math.inf
    for _ in range(5):
        long = min(long, processor_s(parse, text(LONG)))
        if long < QUICK_S:
            return 0.0
        short = min(short, processor_s(parse, text(LONG // TIMES)))
        growth = min(growth, long / short)
        if growth < MOST_GROWTH:
            break
    return growth


def processor_s(parse: Callable[[str], object], text: str) -> float:
    """Return the time of this thread, without that of other processes and of the garbage collector."""
    gc.disable()
    try:
        begin_s = time.thread_time()
        with contextlib.suppress(Exception):
            parse(text)
        return time.thread_time() - begin_s
    finally:
        gc.enable()


def test_measurement_finds_a_quadratic_parser() -> None:
    assert growth_of(lambda text: [sum(text.encode()) for _ in text[::64]], "a".__mul__) > MOST_GROWTH
    assert growth_of(lambda text: [sum(text.encode()) for _ in range(64)], "a".__mul__) < MOST_GROWTH
