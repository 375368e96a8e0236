"""How `robomesh probe` knows a controller of Universal Robots."""

from controllers.probing import MOST_BYTES, Asked, Found, Probe, nothing_known
from controllers.universal_robots.interfaces.packages import Package
from controllers.universal_robots.interfaces.rtde_messages import (
    ProtocolVersionAnswered,
    RtdeStream,
    request_protocol_version,
)

_PORT = 30004
# The last three send the same, and take nothing.
_PRIMARY_PORTS = (30001, 30002, 30003, 30011, 30012, 30013)


def _heard(heard: bytes) -> Found:
    packages = _packages(heard)
    if packages:
        return Found(
            text=f"it sends {packages} packages of Universal Robots' primary or secondary interface",
            next=f"robomesh reads RTDE: probe tcp://HOST:{_PORT}",
        )
    return Found(text="it accepts a connection and sends no package of Universal Robots")


def _packages(heard: bytes) -> int:
    """Return the number of whole packages of Universal Robots' primary interface at the begin."""
    count, at = 0, 0
    while len(heard) - at >= 5:
        length, kind = int.from_bytes(heard[at : at + 4], "big"), heard[at + 4]
        # 16: the robot's state, 20: a message, 25: a handover, 5: a program state.
        if not 5 <= length <= MOST_BYTES or kind not in (5, 16, 20, 25):
            return 0
        if at + length > len(heard):
            break
        count, at = count + 1, at + length
    return count


def _answered(heard: bytes) -> ProtocolVersionAnswered | None:
    stream = RtdeStream()
    found = (stream.decode(each) for each in stream.receive(heard) if isinstance(each, Package))
    return next((each for each in found if isinstance(each, ProtocolVersionAnswered)), None)


def _meaning(heard: bytes) -> Found:
    answer = _answered(heard)
    if answer is None:
        return nothing_known(heard, "a request for RTDE")
    version = "version 2" if answer.accepted else "version 1 only"
    return Found(
        protocol="rtde",
        text=f"a controller of Universal Robots: RTDE, {version}",
        next='in the site file: protocol = "rtde", and a model of its six joints',
    )


RTDE = Probe(
    ports=(_PORT,),
    listens=_PRIMARY_PORTS,
    asks=Asked(
        sent="the request for RTDE version 2",
        question=request_protocol_version(2),
        enough=lambda heard: _answered(heard) is not None,
        meaning=_meaning,
    ),
    sends=f"the RTDE version to port {_PORT}",
    heard=_heard,
)
