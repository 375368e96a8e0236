"""The start of the simulated controller."""

from collections.abc import Sequence
from typing import Annotated

from protocol_gateway.seam.simulated import Common, Option, Run, Simulated


def _prepare(
    common: Common,
    *,
    rate: Annotated[float, Option(metavar="HZ", least=1, most=1000)] = 100.0,
    max_clients: Annotated[int, Option(metavar="N", least=1)] = 8,
    code: Annotated[
        Sequence[str], Option(metavar="NUMBER=TYPE", help="A type code of the site file: 2=ABSOLUTE.DEG")
    ] = (),
) -> Run:
    from controllers.unit.simulated.service import Settings, serve

    codes = dict(map(_code, code))
    settings = Settings(**common, rate_hz=rate, max_clients=max_clients, codes=codes)
    return lambda tell: serve(settings, ready=tell)


def _code(text: str) -> tuple[int, str]:
    number, _, meaning = text.partition("=")
    try:
        return int(number), meaning
    except ValueError:
        from controllers.simulated.errors import SimulatorError

        raise SimulatorError(f"--code {text}: must be NUMBER=TYPE, as in 2=ABSOLUTE.DEG") from None


UNIT = Simulated(text="the old text protocol", robot="pt600", listen="127.0.0.1:5400", prepare=_prepare)
