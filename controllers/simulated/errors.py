"""Errors of the simulator.

RobomeshError (robomesh.errors)
└── SimulatorError          a setting or a fault of a simulated controller is invalid
    └── FaultError          a fault is unknown, or its time is invalid
"""

from robomesh.errors import RobomeshError
from robomesh.reasons import Reason


class SimulatorError(RobomeshError):
    """A setting or a fault of a simulated controller is invalid; the text names the value and valid ones."""


class FaultError(SimulatorError):
    """A fault is unknown, or its time is invalid; `reason` says which."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason
