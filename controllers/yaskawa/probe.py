"""How `robomesh probe` knows a controller of Yaskawa."""

from controllers.probing import Asked, Found, Probe
from controllers.yaskawa import data, hses

_PORT = 10040


def _meaning(datagram: bytes) -> Found:
    try:
        answer = hses.decode(datagram)
        system = None if answer.status else data.system(answer.data)
    except ValueError as error:
        return Found(text=f"it answers, but not in HSES: {error}")
    if system is None:
        known = f", which refuses the question: {answer.error}"
    else:
        known = f": model {system.model or 'unknown'}, software {system.software or 'unknown'}"
    return Found(
        protocol="hses",
        text=f"a controller of Yaskawa with HSES{known}",
        next='in the site file: protocol = "hses", and [robot.yaskawa] with the pulses of each joint',
    )


HSES = Probe(
    scheme="udp",
    ports=(_PORT,),
    asks=Asked(
        sent="a read of the system's information (0x89)",
        question=hses.Read(hses.Command.SYSTEM, 11).encode(1),
        enough=bool,
        meaning=_meaning,
    ),
    sends=f"a read of the system's information to UDP port {_PORT}, where it does not listen first",
)
