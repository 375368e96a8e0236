"""A command's connection to the mesh: `--connect`, and `--keys` wherever `--connect` is."""

from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.main import get_command

if TYPE_CHECKING:
    from robomesh.contract.certificate_identity import Identity
    from robomesh.wire.session import SessionSettings

_KEYS: ContextVar[Path | None] = ContextVar("keys", default=None)


def offer_keys(command: Any) -> Any:
    """Add `--keys FILE` to a command, or to the commands of a group, wherever there is `--connect`."""
    for each in getattr(command, "commands", {}).values():
        offer_keys(each)
    if any(parameter.name == "connect" for parameter in command.params):
        command.params.append(_option())
    return command


def _option() -> Any:
    """Return the option `--keys`, taken from a command that Typer makes with it alone."""
    app = typer.Typer(add_completion=False)

    @app.command()
    def only(
        keys: Annotated[
            Path | None,
            typer.Option(
                metavar="FILE",
                envvar="ROBOMESH_KEYS",
                help="Your bundle from robomesh keys: certificate and key.",
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


def own_identity() -> "Identity | None":
    """Return the identity in the certificate of `--keys`; None: no `--keys`.

    Raises:
        SessionError: If the file cannot be read, or is not a bundle.
    """
    from robomesh.client import connection

    return connection.own_identity(_KEYS.get())


def with_keys(connect: str, *, wait_s: float | None = None) -> "SessionSettings | None":
    """Return session settings with the certificate of `--keys`; None: no `--keys`.

    Raises:
        SessionError: If the file is not a bundle, or a router is not reached by TLS.
    """
    return None if _KEYS.get() is None else attachment(connect, wait_s=wait_s)


def attachment(connect: str, *, wait_s: float | None = None) -> "SessionSettings":
    """Return session settings for one command, with the certificate of `--keys` if given.

    Raises:
        SessionError: If the file is not a bundle, or a router is not reached by TLS.
    """
    from robomesh.client.connection import connection_settings

    return connection_settings(connect, _KEYS.get(), wait_s=wait_s)
