"""Sessions with the site's certificates, and the queries of `doctor --security`."""

import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from threading import Condition

import zenoh

from robomesh.contract.access_rights import PROBE_ROBOT, Act, Principal
from robomesh.contract.endpoints import bundle, client_config, first_line
from robomesh.contract.messages import PROTOBUF
from services.pki import Folder, site_keys
from services.pki.errors import KeysError
from services.pki.principals import Principals

TIMEOUT_S = 10.0


@dataclass(frozen=True)
class AccessTrial:
    """An operation of a principal on a key."""

    who: str
    act: Act
    key: str


@dataclass
class Person:
    """A principal, its session, and the keys that it received messages on."""

    principal: Principal
    session: zenoh.Session
    received: set[str] = field(default_factory=set)


def with_files(keys: Folder, principals: Principals) -> Iterator[tuple[Principal, Path]]:
    """Yield the principals of the site whose certificate is in the folder and valid."""
    now = site_keys.now()
    for entry in principals.entries:
        file = Path(site_keys.file_of(keys, principals.site, entry))
        valid = entry.revoked is None and entry.expires is not None and entry.expires > now
        if valid and not entry.sites and file.is_file():
            yield entry.principal, file


def open_as(routers: tuple[str, ...], file: Path) -> zenoh.Session:
    """Open a session with a certificate.

    Raises:
        KeysError: If no router accepts it.
    """
    config = client_config(routers, bundle(file))
    # One link, so that a trial and the query after it keep their order.
    config.insert_json5("connect/endpoints", json.dumps(list(routers)))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise KeysError(f"no router at {', '.join(routers)} accepts {file}: {first_line(error)}") from None


def settle(person: Person, site: str) -> None:
    """Wait until the router has processed what was sent: every client may make this query, which is last."""
    list(person.session.get(f"robomesh/{site}/{PROBE_ROBOT}/recordings/list", timeout=TIMEOUT_S))


def ask_all(
    person: Person,
    questions: Mapping[str, bytes | None],
    on_reply: Callable[[str, zenoh.Reply], None],
    *,
    of: zenoh.Locality = zenoh.Locality.ANY,
) -> None:
    """Query each key with its payload (protobuf), all in parallel, and wait until all queries are finished.

    Args:
        of: Which queryables may answer. A session answers some queries of `@/**` itself.
    """
    left, done = len(questions), Condition()

    def ended() -> None:
        nonlocal left
        with done:
            left -= 1
            done.notify_all()

    for key, payload in questions.items():

        def reply_to(reply: zenoh.Reply, key: str = key) -> None:
            on_reply(key, reply)

        person.session.get(
            key,
            zenoh.handlers.Callback(reply_to, ended),
            payload=payload,
            encoding=None if payload is None else PROTOBUF,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            allowed_destination=of,
            timeout=TIMEOUT_S,
        )
    with done:
        done.wait_for(lambda: left == 0, 2 * TIMEOUT_S)


def who_answers(person: Person, keys: Iterable[str]) -> dict[str, set[tuple[str, str]]]:
    """Return for each key the principals that answered, with the key of their queryable."""
    answers: dict[str, set[tuple[str, str]]] = {key: set() for key in keys}

    def on_reply(key: str, reply: zenoh.Reply) -> None:
        if reply.ok is not None and reply.ok.attachment is not None:
            name, _, own = reply.ok.attachment.to_string().partition(" ")
            answers[key].add((name, own))

    ask_all(person, dict.fromkeys(answers), on_reply)
    return answers


def wait_until(condition: Callable[[], bool], within_s: float = 1.0) -> None:
    """Wait until a condition is true, or the time is over."""
    deadline = time.monotonic() + within_s
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)
