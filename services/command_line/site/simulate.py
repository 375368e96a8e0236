"""`robomesh simulate`: its options are those of robomesh's own kinds, and of the package that it names."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer
from typer.core import TyperCommand
from typer.main import get_command

from controllers.simulated.fault_table import FAULTS
from protocol_gateway.configuration.kinds import is_known, kind_of, own_kinds, part_of, protocols
from protocol_gateway.seam.errors import GatewaySettingsError
from protocol_gateway.seam.simulated import Common, Option, Simulated
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.keys import check_name
from robomesh.service import service
from services.command_line.service_settings.controllers import ControllerError
from services.command_line.site.launch import session_settings
from services.command_line.terminal.connection_options import offer_keys
from services.command_line.terminal.options import Connect, SiteFile, command_group
from services.command_line.terminal.output import print_line
from services.site_file import site as site_file

if TYPE_CHECKING:
    from controllers.simulated.fault_requests import Mesh


def _own() -> Mapping[str, Simulated]:
    """Return robomesh's own simulated controllers by protocol."""
    found = {protocol: part_of(protocol, "simulated", Simulated) for protocol in own_kinds()}
    return {protocol: each for protocol, each in found.items() if each is not None}


def _controller(protocol: str) -> Simulated:
    """Return the simulated controller of a protocol.

    Raises:
        ControllerError: If it has none.
    """
    if (found := part_of(protocol, "simulated", Simulated)) is None:
        raise ControllerError(f"--protocol {protocol}: this protocol has no simulated controller")
    return found


class _OfPackage(TyperCommand):
    """The command, with the options of a package's simulated controller if the arguments name it."""

    def make_context(self, info_name: str | None, args: list[str], *given: Any, **named: Any) -> Any:
        protocol = _protocol(args)
        if protocol in own_kinds() or not is_known(protocol):
            return super().make_context(info_name, args, *given, **named)
        # The package's is first, because an option of several kinds is that of the first one.
        simulated = _controller(protocol)
        try:
            command: Any = get_command(_app(TyperCommand, {protocol: simulated, **_own()}))
        except Exception as error:
            raise GatewaySettingsError(
                f"protocol {protocol!r}: the options of its simulated controller, of the package "
                f"{kind_of(protocol).distribution}, cannot be used: {error}"
            ) from error
        for each in command.params:
            if each.name in ("robot", "listen"):
                each.show_default = getattr(simulated, each.name)
        return offer_keys(command).make_context(info_name, args, *given, **named)


def _protocol(arguments: Sequence[str]) -> str:
    """Return the last protocol that arguments name; without one the first of robomesh's own."""
    found = _FIRST
    for word, following in zip(arguments, (*arguments[1:], ""), strict=True):
        option, _, value = word.partition("=")
        if option == "--protocol":
            found = value or following
    return found


def _app(command: type[TyperCommand], simulated: Mapping[str, Simulated]) -> typer.Typer:
    """Return an app of `simulate` with the options of simulated controllers."""
    found = command_group()
    found.command(cls=command)(_with_options(simulate, simulated))
    return found


def _with_options(command: Callable[..., None], controllers: Mapping[str, Simulated]) -> Callable[..., None]:
    """Give a command the options of simulated controllers; the help of each names its protocols."""
    parameters: dict[str, tuple[inspect.Parameter, list[str]]] = {}
    for protocol, simulated in controllers.items():
        for each in _own_options(simulated):
            parameters.setdefault(each.name, (each, []))[1].append(protocol)
    common = [
        each
        for each in inspect.signature(command).parameters.values()
        if each.kind is not inspect.Parameter.VAR_KEYWORD
    ]
    every = [*common, *(_option(*each) for each in parameters.values())]

    @wraps(command)
    def with_options(**given: Any) -> None:
        command(**given)

    signature = inspect.Signature([each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in every])
    with_options.__signature__ = signature  # type: ignore[attr-defined]
    with_options.__annotations__ = {each.name: each.annotation for each in every}
    return with_options


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


_FIRST = next(iter(_own()))
_ADDRESSES = ", ".join(f"{name}: {each.listen}" for name, each in _own().items())
_OF_PACKAGES = ", ".join(each for each in protocols() if each not in own_kinds())


def simulate(
    protocol: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="; ".join(f"{name}: {each.text}" for name, each in _own().items())
            + (f"; of packages, each with options of its own: {_OF_PACKAGES}." if _OF_PACKAGES else "."),
            autocompletion=lambda: list(protocols()),
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
    simulated = _controller(protocol)
    common = Common(
        robot=robot or simulated.robot,
        listen=listen or simulated.listen,
        demo=demo,
        faults=tuple(fault or ()),
        insecure=insecure,
        mesh=_faults_mesh(for_, site, connect),
    )
    own = {
        each.name: each.default if of_kinds[each.name] is None else of_kinds[each.name]
        for each in _own_options(simulated)
    }
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
        raise ControllerError(f"--for {faults_for}: must be SITE/ROBOT, as in demo/pt600")
    return Mesh(
        site=check_name(site_name, "site"),
        robot=check_name(robot_name, "robot"),
        session=session_settings(site_file.load(site), connect, "simulator"),
    )


app = _app(_OfPackage, _own())
