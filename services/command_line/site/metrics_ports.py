"""`robomesh up --metrics`: every process of a site serves Prometheus, on consecutive ports."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from functools import partial

from services.errors import ListenError
from services.supervisor import ExtraPrograms, Program

_MOST = 65535


def with_metrics(programs: Sequence[Program], listen: tuple[str, int] | None) -> tuple[Program, ...]:
    """Return the programs with `--metrics`, the first service on the given port, the others on the next ones.

    A simulated controller serves none. Each service logs its address.

    Args:
        listen: Host and first port; port 0: each takes a free port. None: no metrics.

    Raises:
        ListenError: If there are not enough ports.
    """
    if listen is None:
        return tuple(programs)
    host, first = listen
    services = [program for program in programs if program.arguments[0] != "simulate"]
    if first and first + len(services) - 1 > _MOST:
        raise ListenError(
            f"--metrics {host}:{first}: {len(services)} services take a port each from there: "
            f"at most {_MOST - len(services) + 1} is right"
        )
    shown = f"[{host}]" if ":" in host else host
    at = {each.name: f"{shown}:{first + number if first else 0}" for number, each in enumerate(services)}
    return tuple(
        replace(program, arguments=(*program.arguments, "--metrics", at[program.name]))
        if program.name in at
        else program
        for program in programs
    )


def extra_with_metrics(extra: ExtraPrograms, listen: tuple[str, int] | None) -> ExtraPrograms:
    """Return `extra` with metrics on free ports: the number of programs is not known beforehand."""
    if listen is None:
        return extra
    free = (listen[0], 0)

    def started(make: Callable[[], Sequence[Program]]) -> tuple[Program, ...]:
        return with_metrics(make(), free)

    def wanted() -> dict[Hashable, Callable[[], Sequence[Program]]]:
        return {key: partial(started, make) for key, make in extra().items()}

    return wanted
