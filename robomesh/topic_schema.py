"""What a row of the table of topics and requests (`topics.py`) says."""

from dataclasses import dataclass
from enum import Enum

from google.protobuf.message import Message


class Priority(Enum):
    """Zenoh's priorities, by their own names; everything is dropped, never queued."""

    REAL_TIME = "REAL_TIME"
    INTERACTIVE_HIGH = "INTERACTIVE_HIGH"
    INTERACTIVE_LOW = "INTERACTIVE_LOW"
    DATA_HIGH = "DATA_HIGH"
    DATA = "DATA"
    DATA_LOW = "DATA_LOW"
    BACKGROUND = "BACKGROUND"


class History(Enum):
    """What a plain `get` on a topic's key answers with, always as one reply."""

    NONE = "none"
    LAST = "the last value"
    LAST_100 = "a list message of the last 100"
    KEY_FRAME = "the frames since the last key frame"


class Role(Enum):
    """Who takes part in the mesh. Each right below names the roles that have it."""

    GATEWAY = "gateway"
    KINEMATICS = "kinematics"
    RECORDER = "recorder"
    PLAYER = "player"
    RENDERER = "renderer"
    CONSOLE = "console"
    SIMULATOR = "simulator"
    ROUTER = "router"
    WATCH = "watch"
    ROS2 = "ros2"
    OPERATOR = "operator"
    MONITOR = "monitor"


EVERYONE = frozenset(Role)
PEOPLE = frozenset({Role.OPERATOR, Role.MONITOR})
SERVICES = EVERYONE - PEOPLE


@dataclass(frozen=True, kw_only=True)
class Topic:
    """A row: something published.

    Attributes:
        name: Topic below the robot's key; `*` stands for one chunk.
        rate_hz: Highest rate; None: on change or as it comes.
        heartbeat_s: Published at least this often while its publisher lives; None: no such promise.
        stale_after_s: Age from which it must not look live; None: it does not age.
        recovered: Lost samples are asked for again (Zenoh's advanced publisher and subscriber).
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
    """A row: something asked, below the robot's key; `*` stands for one chunk.

    Attributes:
        answer: Schema of the answer; None: plain bytes.
        wildcard: May be asked on a key with a wildcard.
        unread: A payload that cannot be read counts as an empty one: a stop is a stop.
        own_link: Its owner takes it over the connection of this name, where nothing else can be before it,
            and begins it at a limited rate; empty: over the one for everything.
        both_links: Asked over both links of each session at once: what one of them loses or keeps, the other
            does not. Its owner does it once.
        in_name: The last chunk is the name of who asks: the router lets a certificate use its own only.
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
