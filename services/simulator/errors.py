"""Errors of the simulator.

ServiceError (services.errors)
└── SimulatorError          a setting or a fault of a simulated controller is invalid
"""

from services.errors import ServiceError


class SimulatorError(ServiceError):
    """A setting or a fault of a simulated controller is invalid; the text names the value and valid ones."""
