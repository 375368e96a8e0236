"""Sessions of the site's certificates, and what `doctor --security` does with each of them."""

import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from threading import Condition

import zenoh

from robomesh.access import PROBE_ROBOT, Act, Principal
from robomesh.endpoints import bundle, client_config, first_line
from robomesh.messages import PROTOBUF
from services.pki import Folder, authority
from services.pki.errors import KeysError
from services.pki.principals import Principals

TIMEOUT_S = 10.0


@dataclass(frozen=True)
class Trial:
    """Somebody's act on a key, and whether it went through."""

    who: str
    act: Act
    key: str


@dataclass
class Person:
    """Who tries."""

    principal: Principal
    session: zenoh.Session
    heard: set[str] = field(default_factory=set)


def with_files(keys: Folder, principals: Principals) -> Iterator[tuple[Principal, Path]]:
    """Everybody of the site whose certificate lies here and is good."""
    now = authority.now()
    for entry in principals.entries:
        file = Path(authority.file_of(keys, principals.site, entry))
        good = entry.revoked is None and entry.expires is not None and entry.expires > now
        if good and not entry.sites and file.is_file():
            yield entry.principal, file


def open_as(routers: tuple[str, ...], file: Path) -> zenoh.Session:
    """Open a session with a certificate.

    Raises:
        KeysError: If no router takes it.
    """
    config = client_config(routers, bundle(file))
    # One link: what is tried and the question that ends it keep their order.
    config.insert_json5("connect/endpoints", json.dumps(list(routers)))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise KeysError(f"no router at {', '.join(routers)} takes {file}: {first_line(error)}") from None


def settle(person: Person, site: str) -> None:
    """Wait until the router has judged what was sent.

    A question that everybody may ask comes back behind it.
    """
    list(person.session.get(f"robomesh/{site}/{PROBE_ROBOT}/recordings/list", timeout=TIMEOUT_S))


def ask_all(
    person: Person,
    questions: Mapping[str, bytes | None],
    on_reply: Callable[[str, zenoh.Reply], None],
    *,
    of: zenoh.Locality = zenoh.Locality.ANY,
) -> None:
    """Ask each key with its payload (protobuf), all at once, and wait until all are answered or refused.

    Args:
        of: Who may answer. A session answers some questions about `@/**` itself.
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
    """Return for each key who answered, and as what."""
    answers: dict[str, set[tuple[str, str]]] = {key: set() for key in keys}

    def on_reply(key: str, reply: zenoh.Reply) -> None:
        if reply.ok is not None and reply.ok.attachment is not None:
            name, _, own = reply.ok.attachment.to_string().partition(" ")
            answers[key].add((name, own))

    ask_all(person, dict.fromkeys(answers), on_reply)
    return answers


def wait_until(there: Callable[[], bool], within_s: float = 1.0) -> None:
    """Wait until something is there, or the time is over."""
    deadline = time.monotonic() + within_s
    while not there() and time.monotonic() < deadline:
        time.sleep(0.01)
