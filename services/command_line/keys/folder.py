"""Where a site's keys lie: as `--folder` says, or found near where one stands."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from robots.bounded_toml import read_toml
from services.pki.errors import KeysError
from services.pki.folder import Folder

KeysFolder = Annotated[
    Path | None,
    typer.Option(
        "--folder",
        metavar="DIR",
        help="Where the site's keys lie; else: as a site file here says, ./keys, where ROBOMESH_KEYS lies.",
    ),
]


def keys_folder(given: Path | None, *, quiet: bool = False) -> Folder:
    """The site's keys; those that were found are named, so that nobody changes another site's.

    Args:
        given: By `--folder`.
        quiet: Print no line that names them.

    Raises:
        KeysError: If there are none, or site files here name different ones.
    """
    if given is not None:
        return Folder(given)
    for places in (_of_site_files(), [Path("keys")], _around_own()):
        found = {path.resolve(): path for path in places if Folder(path).principals.is_file()}
        if len(found) > 1:
            names = " and ".join(str(path) for path in found.values())
            raise KeysError(f"site files here name {names}: --folder says which keys are meant")
        for path in found.values():
            if not quiet:
                print(f"keys in {path}")
            return Folder(path)
    raise KeysError(
        "no keys are found: no site file here names a folder of them, there is no ./keys, and ROBOMESH_KEYS "
        "lies in none: robomesh keys init SITE.toml begins, and --folder says where the keys lie"
    )


def _of_site_files() -> Iterator[Path]:
    """The folders that site files in the working directory name; a file with faults names none."""
    for file in sorted(Path().glob("*.toml")):
        try:
            values = read_toml(file)
        except (OSError, ValueError):
            continue
        keys = values.get("keys")
        if "site" in values and isinstance(keys, dict) and isinstance(keys.get("folder"), str):
            yield file.parent / keys["folder"]


def _around_own() -> Iterator[Path]:
    """The folder whose bundle, of a service or a person, one attaches with."""
    own = os.environ.get("ROBOMESH_KEYS", "")
    if own:
        yield next((each for each in Path(own).parents[:2] if Folder(each).principals.is_file()), Path(own))
