"""The part of FTP that reads files, without I/O: the commands that can be sent, and the server's replies.

Nothing here can write, delete, rename or execute: no other commands than these exist in this module.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

PORT = 21
FOLDER = "md:"
"""Device of the controller on which it writes its own state, when a file is read."""
_LONGEST_LINE, _MOST_LINES = 2048, 200
_REPLY = re.compile(r"([1-5]\d\d)(?:([ -])(.*))?")
_PASSIVE = re.compile(r"(?<!\d)(\d{1,3}),(\d{1,3}),(\d{1,3}),(\d{1,3}),(\d{1,3}),(\d{1,3})(?!\d)")
_BYTE = range(256)


class File(Enum):
    """A file that is read."""

    POSITION = "CURPOS.DG"
    SIGNALS = "IOSTATE.DG"
    SAFETY = "SFTYSIG.DG"
    ALARMS = "ERRACT.LS"
    REGISTERS = "NUMREG.VA"
    FRAMES = "SYSFRAME.VA"


PASSIVE = b"PASV\r\n"
"""Ask for a port from which the next file is read."""
BINARY = b"TYPE I\r\n"
"""Read files as they are. Other programs read these files so too."""
ENTER_FOLDER = f"CWD {FOLDER}\r\n".encode()


def user(name: str) -> bytes:
    """Return the command that names the user.

    Raises:
        ValueError: If the name is not printable ASCII.
    """
    return b"USER " + _word(name) + b"\r\n"


def password(text: str) -> bytes:
    """Return the command with the password, which may be empty.

    Raises:
        ValueError: If the password is not printable ASCII.
    """
    return b"PASS " + _word(text) + b"\r\n"


def read(file: File) -> bytes:
    """Return the command that reads a file."""
    return f"RETR {file.value}\r\n".encode()


def _word(text: str) -> bytes:
    if not text.isascii() or (text and not text.isprintable()):
        raise ValueError("must have only printable ASCII characters")
    return text.encode()


@dataclass(frozen=True, slots=True)
class Reply:
    """A reply of the server.

    Attributes:
        code: Three digits.
        text: Of its last line.
    """

    code: int
    text: str

    @property
    def port(self) -> int | None:
        """Port of a reply to `PASSIVE`; None: it has none.

        Its host is not used: the gateway connects to the controller only.
        """
        found = _PASSIVE.search(self.text)
        if found is None:
            return None
        values = [int(each) for each in found.groups()]
        number = 256 * values[4] + values[5]
        return number if number and all(each in _BYTE for each in values) else None

    def __str__(self) -> str:
        return f"{self.code} {self.text}".rstrip()


class ReplyStream:
    """Replies in the bytes of a connection, split anywhere."""

    def __init__(self) -> None:
        self._rest = b""
        self._code = ""  # of a reply of several lines that has begun
        self._lines = 0

    def receive(self, data: bytes) -> Sequence[Reply]:
        """Return the replies that are complete.

        Raises:
            ValueError: If the bytes are no replies; nothing can be read after them.
        """
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > _LONGEST_LINE:
            raise ValueError(f"a line of more than {_LONGEST_LINE} bytes")
        found = []
        for line in lines:
            if len(line) > _LONGEST_LINE:
                raise ValueError(f"a line of more than {_LONGEST_LINE} bytes")
            if (reply := self._line(line.rstrip(b"\r").decode("latin-1"))) is not None:
                found.append(reply)
        return found

    def _line(self, line: str) -> Reply | None:
        match = _REPLY.fullmatch(line)
        if self._code:
            self._lines += 1
            if self._lines > _MOST_LINES:
                raise ValueError(f"a reply of more than {_MOST_LINES} lines")
            if match is None or match[1] != self._code or match[2] == "-":
                return None
            self._code = ""
        elif match is None:
            raise ValueError(f"no reply of FTP: {line[:60]!r}")
        elif match[2] == "-":
            self._code, self._lines = match[1], 1
            return None
        return Reply(int(match[1]), (match[3] or "").strip())
