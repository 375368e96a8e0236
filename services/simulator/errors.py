"""Errors of the simulator.

ServiceError (services.errors)
└── SimulatorError          settings that no simulated controller can run with
"""

from services.errors import ServiceError


class SimulatorError(ServiceError):
    """Settings that no simulated controller can run with; the text names the one and says what is right."""
