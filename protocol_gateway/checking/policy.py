"""Whether motions are checked before they are made."""

from enum import StrEnum


class Policy(StrEnum):
    """Of one robot, by the site file: `check = "require"`.

    require: what was not checked against the present state, or fails, is refused.
    warn: it is said, and the motion is made.
    off: nothing is checked.
    """

    REQUIRE = "require"
    WARN = "warn"
    OFF = "off"
