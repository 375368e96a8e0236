"""New keys and certificates for those that have some."""

from collections.abc import Iterable
from datetime import timedelta

from robomesh.topics import PEOPLE
from services.pki.authority import alone, issued, now, principals_of, save
from services.pki.errors import KeysError
from services.pki.folder import Folder
from services.pki.principals import Entry, Principals

RENEW_WITHIN = timedelta(days=10)


@alone
def renew(folder: Folder, names: Iterable[str] = (), *, all_: bool = False) -> tuple[Entry, ...]:
    """New keys and certificates, for as long as those before: of those named, or of what expires soon.

    Without names the site's own services only: a person's file and a guest's are handed over by somebody,
    and who was let in for a while is not let in for ever.

    Args:
        all_: Without names: everybody's that has not expired, whenever it does.

    Raises:
        KeysError: If a name has none, or was revoked.
    """
    principals = principals_of(folder)
    wanted = [_renewable(principals, name) for name in names]
    if not wanted:
        soon = now() + RENEW_WITHIN
        wanted = [
            entry
            for entry in principals.entries
            if entry.serial and entry.revoked is None and entry.expires is not None
            if (_of_service(principals, entry) and (all_ or entry.expires <= soon))
            or (all_ and entry.expires > now())
        ]
    for entry in wanted:
        assert entry.expires is not None
        assert entry.issued is not None
        principals = issued(folder, principals, entry, entry.expires - entry.issued)
    save(folder, principals)
    return tuple(found for entry in wanted if (found := principals.find(entry.name)) is not None)


def _renewable(principals: Principals, name: str) -> Entry:
    entry = principals.find(name)
    if entry is None or not entry.serial:
        raise KeysError(f"{name} has no certificate of this site: robomesh keys list shows who has")
    if entry.revoked is not None:
        raise KeysError(f"{entry.name} was revoked: robomesh keys issue makes a certificate anew")
    return entry


def _of_service(principals: Principals, entry: Entry) -> bool:
    return entry.role not in PEOPLE and entry.name.rpartition(".")[2] == principals.site
