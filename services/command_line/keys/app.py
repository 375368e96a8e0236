"""`robomesh keys`: a site's certificate authority, and who may do what."""

import json
from datetime import timedelta
from pathlib import Path
from typing import Annotated, Any

import typer

from robomesh.topic_schema import Role
from robots.bounded_toml import read_toml
from services.command_line.keys.folder import KeysFolder, keys_folder
from services.command_line.options import Json

keys_app = typer.Typer(
    help="Certificates of a site: who may take part, and as what.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

_Days = Annotated[float, typer.Option(metavar="N", min=0.0001, max=365, help="How long it is good for.")]
_SECTION = '\n[keys]\nfolder = "keys"\n'


@keys_app.command()
def init(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml", help="The site file.")],
) -> None:
    """Make the site's authority, a certificate for each of its services, and the routers' rules.

    Again after the site file's robots, addresses or border changed: what is there stays.
    """
    from services.pki import Folder, authority
    from services.pki.errors import KeysError
    from services.site_file import site as site_file
    from services.site_file.router import public
    from services.site_file.started_robots import may_start

    read = site_file.load(site)
    if read.keys.folder is None:
        if "keys" in read_toml(site):
            raise KeysError(f'{site}: [keys] has no folder: write folder = "keys" below it')
        # Appended: whoever wrote the file finds it as it was.
        with site.open("a", encoding="utf-8") as file:
            file.write(_SECTION)
        read = site_file.load(site)
        print(f'{site}: [keys] folder = "keys" is written into it: its services meet by TLS from now on')
    assert read.keys.folder is not None
    folder = Folder(read.keys.folder)
    made = authority.prepare(
        folder,
        read.site,
        robots=[robot.name for robot in read.robot],
        border=read.router.border,
        routers=public(read.router, read.keys),
        started=may_start(read),
    )
    print(f"{folder.path}: {len(made)} new certificates" + (f": {', '.join(made)}" if made else ""))
    print(
        f"{folder.authority_key} signs: routers and services do not need it, so it may be kept elsewhere "
        "until something is issued or renewed"
    )


@keys_app.command()
def issue(
    name: Annotated[
        str, typer.Argument(metavar="[NAME]", help="Unique at the site; an operator's own.")
    ] = "",
    role: Annotated[str, typer.Option(metavar="ROLE", help=", ".join(role.value for role in Role))] = "",
    robots: Annotated[str, typer.Option(metavar="A,B", help="A gateway's.")] = "",
    guest: Annotated[str, typer.Option(metavar="SITE", help="Let another site's router in.")] = "",
    sites: Annotated[
        str, typer.Option(metavar="A,B", help="A guest's: for whom it speaks; '*': all but ours (a hub).")
    ] = "",
    days: _Days = 30.0,
    folder: KeysFolder = None,
    as_json: Json = False,
) -> None:
    """Issue a certificate, as one file with its key, to hand over."""
    from services.pki import authority

    where, lives = keys_folder(folder, quiet=as_json), timedelta(days=days)
    before, rules = (
        authority.principals_of(where),
        where.access.read_bytes() if where.access.is_file() else b"",
    )
    if guest:
        _only(not name and not role and not robots, "--guest goes alone, with --sites where it is a hub")
        entry = authority.issue_guest(where, guest, sites=_listed(sites), lives=lives)
    else:
        _only(
            bool(name and role), "a name and --role are needed, as in: robomesh keys issue li --role operator"
        )
        _only(not sites, "--sites is for --guest")
        entry = authority.issue(where, name, _role(role), robots=_listed(robots) or None, lives=lives)
    file = authority.file_of(where, authority.principals_of(where).site, entry)
    if as_json:
        _print(_record(entry) | {"file": file})
        return
    print(f"{file}: {entry.name}, {entry.role.value}, until {entry.expires:%Y-%m-%d %H:%M} UTC")
    had = before.find(entry.name)
    if had is not None and had.revoked is None and had.expires is not None and had.expires > authority.now():
        print(
            f"{entry.name} had a certificate already, good until {had.expires:%Y-%m-%d %H:%M}: now both are. "
            f"robomesh keys renew {entry.name} makes one for as long as before; keys revoke ends all."
        )
    use = f"robomesh keys accept {Path(file).name}, at {guest}," if guest else f"robomesh list --keys {file}"
    print(f"Hand it over as a secret; {use} uses it.")
    if where.access.read_bytes() != rules:
        print(
            "The routers follow at once: whoever moves a robot now by a lease sees it stop, unless the site "
            "has two routers."
        )


@keys_app.command()
def accept(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="From another site's keys issue --guest.")],
    sites: Annotated[
        str, typer.Option(metavar="A,B", help="For whom its router speaks; '*': all but ours (a hub).")
    ] = "",
    folder: KeysFolder = None,
) -> None:
    """Take what lets our routers in at another site."""
    from services.pki import authority
    from services.pki.errors import KeysError
    from services.pki.folder import read

    try:
        site = authority.accept(keys_folder(folder), read(file), sites=_listed(sites))
    except KeysError as error:
        raise KeysError(f"{file}: {error}" if str(file) not in str(error) else str(error)) from None
    print(f'site {site} lets us in: connect = ["{site}"] under [router] in the site file links to it')


@keys_app.command()
def renew(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]...")] = None,
    all_: Annotated[
        bool, typer.Option("--all", help="People's and guests' too, and whenever it expires.")
    ] = False,
    folder: KeysFolder = None,
    as_json: Json = False,
) -> None:
    """Issue anew, for as long as before: the services' that expire within ten days, those named, or all."""
    from services.pki.renewals import renew as renew_

    renewed = renew_(keys_folder(folder, quiet=as_json), names or (), all_=all_)
    if as_json:
        for entry in renewed:
            _print(_record(entry))
        return
    for entry in renewed:
        print(f"{entry.name}: until {entry.expires:%Y-%m-%d %H:%M} UTC")
    print(
        f"{len(renewed)} renewed"
        if renewed
        else "no service's expires within ten days; people's and guests' are renewed by name"
    )


@keys_app.command()
def revoke(name: str, folder: KeysFolder = None) -> None:
    """Take somebody off the routers' list: whoever is on the mesh in that name is cut off.

    Nobody gets the name again while a certificate of it is good.
    """
    from services.pki import authority

    entry = authority.revoke(keys_folder(folder), name)
    print(
        f"{entry.name} has no rights any more: the site's router drops it now; where there are two, each does"
    )
    print("when it has this folder's access.json5, and the second up to 12 s after the first.")


@keys_app.command("list")
def list_(folder: KeysFolder = None, as_json: Json = False) -> None:
    """Who has a certificate, as what, until when."""
    from services.pki import authority
    from services.pki.renewals import RENEW_WITHIN

    principals = authority.principals_of(keys_folder(folder, quiet=as_json))
    for entry in principals.entries:
        if as_json:
            _print(_record(entry))
            continue
        until = "by its own site" if entry.expires is None else f"until {entry.expires:%Y-%m-%d %H:%M}"
        now = authority.now()
        if entry.revoked is not None:
            until = f"revoked {entry.revoked:%Y-%m-%d %H:%M}"
        elif entry.expires is not None and entry.expires <= now:
            until = f"EXPIRED {entry.expires:%Y-%m-%d %H:%M}"
        elif entry.expires is not None and entry.expires <= now + RENEW_WITHIN:
            until += ", to be renewed"
        what = f"{entry.role.value:<11}{until}"
        for_ = ", ".join(entry.sites or entry.robots or ())
        print(f"{entry.name:<28}{what}" + (f"   {for_}" if for_ else ""))


def _record(entry: Any) -> dict[str, Any]:
    record: dict[str, Any] = entry.model_dump(mode="json")
    return record


def _print(record: dict[str, Any]) -> None:
    print(json.dumps(record, ensure_ascii=False), flush=True)


def _listed(text: str) -> tuple[str, ...]:
    return tuple(part for each in text.split(",") if (part := each.strip()))


def _role(text: str) -> Role:
    from services.pki.errors import KeysError

    try:
        return Role(text)
    except ValueError:
        raise KeysError(f"--role {text}: there are {', '.join(role.value for role in Role)}") from None


def _only(right: bool, text: str) -> None:
    from services.pki.errors import KeysError

    if not right:
        raise KeysError(text)
