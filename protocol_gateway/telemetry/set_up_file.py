"""Tool, payload and frame that were confirmed last, in a file: a change while no gateway runs is one too."""

import json
import logging
import math
from collections.abc import Mapping
from pathlib import Path

from protocol_gateway.seam import SignalValue
from robomesh.files.atomic_write import write_atomically

LONGEST_FILE = 65_536
log = logging.getLogger(__name__)


def read(path: Path) -> dict[str, SignalValue]:
    """Return the confirmed values by signal; empty without a file. An unreadable one is logged."""
    try:
        with path.open("rb") as file:
            content = json.loads(file.read(LONGEST_FILE))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, RecursionError) as error:
        log.warning(
            "%s is unreadable (%s): the values that arrive first are taken for confirmed", path, error
        )
        return {}
    if not isinstance(content, dict) or not all(map(_is_value, content.values())):
        log.warning("%s is damaged: the values that arrive first are taken for confirmed", path)
        return {}
    return content


def _is_value(value: object) -> bool:
    return isinstance(value, bool | int | str) or (isinstance(value, float) and math.isfinite(value))


def write(path: Path, values: Mapping[str, SignalValue]) -> None:
    """Replace the file.

    Raises:
        OSError: If it cannot be written; the old content remains.
    """
    write_atomically(path, json.dumps(values).encode())
