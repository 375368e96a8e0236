"""Key expressions of the mesh.

robomesh/<site>/<robot>/<topic>                 a robot's topic: robomesh/shanghai/pt600-1/joints
robomesh/<site>/-/<topic>                       what belongs to a whole site
robomesh/<site>/<robot>/<request>/<asker>       a request made in somebody's name: .../command/li
robomesh/<site>/<robot>/alive/<service>/<id>    presence: a liveliness token
"""

import re
from typing import NamedTuple

from bus.errors import KeyNameError

ROOT = "robomesh"
WHOLE_SITE = "-"
# A recording played back is a robot named replay-<id>.
REPLAY = "replay-"

_NAME = re.compile(r"[a-z0-9][a-z0-9_-]*")
# Operators and views come from people and certificates: what a key chunk can hold.
_CHUNK = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


class Key(NamedTuple):
    """A key taken apart."""

    site: str
    robot: str
    topic: str

    def __str__(self) -> str:
        return f"{ROOT}/{self.site}/{self.robot}/{self.topic}"


class PresenceKey(NamedTuple):
    """A liveliness token's key taken apart."""

    site: str
    robot: str
    service: str
    id: str


def check_name(name: str, what: str = "name") -> str:
    """The name itself, when a site or robot may have it.

    Raises:
        KeyNameError: If it is not lower-case letters, digits, `_` and `-`, beginning with a letter or digit.
    """
    if not _NAME.fullmatch(name):
        raise KeyNameError(
            f"{what} {name!r} cannot be used: lower-case letters, digits, '_' and '-', "
            "beginning with a letter or digit"
        )
    return name


def check_chunk(name: str, what: str = "operator") -> str:
    """The name itself, when it can be one chunk of a key (an operator, a view).

    Raises:
        KeyNameError: If it cannot.
    """
    if not _CHUNK.fullmatch(name):
        raise KeyNameError(
            f"{what} {name!r} cannot be used: letters, digits, '_', '.' and '-', "
            "beginning with a letter or digit"
        )
    return name


def robot_key(site: str, robot: str, topic: str) -> str:
    """The key of a robot's topic; `-` as the robot for what belongs to the whole site.

    Raises:
        KeyNameError: If site or robot cannot stand in a key.
    """
    check_name(site, "site")
    if robot != WHOLE_SITE:
        check_name(robot, "robot")
    return f"{ROOT}/{site}/{robot}/{topic}"


def every_robot(topic: str) -> str:
    """The key expression of a topic on every robot of every site."""
    return f"{ROOT}/*/*/{topic}"


def parse_key(key: str) -> Key:
    """Site, robot and topic of a key.

    Raises:
        KeyNameError: If it is not a key of the mesh.
    """
    root, *rest = key.split("/", 3)
    if root != ROOT or len(rest) != 3 or not all(rest):
        raise KeyNameError(f"{key!r} is not a key of the mesh: robomesh/<site>/<robot>/<topic>")
    return Key(*rest)


def has_wildcard(key: str) -> bool:
    """Whether a key stands for many: what is asked and listened to may, what is told may not.

    Zenoh lets somebody put to, answer on and be present on such a key: it would count for every robot.
    """
    return "*" in key  # `$` comes before one only


def is_replay(key: str) -> bool:
    """Whether a key belongs to a recording that is played back, with the times of then."""
    return f"/{REPLAY}" in key


def presence_key(site: str, robot: str, service: str, identity: str) -> str:
    """The key of a liveliness token."""
    return f"{robot_key(site, robot, 'alive')}/{check_chunk(service, 'service')}/{identity}"


def parse_presence_key(key: str) -> PresenceKey:
    """Site, robot, service and id of a liveliness token's key.

    Raises:
        KeyNameError: If it is not one, or stands for many.
    """
    site, robot, topic = parse_key(key)
    if has_wildcard(key):
        raise KeyNameError(f"{key!r} has a wildcard: nobody is present everywhere")
    match topic.split("/"):
        case ["alive", service, identity]:
            return PresenceKey(site, robot, service, identity)
    raise KeyNameError(f"{key!r} is not a presence key: {ROOT}/<site>/<robot>/alive/<service>/<id>")
