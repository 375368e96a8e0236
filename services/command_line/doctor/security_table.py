"""The rights of each certificate by the topic table, as `doctor --security` expects them.

Written independently of the generator of the rules (`robomesh/contract/access_rights.py`), which it verifies.
"""

from collections.abc import Iterable

from robomesh.contract import topics
from robomesh.contract.access_rights import PROBE_ROBOT, Act, Principal
from robomesh.contract.keys import has_wildcard, is_replay, parse_expression, replay_name
from robomesh.contract.topics import REQUESTS, TOPICS, Request, Role, Topic
from robomesh.errors import UnknownTopicError

ROWS: tuple[Topic | Request, ...] = (*TOPICS.values(), *REQUESTS.values())
# Matches the robot that no site has, and robots whose name begins with its name.
VAGUE = f"{PROBE_ROBOT}$*"
# Keys of routers themselves, which no rule allows.
ROUTERS_OWN = "@/**"
ROBOTS = (PROBE_ROBOT, replay_name(PROBE_ROBOT), VAGUE)


def names(row: Topic | Request, who: Principal) -> list[str]:
    """Return the names of a row that a principal might use: with its own name, another's, a request's."""
    if isinstance(row, Request) and row.in_name:
        stem = row.name.rpartition("/")[0].replace("*", PROBE_ROBOT)
        called = [each.name for each in REQUESTS.values() if each.wildcard]
        return [f"{stem}/{each}" for each in (who.name, f"nobody.{who.site}x", *called)]
    if row.name == "events/*":
        return [f"events/{who.role.value}"]
    if row.name == "health/*":
        return [f"health/{who.role.value}.{PROBE_ROBOT}"]
    return [row.name.replace("*", PROBE_ROBOT)]


def names_of_operators(people: Iterable[Principal]) -> set[str]:
    """Return the names of operators, and the name of an operator of another site for each."""
    askers = REQUESTS["lease/request/*"].askers
    own = [who for who in people if who.role in askers]
    return {who.name for who in own} | {f"nobody.{who.site}x" for who in own}


def tried_on_real(row: Topic | Request) -> tuple[Act, ...]:
    """Return the operations that do no harm on real robots: subscribers ignore messages without a header."""
    return ("put", "delete") if isinstance(row, Topic) else ()


def tried(row: Topic | Request, robot: str) -> tuple[Act, ...]:
    """Return the operations to try on a row; with a wildcard, those that would affect other robots."""
    if isinstance(row, Request):
        return ("declare_queryable",) if has_wildcard(robot) else ("query", "declare_queryable")
    if has_wildcard(robot):
        return ("put", "declare_queryable")
    return ("put", "delete", "declare_subscriber", "declare_queryable")


def should(who: Principal, act: Act, key: str) -> bool:
    """Return whether a principal may perform an operation on a key."""
    if key == ROUTERS_OWN:
        return False
    site, robot, name = parse_expression(key)
    if who.role is Role.ROUTER:
        return True  # it forwards what its own site allowed
    if act == "delete" or site != who.site:
        return False
    if act == "query":
        row = topics.request(name)
        return who.role in row.askers and (not row.in_name or _own_name(who, name.rpartition("/")[2]))
    if act == "liveliness_token":
        owner = name.rpartition("/")[2].rpartition(".")[0]
        return who.role in REQUESTS["lease/request/*"].askers and _own_name(who, owner)
    if act == "declare_subscriber":
        return who.role in topics.topic(name).subscribers
    speak = who.role in _speakers(name)
    if who.role is Role.GATEWAY:
        return speak and robot in (PROBE_ROBOT, *(who.robots or ()))
    if who.role is Role.PLAYER:
        return speak and is_replay(robot)
    return speak


def _speakers(name: str) -> frozenset[Role]:
    """Return the roles that publish a topic, or answer a request."""
    try:
        return topics.topic(name).publishers
    except UnknownTopicError:
        return topics.request(name).owners


def _own_name(who: Principal, name: str) -> bool:
    return name.endswith(f".{who.site}") if who.role is Role.CONSOLE else name == who.name
