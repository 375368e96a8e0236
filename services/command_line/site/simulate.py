"""`robomesh simulate`: its options are those of all kinds of controllers."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from controllers.simulated.fault_table import FAULTS
from protocol_gateway.kinds import own_kinds
from protocol_gateway.seam.simulated import Common, Option, Simulated
from robomesh import service
from robomesh.endpoints import DEFAULT_ROUTER
from robomesh.keys import check_name
from services.command_line.options import Connect, SiteFile, command_group
from services.command_line.output import print_line
from services.command_line.site.controllers import ControllerError
from services.command_line.site.launch import session_settings
from services.site_file import site as site_file

if TYPE_CHECKING:
    from controllers.simulated.fault_requests import Mesh

app = command_group()


@cache
def simulated_controllers() -> Mapping[str, Simulated]:
    """Return the simulated controllers by protocol."""
    return {
        name: found for name, kind in own_kinds().items() if (found := kind.simulated_controller) is not None
    }


def _with_options_of_kinds(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of all kinds, each with the protocols that have it in its help."""
    parameters: dict[str, tuple[inspect.Parameter, list[str]]] = {}
    for protocol, simulated in simulated_controllers().items():
        for each in _own_options(simulated):
            parameters.setdefault(each.name, (each, []))[1].append(protocol)
    common = [
        each
        for each in inspect.signature(command).parameters.values()
        if each.kind is not inspect.Parameter.VAR_KEYWORD
    ]
    every = [*common, *(_option(*each) for each in parameters.values())]
    signature = inspect.Signature([each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in every])
    command.__signature__ = signature  # type: ignore[attr-defined]
    command.__annotations__ = {each.name: each.annotation for each in every}
    return command


def _own_options(simulated: Simulated) -> Sequence[inspect.Parameter]:
    parameters = inspect.signature(simulated.prepare).parameters.values()
    return [each for each in parameters if each.kind is inspect.Parameter.KEYWORD_ONLY]


def _option(parameter: inspect.Parameter, protocols: list[str]) -> inspect.Parameter:
    kind, option = get_args(parameter.annotation)
    assert isinstance(option, Option)
    repeated = kind == Sequence[str]  # two aliases are equal, not the same
    of = f"with {' and '.join(protocols)}."
    typed = typer.Option(
        metavar=option.metavar,
        help=f"{option.help}; {of}" if option.help else of.capitalize(),
        show_default=option.default or True,
        min=option.least,
        max=option.most,
    )
    return parameter.replace(
        annotation=Annotated[list[str] | None if repeated else kind, typed],
        default=None if repeated else parameter.default,
    )


_Protocol: Any = StrEnum("_Protocol", [(name, name) for name in simulated_controllers()])  # type: ignore[misc]
_FIRST = next(iter(_Protocol))
_ADDRESSES = ", ".join(f"{name}: {each.listen}" for name, each in simulated_controllers().items())


@app.command()
@_with_options_of_kinds
def simulate(
    protocol: Annotated[
        _Protocol,
        typer.Option(
            help="; ".join(f"{name}: {each.text}" for name, each in simulated_controllers().items()) + ".",
        ),
    ] = _FIRST,
    robot: Annotated[
        str,
        typer.Option(
            metavar="R",
            help="A library robot or a description.",
            show_default="pt600; with the other protocols puma560",
        ),
    ] = "",
    listen: Annotated[
        str,
        typer.Option(
            metavar="HOST:PORT",
            show_default=_ADDRESSES,
        ),
    ] = "",
    demo: Annotated[bool, typer.Option(help="Move until the first command.")] = False,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[@BEGIN][+LENGTH]",
            help=f"A fault, BEGIN seconds after the first client connects: {', '.join(FAULTS)}.",
        ),
    ] = None,
    insecure: Annotated[bool, typer.Option(help="Listen beyond loopback without protection.")] = False,
    for_: Annotated[
        str,
        typer.Option("--for", metavar="SITE/ROBOT", help="Accept `robomesh fault` for this robot."),
    ] = "",
    site: SiteFile = None,
    connect: Connect = DEFAULT_ROUTER,
    **of_kinds: Any,
) -> None:
    """Run a simulated controller of any kind that a site file's `protocol` can name."""
    service.log_to_stderr()
    simulated = simulated_controllers()[protocol]
    common = Common(
        robot=robot or simulated.robot,
        listen=listen or simulated.listen,
        demo=demo,
        faults=tuple(fault or ()),
        insecure=insecure,
        mesh=_faults_mesh(for_, site, connect),
    )
    own = {each.name: of_kinds[each.name] or each.default for each in _own_options(simulated)}
    service.run_until_signalled(simulated.prepare(common, **own)(print_line))


def _faults_mesh(faults_for: str, site: Path | None, connect: str) -> "Mesh | None":
    """Return where a simulated controller answers fault requests; None: nowhere.

    Args:
        faults_for: SITE/ROBOT that accepts fault requests on the mesh, with the site file's certificates;
            empty: none.

    Raises:
        ControllerError: If it is not SITE/ROBOT.
    """
    from controllers.simulated.fault_requests import Mesh

    if not faults_for:
        return None
    site_name, slash, robot_name = faults_for.partition("/")
    if not slash:
        raise ControllerError(f"--for {faults_for}: SITE/ROBOT is right, as in demo/pt600")
    return Mesh(
        site=check_name(site_name, "site"),
        robot=check_name(robot_name, "robot"),
        session=session_settings(site_file.load(site), connect, "simulator"),
    )
