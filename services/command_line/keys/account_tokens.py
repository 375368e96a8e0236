"""`robomesh accounts tokens`: addresses that show one view of one robot without a sign-in."""

from datetime import UTC, datetime, timedelta
from typing import Annotated

import typer

from services.command_line.keys.accounts_file import Where, accounts_file
from services.command_line.terminal.options import Json, command_group
from services.command_line.terminal.output import print_json, print_line
from services.console.accounts.file import read_accounts
from services.console.accounts.view_access import add_token, revoke_token
from services.console.accounts.view_token import ViewToken
from services.console.common.errors import AccountsError

app = command_group("tokens", "Addresses that show one view of one robot without a sign-in.")

_Name = Annotated[str, typer.Argument(metavar="NAME", help="The token's name: who or what uses it.")]


@app.command()
def add(
    where: Where,
    name: _Name,
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="robot of the site, or site/robot")],
    view: Annotated[str, typer.Argument(metavar="VIEW", help="front, top, ...")],
    days: Annotated[int, typer.Option(min=0, max=36500, help="Days until it expires; 0: never.")] = 0,
    as_json: Json = False,
) -> None:
    """Add a token and print its addresses, once: only its hash is kept."""
    path, site = accounts_file(where)
    if "/" not in robot:
        if not site:
            raise AccountsError(f"{where} names no site: write SITE/{robot}, or name a site file")
        robot = f"{site}/{robot}"
    token = add_token(path, name, robot, view, lasts=timedelta(days=days) if days else None)
    endings = {"page": f"/view/{robot}/{view}"}
    endings |= {kind: f"/video/{robot}/{view}.{kind}" for kind in ("mjpeg", "mp4")}
    endings |= {kind: f"/image/{robot}/{view}.{kind}" for kind in ("jpg", "png")}
    if as_json:
        added = _row(read_accounts(path).tokens[name])
        print_json(added | {"token": token, "addresses": endings})
        return
    print_line(f"{path}: token {name} opens the view {view} of {robot}. Its addresses, at the console's own:")
    for ending in endings.values():
        print_line(f"{ending}?token={token}")


@app.command("list")
def list_(where: Where, as_json: Json = False) -> None:
    """List the tokens: what each opens, since when, until when."""
    path, _ = accounts_file(where)
    for token in read_accounts(path).tokens.values():
        if as_json:
            print_json(_row(token))
        else:
            opens = f"{token.robot}/{token.view}"
            print_line(f"{token.name:<32}  {opens:<32}  since {token.created:%Y-%m-%d}{_end(token)}")


@app.command()
def revoke(where: Where, name: _Name) -> None:
    """Revoke a token; what it shows ends within a second."""
    path, _ = accounts_file(where)
    revoke_token(path, name)
    print_line(f"{path}: token {name} is revoked")


def _end(token: ViewToken) -> str:
    if token.revoked is not None:
        return f"  revoked {token.revoked:%Y-%m-%d}"
    if token.expires is None:
        return ""
    word = "expired" if token.ended(datetime.now(UTC)) else "until"
    return f"  {word} {token.expires:%Y-%m-%d}"


def _row(token: ViewToken) -> dict[str, str | None]:
    times = {"created": token.created, "expires": token.expires, "revoked": token.revoked}
    return {
        "name": token.name,
        "robot": token.robot,
        "view": token.view,
        **{name: None if time is None else time.isoformat() for name, time in times.items()},
    }
