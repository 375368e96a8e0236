"""Types of the rows in the table of topics and requests (`topics.py`)."""

from dataclasses import dataclass
from enum import Enum

from google.protobuf.message import Message


class Priority(Enum):
    """Zenoh's priorities by their names; on a full link every message is dropped, never queued."""

    REAL_TIME = "REAL_TIME"
    INTERACTIVE_HIGH = "INTERACTIVE_HIGH"
    INTERACTIVE_LOW = "INTERACTIVE_LOW"
    DATA_HIGH = "DATA_HIGH"
    DATA = "DATA"
    DATA_LOW = "DATA_LOW"
    BACKGROUND = "BACKGROUND"


class History(Enum):
    """The reply to a plain `get` on a topic's key; always one reply."""

    NONE = "none"
    LAST = "the last value"
    LAST_100 = "a list message of the last 100"
    KEY_FRAME = "the frames since the last key frame"


class Role(Enum):
    """Kinds of participants in the mesh; rights are sets of roles."""

    GATEWAY = "gateway"
    KINEMATICS = "kinematics"
    RECORDER = "recorder"
    PLAYER = "player"
    RENDERER = "renderer"
    CONSOLE = "console"
    SIMULATOR = "simulator"
    ROUTER = "router"
    WATCH = "watch"
    STORE = "store"
    ROS2 = "ros2"
    OPERATOR = "operator"
    ENGINEER = "engineer"
    MONITOR = "monitor"


EVERYONE = frozenset(Role)
PEOPLE = frozenset({Role.OPERATOR, Role.ENGINEER, Role.MONITOR})
SERVICES = EVERYONE - PEOPLE


@dataclass(frozen=True, kw_only=True)
class Topic:
    """A row of the table: a published topic.

    Attributes:
        name: Topic below the robot's key; `*` is a placeholder for one chunk.
        rate_hz: Highest rate [Hz]; None: on change, or as it occurs.
        heartbeat_s: Longest interval between messages while the publisher runs [s]; None: no limit.
        stale_after_s: Age from which it must not be shown as live [s]; None: it does not age.
        recovered: Lost samples are requested again (Zenoh's advanced publisher and subscriber).
    """

    name: str
    schema: type[Message]
    priority: Priority
    rate_hz: float | None = None
    heartbeat_s: float | None = None
    history: History = History.LAST
    history_schema: type[Message] | None = None
    recorded: bool = True
    recovered: bool = False
    stale_after_s: float | None = None
    publishers: frozenset[Role]
    subscribers: frozenset[Role] = EVERYONE


@dataclass(frozen=True, kw_only=True)
class Request:
    """A row of the table: a request below the robot's key; `*` is a placeholder for one chunk.

    Attributes:
        answer: Schema of the answer; None: plain bytes.
        wildcard: The key may have a wildcard.
        unread: An invalid payload counts as an empty one, so that every stop request stops.
        own_link: Name of the separate connection over which the owner receives it, so that other messages
            do not delay it; its handlers begin at a limited rate. Empty: the main connection.
        both_links: Sent over both links of a session in parallel, in case one loses or delays it. The owner
            handles it once.
        in_name: The last chunk is the caller's name; the router checks it against the certificate.
        administrators: A console sends it only for an administrator's account.
        longest: Most bytes of its payload. The owner decodes it in one turn of its event loop, in which no
            stop is handled.
    """

    name: str
    request: type[Message] | None
    answer: type[Message] | None
    priority: Priority
    owners: frozenset[Role]
    askers: frozenset[Role]
    wildcard: bool = False
    unread: bool = False
    own_link: str = ""
    both_links: bool = False
    in_name: bool = False
    administrators: bool = False
    longest: int = 4 << 20
