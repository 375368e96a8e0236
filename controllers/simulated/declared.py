"""A table of the site file that an option of `robomesh simulate` gives as JSON."""

from typing import Any

from pydantic import ValidationError

from controllers.simulated.errors import SimulatorError
from protocol_gateway.seam.table import Declared, Table, problem_text


def declared_options(model: type[Table], protocol: str, option: str, text: str) -> Any:
    """Return the driver's settings of a table; None: it is empty.

    Raises:
        SimulatorError: If it is invalid.
    """
    if not text:
        return None
    robot = Declared(protocol=protocol, simulated=True, loopback=True, stale_after_s=None)
    try:
        return model.model_validate_json(text).options(robot)
    except ValidationError as error:
        problem = error.errors()[0]
        where = ".".join(map(str, problem["loc"]))
        raise SimulatorError(f"{option} {where}: {problem_text(problem)}") from None
