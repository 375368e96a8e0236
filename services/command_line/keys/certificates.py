"""`robomesh keys`: a site's certificate authority, and who may do what.

A command imports the authority when it runs: only what changes keys needs the package `cryptography`.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from protocol_gateway.configuration.kinds import own_kinds
from protocol_gateway.seam.kind import Kind, named
from robomesh.contract.topic_schema import Role
from robomesh.texts import split_commas
from robots.schema.bounded_toml import read_toml
from services.command_line.terminal.local_time import time_text
from services.command_line.terminal.options import Json, command_group
from services.command_line.terminal.output import print_json, print_line
from services.pki.errors import KeysError
from services.pki.folder import Folder

app = command_group("keys", "A site's certificates: who may take part, in which role.")

KeysFolder = Annotated[
    Path | None,
    typer.Option(
        "--folder",
        metavar="DIR",
        help="The site's keys; else the folder of a site file here, ./keys, or the folder of ROBOMESH_KEYS.",
    ),
]
_Days = Annotated[float, typer.Option(metavar="N", min=0.0001, max=365, help="Validity.")]
_SECTION = '\n[keys]\nfolder = "keys"\n'


@app.command()
def init(
    site: Annotated[Path, typer.Argument(metavar="SITE.toml", help="The site file.")],
) -> None:
    """Create the site's authority, a certificate for each service, and the routers' rules.

    Run it again when the site file's robots, addresses or border change: existing keys stay.
    """
    from services.pki import site_keys
    from services.site_file import site as site_file
    from services.site_file.started_robots import may_start
    from services.site_file.tables.router import public

    read = site_file.load(site)
    if read.keys.folder is None:
        if "keys" in read_toml(site):
            raise KeysError(f'{site}: [keys] has no folder: write folder = "keys" below it')
        # Append, so that the rest of the file stays as its author wrote it.
        with site.open("a", encoding="utf-8") as file:
            file.write(_SECTION)
        read = site_file.load(site)
        print_line(f'{site}: [keys] folder = "keys" is added: its services connect by TLS from now on')
    assert read.keys.folder is not None
    folder = Folder(read.keys.folder)
    made = site_keys.prepare(
        folder,
        read.site,
        robots=[robot.name for robot in read.robot],
        border=read.router.border,
        routers=public(read.router, read.keys),
        started=may_start(read),
    )
    print_line(f"{folder.path}: {len(made)} new certificates" + (f": {', '.join(made)}" if made else ""))
    print_line(
        f"{folder.authority_key} signs: routers and services do not need it, so it may be kept elsewhere "
        "until something is issued or renewed"
    )


@app.command()
def issue(
    name: Annotated[
        str, typer.Argument(metavar="[NAME]", help="Unique at the site, such as an operator's name.")
    ] = "",
    role: Annotated[str, typer.Option(metavar="ROLE", help=", ".join(role.value for role in Role))] = "",
    robots: Annotated[str, typer.Option(metavar="A,B", help="Robots of a gateway.")] = "",
    guest: Annotated[str, typer.Option(metavar="SITE", help="Admit another site's router.")] = "",
    sites: Annotated[
        str, typer.Option(metavar="A,B", help="Sites that a guest speaks for; '*': all but ours (a hub).")
    ] = "",
    days: _Days = 30.0,
    folder: KeysFolder = None,
    as_json: Json = False,
) -> None:
    """Issue a certificate with its key, as one file to hand over."""
    from services.pki import site_keys

    where, lifetime = keys_folder(folder, quiet=as_json), timedelta(days=days)
    before, rules = (
        site_keys.principals_of(where),
        where.access.read_bytes() if where.access.is_file() else b"",
    )
    if guest:
        _require(
            not name and not role and not robots,
            "--guest takes no name, --role or --robots; for a hub add --sites",
        )
        entry = site_keys.issue_guest(where, guest, sites=split_commas(sites), lifetime=lifetime)
    else:
        _require(
            bool(name and role), "a name and --role are needed, as in: robomesh keys issue li --role operator"
        )
        _require(not sites, "--sites is for --guest")
        entry = site_keys.issue(
            where, name, _role(role), robots=split_commas(robots) or None, lifetime=lifetime
        )
    file = site_keys.file_of(where, site_keys.principals_of(where).site, entry)
    if as_json:
        _print(_record(entry) | {"file": file})
        return
    print_line(f"{file}: {entry.name}, {entry.role.value}, until {_when(entry.expires)}")
    earlier = before.find(entry.name)
    if (
        earlier is not None
        and earlier.revoked is None
        and earlier.expires is not None
        and earlier.expires > site_keys.now()
    ):
        print_line(
            f"{entry.name} had a certificate, until {_when(earlier.expires)}; now both are valid. "
            f"robomesh keys renew {entry.name} issues one with the same validity; keys revoke ends all."
        )
    use = f"robomesh keys accept {Path(file).name}, at {guest}," if guest else f"robomesh list --keys {file}"
    print_line(f"Hand it over as a secret; {use} uses it.")
    if where.access.read_bytes() != rules:
        print_line(
            "The routers reload their rules now: a robot that moves under a lease stops, unless the site has "
            "two routers."
        )


@app.command()
def accept(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="From another site's keys issue --guest.")],
    sites: Annotated[
        str, typer.Option(metavar="A,B", help="Sites that its router speaks for; '*': all but ours (a hub).")
    ] = "",
    folder: KeysFolder = None,
) -> None:
    """Accept a certificate that admits our routers at another site."""
    from services.pki import site_keys
    from services.pki.folder import read

    certificate = read(file)
    try:
        site = site_keys.accept(keys_folder(folder), certificate, sites=split_commas(sites))
    except KeysError as error:
        raise KeysError(f"{file}: {error}") from None
    print_line(f'site {site} admits us: connect = ["{site}"] under [router] in the site file links to it')


def _add_command_of(kind: Kind) -> None:
    """Add the command that makes the certificate which a kind of controllers needs."""
    make = cast("Callable[[Path, timedelta], Sequence[str]]", named(kind.certificate))

    def command(
        file: Annotated[Path, typer.Argument(metavar="FILE.pem", help="A new file.")],
        days: Annotated[float, typer.Option(metavar="N", min=1, max=7300, help="Validity.")] = 1825.0,
    ) -> None:
        for line in make(file, timedelta(days=days)):
            print_line(line)

    app.command(kind.key, help=make.__doc__)(command)


for _kind in own_kinds().values():
    if _kind.certificate:
        _add_command_of(_kind)


@app.command()
def renew(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]...")] = None,
    all_: Annotated[bool, typer.Option("--all", help="Every certificate, people's and guests' too.")] = False,
    folder: KeysFolder = None,
    as_json: Json = False,
) -> None:
    """Renew certificates with the same validity: services' that expire within ten days, named, or all."""
    from services.pki.renewals import renew as renew_

    renewed = renew_(keys_folder(folder, quiet=as_json), names or (), all_=all_)
    if as_json:
        for entry in renewed:
            _print(_record(entry))
        return
    for entry in renewed:
        print_line(f"{entry.name}: until {_when(entry.expires)}")
    print_line(
        f"{len(renewed)} renewed"
        if renewed
        else "no service's certificate expires within ten days; renew people's and guests' by name"
    )


@app.command()
def revoke(name: str, folder: KeysFolder = None) -> None:
    """Revoke a certificate: the routers disconnect every session with that name.

    The name cannot be issued again while a certificate for it is valid.
    """
    from services.pki import site_keys

    entry = site_keys.revoke(keys_folder(folder), name)
    print_line(
        f"{entry.name} has no rights any more: the site's router disconnects it now; each of two routers does"
    )
    print_line("when it has this folder's access.json5, the second up to 12 s after the first.")


@app.command("list")
def list_(folder: KeysFolder = None, as_json: Json = False) -> None:
    """List certificates: name, role, expiry."""
    from services.pki import site_keys
    from services.pki.renewals import RENEW_WITHIN

    principals = site_keys.principals_of(keys_folder(folder, quiet=as_json))
    for entry in principals.entries:
        if as_json:
            _print(_record(entry))
            continue
        until = "by its own site" if entry.expires is None else f"until {_when(entry.expires)}"
        now = site_keys.now()
        if entry.revoked is not None:
            until = f"revoked {_when(entry.revoked)}"
        elif entry.expires is not None and entry.expires <= now:
            until = f"EXPIRED {_when(entry.expires)}"
        elif entry.expires is not None and entry.expires <= now + RENEW_WITHIN:
            until += ", renew it"
        what = f"{entry.role.value:<11}{until}"
        for_ = ", ".join(entry.sites or entry.robots or ())
        print_line(f"{entry.name:<28}{what}" + (f"   {for_}" if for_ else ""))


def _record(entry: Any) -> dict[str, Any]:
    record: dict[str, Any] = entry.model_dump(mode="json")
    return record


def _when(at: datetime | None) -> str:
    return "-" if at is None else time_text(at, "minutes")


def _print(record: dict[str, Any]) -> None:
    print_json(record)


def _role(text: str) -> Role:
    try:
        return Role(text)
    except ValueError:
        raise KeysError(f"--role {text}: there are {', '.join(role.value for role in Role)}") from None


def _require(condition: bool, text: str) -> None:
    if not condition:
        raise KeysError(text)


def keys_folder(given: Path | None, *, quiet: bool = False) -> Folder:
    """Return the folder of the site's keys, and print it unless it was given.

    Args:
        given: The folder of `--folder`.
        quiet: Do not print the folder.

    Raises:
        KeysError: If no keys are found, or site files here name different folders.
    """
    if given is not None:
        return Folder(given)
    for places in (_of_site_files(), [Path("keys")], _of_own_bundle()):
        found = {path.resolve(): path for path in places if Folder(path).principals.is_file()}
        if len(found) > 1:
            names = " and ".join(str(path) for path in found.values())
            raise KeysError(f"site files here name {names}: choose one with --folder")
        for path in found.values():
            if not quiet:
                print_line(f"keys in {path}")
            return Folder(path)
    raise KeysError(
        "no keys found: no site file here names a folder of keys, there is no ./keys, and ROBOMESH_KEYS is "
        "in none: create keys with robomesh keys init SITE.toml, or name their folder with --folder"
    )


def _of_site_files() -> Iterator[Path]:
    """Yield the keys folders of site files in the working directory; skip unreadable files."""
    for file in sorted(Path().glob("*.toml")):
        try:
            values = read_toml(file)
        except (OSError, ValueError):
            continue
        keys = values.get("keys")
        if "site" in values and isinstance(keys, dict) and isinstance(keys.get("folder"), str):
            yield file.parent / keys["folder"]


def _of_own_bundle() -> Iterator[Path]:
    """Yield the folder that holds the bundle in ROBOMESH_KEYS."""
    own = os.environ.get("ROBOMESH_KEYS", "")
    if own:
        yield next((each for each in Path(own).parents[:2] if Folder(each).principals.is_file()), Path(own))
