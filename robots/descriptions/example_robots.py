"""Robots of the package example-robot-data (the extra `example-robots`) by name.

To add a robot, add a line to EXAMPLES. Its home and the link pairs without a collision check come from
the package's SRDF with the robot's name, if it exists.
"""

import importlib.metadata
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robots.descriptions.urdf.files import files_of
from robots.descriptions.urdf.read import read_urdf
from robots.descriptions.urdf.srdf import read_srdf
from robots.schema.errors import DescriptionError

_PACKAGE = "example-robot-data"
_FOLDER = "cmeel.prefix/share/example-robot-data/robots"

EXAMPLES: Mapping[str, str] = {
    "a1": "a1_description/urdf/a1.urdf",
    "allegro_left": "allegro_hand_description/urdf/allegro_left_hand.urdf",
    "allegro_right": "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "anymal": "anymal_b_simple_description/robots/anymal.urdf",
    "anymal_c": "anymal_c_simple_description/urdf/anymal.urdf",
    "b1": "b1_description/urdf/b1.urdf",
    "baxter": "baxter_description/urdf/baxter.urdf",
    "double_pendulum": "double_pendulum_description/urdf/double_pendulum.urdf",
    "finger_edu": "finger_edu_description/robots/finger_edu.urdf",
    "g1": "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "go1": "go1_description/urdf/go1.urdf",
    "go2": "go2_description/urdf/go2.urdf",
    "hyq": "hyq_description/robots/hyq_no_sensors.urdf",
    "icub": "icub_description/robots/icub.urdf",
    "kinova": "kinova_description/robots/kinova.urdf",
    "laikago": "laikago_description/urdf/laikago.urdf",
    "panda": "panda_description/urdf/panda.urdf",
    "pr2": "pr2_description/urdf/pr2.urdf",
    "romeo": "romeo_description/urdf/romeo.urdf",
    "so100": "so_arm_description/urdf/so100.urdf",
    "so101": "so_arm_description/urdf/so101.urdf",
    "solo": "solo_description/robots/solo.urdf",
    "solo12": "solo_description/robots/solo12.urdf",
    "talos": "talos_data/robots/talos_reduced.urdf",
    "talos_arm": "talos_data/robots/talos_left_arm.urdf",
    "tiago": "tiago_description/robots/tiago_no_hand.urdf",
    "tiago_pro": "tiago_pro_description/robots/tiago_pro.urdf",
    "ur3": "ur_description/urdf/ur3_robot.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "ur10": "ur_description/urdf/ur10_robot.urdf",
    "ur3_gripper": "ur_description/urdf/ur3_gripper.urdf",
    "ur5_gripper": "ur_description/urdf/ur5_gripper.urdf",
    "xarm7": "xarm_description/urdf/xarm7.urdf",
    "z1": "z1_description/urdf/z1.urdf",
}


@dataclass(frozen=True)
class ExampleRobot:
    """The files of a robot of the package.

    Attributes:
        srdf: The file may not exist.
    """

    name: str
    urdf: Path
    srdf: Path


def example_names() -> tuple[str, ...]:
    """Return the sorted names of the example robots; empty if the package is not installed."""
    return tuple(sorted(EXAMPLES)) if example_folder() is not None else ()


def example_folder() -> Path | None:
    """Return the folder of the package's robots, or None if the package is not installed."""
    try:
        folder = Path(str(importlib.metadata.distribution(_PACKAGE).locate_file(_FOLDER)))
    except importlib.metadata.PackageNotFoundError:
        return None
    return folder if folder.is_dir() else None


def example_robot(name: str) -> ExampleRobot:
    """Return the files of an example robot.

    Raises:
        DescriptionError: If the package is not installed.
    """
    folder = example_folder()
    if folder is None:
        text = (
            f"is one of the example robots, which are not installed (131 MB). Run ./dev example-robots "
            f"or pip install {_PACKAGE}"
        )
        raise DescriptionError(name, [text])
    urdf = folder / EXAMPLES[name]
    return ExampleRobot(name, urdf, urdf.parents[1] / "srdf" / f"{name}.srdf")


def example_values(robot: ExampleRobot) -> dict[str, Any]:
    """Return the robot.toml values of an example robot, relative to the folder of its URDF."""
    values: dict[str, Any] = {
        "name": robot.name,
        "provenance": f"{_PACKAGE} {importlib.metadata.version(_PACKAGE)}, {EXAMPLES[robot.name]}",
        "units": {"length": "m", "angle": "rad"},
        "urdf": robot.urdf.name,
    }
    if robot.srdf.is_file():
        tree = read_urdf(robot.urdf.read_bytes(), robot.urdf, resolve=files_of(robot.urdf)).tree
        home, ignored = read_srdf(robot.srdf.read_bytes(), robot.srdf, tree)
        values["joint"] = [{"name": name, "home": position} for name, position in home.items()]
        values["collision"] = {"ignore": [list(pair) for pair in ignored]}
    return values
