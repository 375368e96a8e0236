"""`robomesh up` with only the services that a test needs, for a machine that is busy with other tests.

Its simulated controllers send states seldom, and its gateway is patient.

TEST_SERVICES=recorder,store TEST_RATE_HZ=25 python -P tests/lean_up.py robomesh up SITE.toml
"""

import os
import sys
from dataclasses import replace

from services.command_line.main import main
from services.command_line.service_settings.table import SERVICES
from services.command_line.site import up
from tests.patience import be_patient


def leave_out(needed: set[str]) -> None:
    """Leave out services; those without which no page opens and no robot moves stay."""
    for name in SERVICES.keys() - needed - {"router", "gateway", "kinematics", "console"}:
        del SERVICES[name]


def slow_down(rate_hz: float) -> None:
    """Have the simulated controllers send states at a rate."""
    simulator = up._simulator

    def slow(*of: object) -> object:
        program, controller = simulator(*of)
        return replace(program, arguments=(*program.arguments, "--rate", f"{rate_hz:g}")), controller

    up._simulator = slow


if __name__ == "__main__":
    sys.argv[:2] = [sys.argv[1]]
    leave_out({*os.environ["TEST_SERVICES"].split(",")})
    slow_down(float(os.environ["TEST_RATE_HZ"]))
    be_patient()
    main()
