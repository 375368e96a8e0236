"""A robot's table in the site file: what a kind of controller needs to know and does not report."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from robots.schema.robot_toml import JointType
from robots.schema.toml_table import TomlTable


@dataclass(frozen=True, kw_only=True)
class Declared:
    """What the site file declares of a robot besides its table.

    Attributes:
        simulated: `robomesh up` starts a simulated controller.
        loopback: The controller's address is one of this machine.
        stale_after_s: The stale time [s]; None: the file has none.
    """

    protocol: str
    simulated: bool
    loopback: bool
    stale_after_s: float | None


class Table(TomlTable):
    """Base of the tables. The docstring of each describes its keys, in `Attributes`."""

    def in_folder(self, folder: Path) -> Self:
        """Return the table with its files' paths relative to a folder."""
        return self

    def check(self, robot: Declared) -> None:
        """Check the table against what else is declared.

        Raises:
            ValueError: If they do not fit; the text names the key.
        """

    def arm(self, robot: Declared) -> str:
        """Return the robot's name at a controller of several robots; empty: it has one."""
        return ""

    def stale_time_s(self, robot: Declared) -> float:
        """Return the stale time where the file has none [s]."""
        return 1.0

    def options(self, robot: Declared) -> object:
        """Return the driver's settings."""
        return self

    def simulated_options(self, robot: Declared, joint_types: Sequence[JointType]) -> object:
        """Return the driver's settings before a simulated controller, which has its own values."""
        return self.options(robot)


def problem_text(problem: Any) -> str:
    """Return what pydantic found wrong: the text of the model's own error, otherwise pydantic's."""
    if problem["type"] == "value_error":
        return str(problem["ctx"]["error"])
    return str(problem["msg"]).removeprefix("Input ")  # the sentence names the key in place of "Input"
