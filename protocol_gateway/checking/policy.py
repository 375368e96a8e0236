"""Policy of the motion check."""

from enum import StrEnum


class Policy(StrEnum):
    """Policy of one robot, from the site file: `check = "require"`.

    require: refuse a motion that fails the check, or could not be checked against the present state.
    warn: warn about this motion, and execute it.
    off: do not check motions.
    """

    REQUIRE = "require"
    WARN = "warn"
    OFF = "off"
