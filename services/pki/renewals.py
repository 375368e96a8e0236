"""Renewal of keys and certificates."""

from collections.abc import Iterable
from datetime import timedelta

from robomesh.contract.topics import PEOPLE
from services.pki.errors import KeysError
from services.pki.folder import Folder
from services.pki.principals import Entry, Principals
from services.pki.site_keys import exclusive, issued, now, principals_of, save

RENEW_WITHIN = timedelta(days=10)


@exclusive
def renew(folder: Folder, names: Iterable[str] = (), *, all_: bool = False) -> tuple[Entry, ...]:
    """Renew the given names' keys and certificates, or those that expire soon; each keeps its lifetime.

    Without names it renews the site's own services only: a person has to hand over operators' and guests'
    bundles, and access that was granted for a limited time must not become permanent.

    Args:
        all_: Without names: renew every certificate that has not expired.

    Raises:
        KeysError: If a name has no certificate, or was revoked.
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
        raise KeysError(f"{name} has no certificate of this site: robomesh keys list shows the names")
    if entry.revoked is not None:
        raise KeysError(f"{entry.name} was revoked: robomesh keys issue makes a new certificate")
    return entry


def _of_service(principals: Principals, entry: Entry) -> bool:
    return entry.role not in PEOPLE and entry.name.rpartition(".")[2] == principals.site
