"""Errors of the simulator.

ServiceError (services.errors)
└── SimulatorError          a setting or a fault of a simulated controller is invalid
    └── FaultError          a fault is unknown, or its time is invalid
"""

from robomesh.reasons import Reason
from services.errors import ServiceError


class SimulatorError(ServiceError):
    """A setting or a fault of a simulated controller is invalid; the text names the value and valid ones."""


class FaultError(SimulatorError):
    """A fault is unknown, or its time is invalid; `reason` says which."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason
