"""A kind's simulated controller, as `robomesh simulate` and `robomesh up` start it."""

from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Any, TypedDict

from protocol_gateway.seam.table import Table


class Common(TypedDict):
    """The settings that all simulated controllers have.

    Attributes:
        robot: A library robot or a description.
        listen: HOST:PORT.
        mesh: Where to answer fault requests; None: nowhere.
    """

    robot: str
    listen: str
    demo: bool
    faults: tuple[str, ...]
    insecure: bool
    mesh: Any


@dataclass(frozen=True, kw_only=True)
class Option:
    """An option of `robomesh simulate`: annotation of a parameter of `Simulated.prepare`.

    Attributes:
        default: Its default in words.
        least, most: Bounds of a number.
    """

    metavar: str
    help: str = ""
    default: str = ""
    least: float | None = None
    most: float | None = None


@dataclass(frozen=True)
class Started:
    """How `robomesh up` starts a simulated controller.

    Attributes:
        options: Words of the command line.
        ports: Ports of its further interfaces, by the names of the driver's channels.
    """

    options: tuple[str, ...] = ()
    ports: tuple[tuple[str, int], ...] = ()


Run = Callable[[Callable[[str], None]], Coroutine[Any, Any, None]]
"""Runs a controller; calls the function with the line that says where it listens."""


def as_declared(table: Table | None, free_port: Callable[[], int]) -> Started:
    """Start it without options."""
    return Started()


@dataclass(frozen=True, kw_only=True)
class Simulated:
    """A simulated controller.

    Attributes:
        text: What it speaks, for `--protocol`.
        robot, listen: Unless they are given.
        prepare: Returns its run, for the common settings and its own options, which are its parameters.
        started: Returns how to start it for a robot with a table.
    """

    text: str
    robot: str = "puma560"
    listen: str
    prepare: Callable[..., Run]
    started: Callable[[Table | None, Callable[[], int]], Started] = as_declared


def options_of(table: Table | None, option: str) -> tuple[str, ...]:
    """Return an option with what a table declares, as JSON; empty: it has defaults only."""
    declared = "{}" if table is None else table.model_dump_json(exclude_defaults=True)
    return () if declared == "{}" else (option, declared)
