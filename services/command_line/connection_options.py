"""How a command attaches to the mesh: `--connect`, and `--keys` beside it wherever that is taken."""

from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.main import get_command

from robomesh.certificate_identity import Identity, read_identity
from robomesh.endpoints import DEFAULT_ROUTER, bundle
from robomesh.errors import SessionError

if TYPE_CHECKING:
    from robomesh.session import SessionSettings

_KEYS: ContextVar[Path | None] = ContextVar("keys", default=None)


def offer_keys(command: Any) -> Any:
    """A command or group, with `--keys FILE` wherever there is `--connect`."""
    for each in getattr(command, "commands", {}).values():
        offer_keys(each)
    if any(parameter.name == "connect" for parameter in command.params):
        command.params.append(_option())
    return command


def _option() -> Any:
    """The option, as typer makes it of a command that has no other."""
    app = typer.Typer(add_completion=False)

    @app.command()
    def only(
        keys: Annotated[
            Path | None,
            typer.Option(
                metavar="FILE",
                envvar="ROBOMESH_KEYS",
                help="A bundle of robomesh keys: who asks, by certificate.",
                expose_value=False,
                callback=_keep,
            ),
        ] = None,
    ) -> None: ...

    command: Any = get_command(app)
    return next(parameter for parameter in command.params if parameter.name == "keys")


def _keep(value: Path | None) -> Path | None:
    _KEYS.set(value)
    return value


def own_identity() -> Identity | None:
    """Who asks, by the certificate that was given; None: nobody said.

    Raises:
        SessionError: If the file cannot be read, or is no bundle.
    """
    file = _KEYS.get()
    if file is None:
        return None
    identity = read_identity(file)
    if identity is None:
        raise SessionError(f"--keys {file}: it does not say whose it is: robomesh keys issue writes a bundle")
    return identity


def addresses(connect: str) -> tuple[str, ...]:
    """The routers that `--connect` names."""
    return tuple(part for each in connect.split(",") if (part := each.strip()))


def with_keys(connect: str, *, wait_s: float | None = None) -> "SessionSettings | None":
    """A session in the name of the certificate that was given; None: none was.

    Raises:
        SessionError: If the file is no bundle, or no router takes it there.
    """
    from robomesh.session import SessionSettings

    identity, file = own_identity(), _KEYS.get()
    if identity is None or file is None:
        return None
    routers = addresses(connect)
    if routers == (DEFAULT_ROUTER,):
        routers = identity.routers or (DEFAULT_ROUTER.replace("tcp/", "tls/"),)
    for each in routers:
        if not each.startswith(("tls/", "quic/")):
            raise SessionError(f"--connect {each}: with --keys a router is reached by TLS: tls/HOST:PORT")
    return SessionSettings(connect=routers, tls=bundle(file), wait_s=wait_s)


def attachment(connect: str, *, wait_s: float | None = None) -> "SessionSettings":
    """A session for one command, in the name of its certificate where one was given."""
    from robomesh.session import SessionSettings

    return with_keys(connect, wait_s=wait_s) or SessionSettings(connect=addresses(connect), wait_s=wait_s)
