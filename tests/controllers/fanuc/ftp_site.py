"""Simulated controller of FANUC's kind that is read by FTP, and files as its software writes them."""

import contextlib
from dataclasses import replace

from controllers.fanuc.axes import FanucSettings
from controllers.fanuc.ftp.files import Reading
from controllers.fanuc.simulated.service import FtpSettings, serve_ftp
from tests.controllers.simulated_site import running

SETTINGS = FanucSettings(j23=1, rate_hz=20.0, registers=(1,))
"""Twenty times faster than a site file allows, so that the tests are short."""
FANUC_FTP = {"description": "puma560", "protocol": "fanuc-ftp", "options": SETTINGS}


@contextlib.asynccontextmanager
async def controller(**settings):
    """Run a simulated controller; yield its port."""
    async with running(serve_ftp, FtpSettings(**{"fanuc": replace(SETTINGS)} | settings)) as port:
        yield port


def read(steps, file):
    """Return what a parser finds in a whole file."""
    reading = Reading(steps)
    reading.receive(file if isinstance(file, bytes) else file.encode("latin-1"))
    return reading.result()


def position(*groups, cfg_first=True):
    """Return CURPOS.DG with groups of axes, extended axes, frame, tool and Cartesian position."""
    return "F Number: F12345\nVERSION : HandlingTool         \n$VERSION: V9.30146      5/27/2021\n" + (
        "DATE:     26-NOV-26 09:30 \n\n" + "".join(group(*each, cfg_first=cfg_first) for each in groups)
    )


def group(number, axes, place, extended=(), frame=0, tool=1, *, cfg_first=True):
    """Return one group of the file; `place`: six numbers, or None."""
    lines = [f"Joint{each:4}:{value:>10}" for each, value in enumerate(axes, start=1)]
    extra = [f"EXTAXS:{each:2}:{value:>10}" for each, value in enumerate(extended, start=1)]
    if place is None:
        where = ["Cartesian position cannot be calculated"]
    else:
        values = [f"{axis}:{value:>10}" for axis, value in zip("XYZWPR", place, strict=True)]
        where = ["CFG: N U T, 0, 0, 0", *values] if cfg_first else [*values, "CFG: N U T, 0, 0, 0"]
    where += extra
    return "\n".join(
        [
            "CURRENT ROBOT POSITION::",
            f"Group #: {number:2}",
            " ",
            "CURRENT JOINT POSITION:",
            *lines,
            *extra,
            "\n",
            f"Frame #: {frame:3}  Tool #: {tool:3}",
            "CURRENT USER FRAME POSITION:",
            *where,
            "\n",
            f"Tool #: {tool:3}",
            "CURRENT WORLD POSITION:",
            *where,
            "\n",
        ]
    )


def alarm(text, severity="SERVO", cause="", time="26-NOV-26 09:30:02"):
    """Return a line of ERRACT.LS."""
    cause = f"{cause:<50}" if cause else ""
    return f'17" {time} " {text:<50}" {cause}" {severity:<30}00110110" \n'


def alarms(*lines):
    """Return ERRACT.LS."""
    return "ERRACT.LS      Robot Name ROBOT 26-NOV-26 09:30:54  \n\n" + "".join(lines)


def io_state(**on):
    """Return IOSTATE.DG with signals by name and number, as DIN1=True."""
    lines = []
    for name, value in on.items():
        kind = name.rstrip("0123456789")
        lines.append(f"{kind}[{int(name[len(kind) :]):4}] {'ON' if value else 'OFF':>3}  Some name\n")
    return "F Number: F12345\nDATE:     26-NOV-26 09:30 \n\nIO STATUS::\n\n" + "".join(lines)


def stop_signals(**on):
    """Return SFTYSIG.DG with signals by name, as TP_Enable=True."""
    names = (
        "External ESTOP",
        "SOP Estop",
        "TP ESTOP",
        "Hand Broken",
        "Fence Open",
        "TP Enable",
        "TP Deadman",
    )
    rows = {name: on.get(name.replace(" ", "_"), False) for name in names}
    lines = "".join(f"{name:<16} {str(value).upper():<5}\n" for name, value in rows.items())
    return f"F Number: F12345\nDATE:     26-NOV-26 09:30 \n\nSTOP SIGNALS::\n\n{lines}"


def registers(**values):
    """Return NUMREG.VA with registers by number, as R1="12"."""
    lines = "".join(f"  [{name[1:]}] = {value}  'Some name' \n" for name, value in values.items())
    return (
        f"[*NUMREG*]$NUMREG  Storage: SHADOW  Access: RW  : ARRAY[200] OF Numeric Reg\n{lines}"
        "[*NUMREG*]$MAXREGNUM  Storage: CMOS  Access: RW  : INTEGER = 200\n"
    )


def frames(active, *tools, group=1):
    """Return SYSFRAME.VA with the number of the active tool, and tools of six numbers."""
    rows = "".join(
        f"    [{group},{number}] = \n  Group: {group}   Config: N D B, 0, 0, 0\n"
        f"  X:{x:>10}   Y:{y:>10}   Z:{z:>10}\n  W:{w:>10}   P:{p:>10}   R:{r:>10}\n"
        for number, (x, y, z, w, p, r) in enumerate(tools, start=1)
    )
    kind = "Storage: SHADOW  Access: RW  : ARRAY"
    return (
        f"[*SYSTEM*]$MNUFRAME  {kind}[1,9] OF POSITION\n    [{group},1] = \n\n"
        f"[*SYSTEM*]$MNUTOOL  {kind}[1,10] OF POSITION\n{rows}\n"
        f"[*SYSTEM*]$MNUTOOLNUM  {kind}[1] OF BYTE\n  [{group}] = {active}\n\n"
    )
