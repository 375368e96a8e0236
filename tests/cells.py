"""Cells for tests."""

import numpy as np

from robots.descriptions.cells import STOP_M, WARNING_M, CellDescription, CellRobot, Fixture
from services import kinematics


def single_arm(
    name: str = "arm",
    model: str = "pt600",
    *,
    simulated: bool = False,
    fixtures: tuple[Fixture, ...] = (),
    warning_m: float = WARNING_M,
    stop_m: float = STOP_M,
) -> kinematics.RobotSettings:
    """Return the settings of a robot without neighbours in its cell, for the kinematics service."""
    robot = CellRobot(name=name, model=model, base_to_site=np.eye(4), warning_m=warning_m, stop_m=stop_m)
    return kinematics.RobotSettings(
        name=name, cell_description=CellDescription((robot,), fixtures), simulated=simulated
    )
