"""How `robomesh probe` knows a controller of FANUC."""

import re

from controllers.fanuc.srtp import HEADER_BYTES, Answer, AnswerStream, Connect
from controllers.probing import LONGEST_SHOWN, Asked, Found, Probe, nothing_known
from robomesh.texts import one_line

# The Robot Interface, and the option HMI Device (SNPX).
_PORTS = (60008, 18245)
_RMI_PORT = 16001
_FTP_PORT = 21


def _meaning(heard: bytes) -> Found:
    answers = AnswerStream().receive(heard)
    if not answers or not isinstance(answers[0], Answer) or not answers[0].connected:
        return nothing_known(heard, "the first packet of SNPX")
    return Found(
        protocol="snpx",
        text="it speaks SRTP, as controllers of FANUC (SNPX) and PLCs of GE do",
        next='in the site file: protocol = "snpx", and [robot.fanuc] with j23 and assignments',
    )


def _rmi(heard: bytes) -> Found:
    return Found(
        text="it accepts a connection on the port of FANUC's RMI, to which nothing is ever sent here",
        next="RMI takes one client, and is for motion; robomesh reads SNPX, and moves by RMI if the site "
        f"file says so (docs/controllers/fanuc.md): probe tcp://HOST:{_PORTS[0]}",
    )


def _greeting(heard: bytes) -> Found | None:
    """Return the meaning of an FTP server's greeting; nothing is sent, not even a user's name."""
    if not heard.startswith(b"220"):
        return None
    greeting = heard.decode("latin-1").splitlines()[0][4:]
    shown = one_line(greeting, LONGEST_SHOWN)
    fanuc = re.search(r"FANUC|R-30i|\bROBOT FTP\b|(Handling|Arc|Spot|Paint|Dispense|Pallet)Tool", greeting)
    if fanuc is None:
        return Found(text=f"an FTP server: {shown}", next="nothing says that it is a controller of FANUC")
    return Found(
        protocol="fanuc-ftp",
        text=f"an FTP server, by its greeting of a controller of FANUC: {shown}",
        next=f"if tcp://HOST:{_PORTS[0]} does not answer (SNPX), in the site file: "
        'protocol = "fanuc-ftp", and [robot.fanuc] with j23; it is slow',
    )


SNPX = Probe(
    ports=_PORTS,
    listens=(_RMI_PORT,),
    asks=Asked(
        sent="the first packet of SNPX, 56 zero bytes, which asks for nothing",
        question=Connect().encode(0),
        enough=lambda heard: len(heard) >= HEADER_BYTES,
        meaning=_meaning,
    ),
    sends=f"the first packet of SNPX, 56 zero bytes, to ports {' and '.join(map(str, _PORTS))}",
    heard=_rmi,
)
FTP = Probe(
    listens=(_FTP_PORT,),
    knows=lambda heard: heard.startswith(b"220 ") and heard.endswith(b"\n"),
    heard=_greeting,
)
