"""Broken files and replies of FANUC's controllers by FTP.

    python -m tests.controllers.fanuc.fuzz_ftp [--inputs N] [--seconds S] [--seed N] [--keep FOLDER]

Files and replies to the driver's own commands, changed at random, doubled, cut, out of order and without an
end. They may cause no exception and no leak. Joints, poses and alarms must be those of a strict reading that
is independent of the gateway's, of a file that has ended and was confirmed. The driver may send nothing but
its declared commands, one at a time. Anything else ends the run with exit status 1 and its input in the
folder.
"""

import random
import re
from collections import Counter
from collections.abc import Callable
from functools import partial

from controllers.fanuc.axes import FanucSettings
from controllers.fanuc.ftp.driver import FILE, FTP, FtpDriver
from protocol_gateway.seam import (
    AlarmReceived,
    Close,
    ControllerEvent,
    Effects,
    JointsReceived,
    Open,
    Report,
    Send,
    SetTimer,
    Severity,
    SignalsReceived,
    StatusReceived,
)
from robots.kinematics.joints import JointType
from tests.fuzz.fuzzing import Finding, answers, campaign, changed

NEW_BENCH_EACH = 500
SETTINGS = FanucSettings(j23=1, rate_hz=1.0, registers=(5,), io=("DI[1-4]", "RO[2]"))
COMMANDS = re.compile(
    rb"(USER anonymous|PASS |TYPE I|CWD md:|PASV"
    rb"|RETR (CURPOS\.DG|IOSTATE\.DG|SFTYSIG\.DG|ERRACT\.LS|NUMREG\.VA|SYSFRAME\.VA))\r\n"
)
RADIAN = 0.017453292519943295


def fuzz(inputs: int, seed: int, counts: Counter[str]) -> tuple[int, Finding | None]:
    """Return how many replies and parts of files were read, and the first that was handled wrongly."""
    return answers(inputs, seed, lambda: Bench(counts), renew_each=NEW_BENCH_EACH)


class Bench:
    """A driver, its clock, and a controller that is the fuzzer's.

    Attributes:
        problem: Wrong command of the driver; empty: none.
    """

    def __init__(self, counts: Counter[str]) -> None:
        self.driver = FtpDriver((JointType.ROTARY,) * 6, {}, options=SETTINGS)
        self.now_s = 0.0
        self.problem = ""
        self._counts = counts
        self._timer_s: float | None = None
        self._for_file = False  # what `next_bytes` returned are bytes of a file
        self._perform(self.driver.started(0.0))

    def _open(self) -> None:
        self._command = b""  # that is not answered
        self._file = ""  # that is read
        self._content = b""
        self._replies = b""
        self._connected = self._awaited = self._ended = self._given = False
        self._greets = True
        self._perform(self.driver.opened(FTP, self.now_s))

    def _perform(self, effects: Effects) -> list[ControllerEvent]:
        """Note what the driver does; return what it reports."""
        events: list[ControllerEvent] = []
        for effect in effects:
            match effect:
                case Send(channel, data):
                    self._check(data, channel is FTP)
                case SetTimer(at_s):
                    self._timer_s = at_s
                case Open(channel, port) if channel is FILE:
                    self._awaited, self._connected = True, False
                    if port != 1025:
                        self._awaited = port is not None and 0 < port < 65536
                case Open():
                    self._open()
                case Close(channel) if channel is FILE:
                    self._awaited = self._connected = False
                case Close():
                    self._command, self._file, self._greets = b"", "", False
                    self._awaited = self._connected = False
                case Report(reported):
                    events += reported
                case _:
                    pass
        return events

    def _check(self, data: bytes, of_ftp: bool) -> None:
        """Note a command that is not declared, or that comes before the answer to the last one."""
        if not of_ftp or COMMANDS.fullmatch(data) is None:
            self.problem = f"sends {data!r}"
        elif self._command and not self._answered():
            self.problem = f"sends {data!r} before the answer to {self._command!r}"
        elif data.startswith(b"RETR") and not self._connected:
            self.problem = f"sends {data!r} without a connection for the file"
        # What came after the answer to the last command may begin that to this one.
        self._command, self._replies = data, self._replies[self._answer()[1] :]
        self._file = data[5:-2].decode() if data.startswith(b"RETR") else ""
        self._content, self._ended, self._given = b"", False, False

    def next_bytes(self, chance: random.Random) -> bytes:
        """Return a reply or a part of a file, right or wrong; a command is open then."""
        self._for_file = False
        for _ in range(20):
            if self._awaited:
                # The connection for the file is made, or fails.
                self._awaited, self._connected = False, chance.random() < 0.99
                done = self.driver.opened if self._connected else self.driver.closed
                self.problem = self.problem or self._tell(partial(done, FILE, self.now_s))
            elif self._is_quiet() and self._timer_s is not None:
                self.now_s = max(self.now_s, self._timer_s)
                self._timer_s = None
                self._perform(self.driver.timer_ended({}, self.now_s))
            else:
                break
        if chance.random() < 0.005 and self._timer_s is not None:
            # Nothing comes in time.
            self.now_s = max(self.now_s, self._timer_s)
            self._perform(self.driver.timer_ended({}, self.now_s))
        if self._connected and not self._ended and self._file and chance.random() < 0.8:
            self._for_file = True
            right = [each.encode("latin-1") for each in FILES[self._file]]
            if self._given:
                # Its end.
                return b""
            data = chance.choice(right)
            return data if chance.random() < 0.3 else changed(data, right, TOKENS, chance)
        data = self._reply(chance)
        return data if chance.random() < 0.98 else changed(data, REPLIES, TOKENS, chance)

    def _is_quiet(self) -> bool:
        """Return whether the driver awaits nothing, so that only its timer goes on."""
        if self._greets:
            return False
        answered = self._answered()
        return not self._command or (answered > 0 and (not self._file or self._ended or answered >= 4))

    def _reply(self, chance: random.Random) -> bytes:
        match self._command:
            case b"":
                return b"220-R-30iB\r\n220 FTP server ready.\r\n"
            case b"PASV\r\n":
                return b"227 Entering Passive Mode (9,9,9,9,4,1)\r\n"
            case b"TYPE I\r\n":
                return b"200 Type set to I.\r\n"
            case b"CWD md:\r\n":
                return b"250 CWD command successful.\r\n"
            case data if data.startswith(b"USER"):
                return b"331 Password.\r\n" if chance.random() < 0.2 else b"230 User logged in [NORM].\r\n"
            case data if data.startswith(b"PASS"):
                return b"230 in\r\n"
            case _:
                refusals = (b"550 no such file\r\n", b"450 busy\r\n", b"426 aborted\r\n")
                if chance.random() < 0.03:
                    return chance.choice(refusals)
                return (
                    b"226 Binary Transfer complete.\r\n"
                    if self._ended
                    else b"150 Binary data connection.\r\n"
                )

    def receive(self, data: bytes) -> str:
        """Give bytes to the driver; return the problem with what it reports, empty: none."""
        self.now_s += 0.002
        if self._for_file:
            if data or not self._given:
                self._content += data
                self._given = True
                return self._tell(partial(self.driver.received, FILE, data, self.now_s))
            if self._connected:
                self._ended, self._connected = True, False
                return self._tell(partial(self.driver.closed, FILE, self.now_s))
            return ""
        self._replies += data
        self._greets = False
        return self._tell(partial(self.driver.received, FTP, data, self.now_s))

    def _tell(self, call: Callable[[], Effects]) -> str:
        """Return the problem with the driver's reports of a call; they may begin the next file."""
        whole = self._ended and self._answered() == 2
        file, content = self._file if whole else "", self._content
        return self._compare(self._perform(call()), file, content)

    # ------------------------------------------------------ a strict reading, written apart

    def _answered(self) -> int:
        """Return the first digit of the reply that ends the open command; 0: there is none."""
        return self._answer()[0]

    def _answer(self) -> tuple[int, int]:
        """Return the first digit of the reply that ends the open command, and where it ends."""
        begun, end = "", 0
        for line in self._replies.decode("latin-1").split("\n")[:-1]:
            end += len(line) + 1
            line = line.rstrip("\r")
            if begun:
                begun = "" if line[:3] == begun and line[3:4] != "-" and line[:4].strip() == begun else begun
                if begun:
                    continue
            elif line[3:4] == "-":
                begun = line[:3]
                continue
            if not line.startswith("1"):
                return int(line[0]) if line[:1].isdecimal() else 5, end
        return 0, 0

    def _compare(self, events: list[ControllerEvent], file: str, content: bytes) -> str:
        self._counts.update(type(event).__name__ for event in events)
        text = content.decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
        joints = [each.positions for each in events if isinstance(each, JointsReceived)]
        if joints:
            if file != "CURPOS.DG":
                return f"joints {joints} without a whole file"
            right = strict_joints(text)
            if any(abs(a - b) > 1e-9 for a, b in zip(joints[0], right, strict=True)):
                return f"joints {joints}, a strict reading gives {right}"
        for each in events:
            if isinstance(each, SignalsReceived):
                values = {signal.name: value for signal, value in each.values}
                x = values.get("tool.pose.x")
                if isinstance(x, float) and (file != "CURPOS.DG" or abs(x - strict_x(text) / 1000) > 1e-9):
                    return f"a pose with x = {x}"
            if isinstance(each, StatusReceived) and (file != "IOSTATE.DG" or "IO STATUS" not in text):
                return f"a status from {file or 'no whole file'}"
            if isinstance(each, AlarmReceived) and each.severity is not Severity.INFO:
                alarm = file == "ERRACT.LS" and each.number != "0-000" and each.number.split("-")[0] in text
                unnamed = file == "ERRACT.LS" and each.number == "0-000"
                if not (alarm or unnamed):
                    return f"an alarm {each.number} from {file or 'no whole file'}"
        return ""


def strict_part(text: str) -> str:
    """Return the part of group 1."""
    parts: dict[int, str] = {}
    number = 0
    for line in text.split("\n"):
        title, _, rest = line.partition(":")
        if title == "Group #" and rest[:1] == " " and rest.strip().isdecimal():
            number = int(rest)
            if number in parts:
                raise ValueError(f"group {number} twice")
        parts[number] = parts.get(number, "") + line + "\n"
    return parts[1]


def strict_joints(text: str) -> list[float]:
    """Return the joints of group 1 [rad]."""
    part = strict_part(text)
    found = {}
    for line in part.split("CURRENT JOINT POSITION:")[1].split("\n"):
        if line.startswith("Joint"):
            name, value = line.split(":")
            found[int(name[5:])] = float(value)
    if sorted(found) != list(range(1, len(found) + 1)):
        raise ValueError(f"joints {sorted(found)}")
    extra = [
        float(line.split(":")[2]) for line in part.split("Frame #:")[0].split("\n") if line[:6] == "EXTAXS"
    ]
    axes = [found[number] for number in sorted(found)] + extra
    axes[2] += axes[1]
    return [each * RADIAN for each in axes[:6]]


def strict_x(text: str) -> float:
    """Return x of group 1 in the world frame [mm]."""
    part = strict_part(text)
    world = part.split("\nCURRENT WORLD POSITION:")[1]
    return float(next(line for line in world.split("\n") if line.startswith("X:"))[2:])


# -------------------------------------------------------------------------------- inputs


def _group(number: int, axes: tuple[str, ...], place: tuple[str, ...], extra: str = "") -> str:
    lines = "".join(f"Joint{each:4}:{value:>10}\n" for each, value in enumerate(axes, start=1))
    extended = f"EXTAXS: 1:{extra:>10}\n" if extra else ""
    values = "".join(f"{axis}:{value:>10}\n" for axis, value in zip("XYZWPR", place, strict=False))
    where = f"CFG: N U T, 0, 0, 0\n{values}" if place else "Cartesian position cannot be calculated\n"
    return (
        f"CURRENT ROBOT POSITION::\nGroup #: {number:2}\n \nCURRENT JOINT POSITION:\n{lines}{extended}\n\n"
        f"Frame #:   0  Tool #:   1\nCURRENT USER FRAME POSITION:\n{where}{extended}\n\n"
        f"Tool #:   1\nCURRENT WORLD POSITION:\n{where}{extended}\n\n"
    )


_HEAD = (
    "F Number: F12345\r\nVERSION : HandlingTool   \r\n$VERSION: V9.30146      5/27/2021\nDATE: 26-NOV-26\n\n"
)
_AXES = ("-70.39", "-24.78", "-.65", ".15", "-89.38", "-19.65")
_PLACE = ("1505.56", "-1155.07", "165.31", ".08", "-.13", "-.04")
_STARS = "*" * 10
_IO = (
    "IO STATUS::\n\nDIN[   1]  ON  NoStop\nDIN[   2] OFF  \nGIN[   1]    0  \nRO[   2]  ON  \n"
    "UO[   1]  ON  Cmd enabled\nUO[   2]  ON  \nUO[   3] OFF  \nUO[   8] OFF  \nFLG[ 508] OFF   FLG[ 2] OFF\n"
)
_SAFETY = "STOP SIGNALS::\n\nExternal ESTOP   FALSE\nTP Enable        TRUE \nTP Deadman       TRUE \n"
_NO_ALARM = "ERRACT.LS      Robot Name ROBOT 26-NOV-26 09:30:54  \n\n"
_ALARMS = (
    f'{_NO_ALARM}17" 26-NOV-26 09:30:02 " SRVO-037 IMSTP input (Group:2) " " SERVO            00110110" \n'
    '18" 26-NOV-26 09:30 " JOG -010 Jog pressed before shift " " WARN                00000000" \n'
    '19" 26-NOV-26 09:30 " MOTN-018 Position not reachable " DATA 0 "                   00100100" \n'
)
_REGISTERS = (
    "[*NUMREG*]$NUMREG  Storage: SHADOW  Access: RW  : ARRAY[9] OF Numeric Reg\n  [1] = 36  '' \n"
    "  [5] = -.364000  'Wear' \n  [6] = Uninitialized  '' \n[*NUMREG*]$MAXREGNUM  Storage: CMOS = 9\n"
)
_FRAMES = (
    "[*SYSTEM*]$MNUTOOL  Storage: SHADOW  Access: RW  : ARRAY[1,2] OF POSITION\n    [1,1] = \n"
    "  Group: 1   Config: N D B, 0, 0, 0\n  X:     0.000   Y:  -250.800   Z:   152.800\n"
    "  W:   -90.000   P:   -90.000   R:     0.000\n\n"
    "[*SYSTEM*]$MNUTOOLNUM  Storage: SHADOW  Access: RW  : ARRAY[1] OF BYTE\n  [1] = 1\n\n"
)
FILES: dict[str, tuple[str, ...]] = {
    "CURPOS.DG": (
        _HEAD + _group(1, _AXES, _PLACE),
        _HEAD + _group(1, _AXES, _PLACE, "-1444.07") + _group(2, ("12.50",), ()),
        (_HEAD + _group(1, _AXES, _PLACE)).replace("\n", "\r\n"),
        _HEAD + _group(1, (*_AXES[:3], _STARS, *_AXES[4:]), _PLACE),
        _HEAD + _group(1, _AXES, (_STARS, *_PLACE[1:])),
        _HEAD + _group(2, _AXES, _PLACE),
        _HEAD + _group(1, _AXES[:4], _PLACE),
        "",
    ),
    "IOSTATE.DG": (_HEAD + _IO, _HEAD),
    "SFTYSIG.DG": (_HEAD + _SAFETY,),
    "ERRACT.LS": (_NO_ALARM, _ALARMS),
    "NUMREG.VA": (_REGISTERS,),
    "SYSFRAME.VA": (_FRAMES,),
}
REPLIES = (
    *(b"220 ready\r\n", b"230 in\r\n", b"331 pass\r\n", b"530 no\r\n", b"200 ok\r\n", b"250 ok\r\n"),
    *(b"227 (1,2,3,4,5,6)\r\n", b"150 data\r\n", b"226 done\r\n", b"425 no\r\n", b"421 bye\r\n", b"220-\r\n"),
)
TOKENS = (
    *(b"\r\n", b"\n", b"\r", b"\0", b"\xff", b'"', b":", b" ", b"-", b"."),
    *(b"Group #:  1\n", b"Joint   1:     99.00\n", b"EXTAXS: 2:      1.00\n", b"CURRENT WORLD POSITION:\n"),
    *(b"9" * 12, b"1e9", b"nan", b"inf", b"*" * 10, b"ON", b"TRUE", b"226 done\r\n", b"\x1b[2J"),
    "異常".encode("shift_jis"),
)


if __name__ == "__main__":
    campaign(
        __doc__,
        fuzz,
        name="fanuc-ftp",
        verdict="no exception, no joints, pose and alarm but what a strict reading of a whole file gives; "
        "only the declared commands were sent, one at a time",
    )
