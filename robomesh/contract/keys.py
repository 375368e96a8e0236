"""Key expressions of the mesh.

robomesh/<site>/<robot>/<topic>                 a robot's topic: robomesh/shanghai/pt600-1/joints
robomesh/<site>/-/<topic>                       a topic of a whole site
robomesh/<site>/<robot>/<request>/<caller>      a request in its caller's name: .../command/li
robomesh/<site>/<robot>/alive/<service>/<id>    presence: a liveliness token
"""

import re
from functools import lru_cache
from typing import NamedTuple

from robomesh import reason_codes as codes
from robomesh.errors import KeyNameError
from robomesh.texts import one_line

ROOT = "robomesh"
WHOLE_SITE = "-"
# A player publishes a replay as a robot named replay-<id>.
_REPLAY = "replay-"

# Characters of a site's or robot's name, and of any other chunk of a key.
LONGEST_NAME, LONGEST_CHUNK = 64, 200
# Of a whole key; no topic or request comes near it.
LONGEST_KEY = 1024

FREE, CLOSE, FAR = "free", "close", "far"
"""Views that every renderer has besides those of the robot's description: `close` follows the arm and has no
texts, for the small pictures of a list; `far` is for slow links."""

_NAME = re.compile(r"[a-z0-9][a-z0-9_-]*")
# Names of operators and views come from people and certificates, so more characters are allowed.
_CHUNK = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


class Key(NamedTuple):
    """A parsed key."""

    site: str
    robot: str
    topic: str

    def __str__(self) -> str:
        return f"{ROOT}/{self.site}/{self.robot}/{self.topic}"

    @property
    def last_chunk(self) -> str:
        """Last chunk of the topic: most requests end with the caller, `video/*` with the view."""
        return self.topic.rpartition("/")[2]


class PresenceKey(NamedTuple):
    """A parsed key of a liveliness token."""

    site: str
    robot: str
    service: str
    id: str


def check_name(name: str, what: str = "name") -> str:
    """Return the name if it is valid for a site or robot.

    Raises:
        KeyNameError: If it is not at most 64 lower-case letters, digits, `_` and `-`, beginning with a
            letter or digit.
    """
    if len(name) > LONGEST_NAME or not _NAME.fullmatch(name):
        raise KeyNameError(codes.KEY_NAME(what=what, name=one_line(name, LONGEST_NAME), most=LONGEST_NAME))
    return name


def check_chunk(name: str, what: str = "operator") -> str:
    """Return the name if it is valid as one chunk of a key (an operator, a view).

    Raises:
        KeyNameError: If it is not.
    """
    if len(name) > LONGEST_CHUNK or not _CHUNK.fullmatch(name):
        raise KeyNameError(codes.KEY_CHUNK(what=what, name=one_line(name, LONGEST_NAME), most=LONGEST_CHUNK))
    return name


def robot_key(site: str, robot: str, topic: str) -> str:
    """Return the key of a robot's topic; `-` as the robot for a topic of the whole site.

    Raises:
        KeyNameError: If the site's or robot's name is invalid.
    """
    check_name(site, "site")
    if robot != WHOLE_SITE:
        check_name(robot, "robot")
    return f"{ROOT}/{site}/{robot}/{topic}"


def every_robot(topic: str) -> str:
    """Return the key expression of a topic on every robot of every site."""
    return f"{ROOT}/*/*/{topic}"


@lru_cache(4096)  # each sample's key
def parse_key(key: str) -> Key:
    """Return site, robot and topic of a key; rejects key expressions with wildcards.

    Raises:
        KeyNameError: If it is not a key of the mesh, or a chunk is invalid.
    """
    parsed = parse_expression(key)
    robot_key(*parsed)
    for chunk in parsed.topic.split("/"):
        check_chunk(chunk, "chunk")
    return parsed


def parse_expression(key_expr: str | Key) -> Key:
    """Return site, robot and topic of a key or key expression; each may have a wildcard.

    Does not check the chunks: use `parse_key` for keys received from the mesh.

    Args:
        key_expr: A parsed key is returned unchanged.

    Raises:
        KeyNameError: If it does not have these three parts, or is longer than 1,024 characters.
    """
    if isinstance(key_expr, Key):
        return key_expr
    root, *rest = key_expr.split("/", 3)
    if root != ROOT or len(rest) != 3 or not all(rest) or len(key_expr) > LONGEST_KEY:
        raise KeyNameError(codes.KEY_OTHER(key=one_line(key_expr, LONGEST_CHUNK)))
    return Key(*rest)


def has_wildcard(key: str) -> bool:
    """Return whether a key has a wildcard.

    Queries and subscriptions may have one. Zenoh also accepts it in publications, replies and tokens, which
    would then count for every robot.
    """
    return "*" in key  # Zenoh's `$` is valid only in front of `*`


def replay_name(identity: str) -> str:
    """Return the robot's name of a replay."""
    return f"{_REPLAY}{identity}"


def is_replay(robot: str) -> bool:
    """Return whether a robot's name is that of a replay, which has the source times of its recording."""
    return robot.startswith(_REPLAY)


def presence_key(site: str, robot: str, service: str, identity: str) -> str:
    """Return the key of a liveliness token; `*` as the identity for every token of the service.

    Raises:
        KeyNameError: If a part of it is invalid.
    """
    if identity != "*":
        check_chunk(identity, "id")
    return f"{robot_key(site, robot, 'alive')}/{check_chunk(service, 'service')}/{identity}"


def parse_presence_key(key: str) -> PresenceKey:
    """Return site, robot, service and id of a liveliness token's key.

    Raises:
        KeyNameError: If it is not the key of a token, a chunk is invalid, or it has a wildcard.
    """
    site, robot, topic = parse_key(key)
    match topic.split("/"):
        case ["alive", service, identity]:
            return PresenceKey(site, robot, service, identity)
    raise KeyNameError(codes.KEY_NOT_PRESENCE(key=key))
