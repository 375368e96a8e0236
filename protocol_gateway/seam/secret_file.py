"""Files with passwords and keys, which only their owner may read."""

import re
import stat
from pathlib import Path

from protocol_gateway.seam.errors import GatewaySettingsError

_OTHERS = stat.S_IRWXG | stat.S_IRWXO


def read_secret(path: Path, key: str) -> bytes:
    """Return the content of a file that only its owner may read.

    Args:
        key: The site file's, for errors.

    Raises:
        GatewaySettingsError: If it cannot be read, or others may read it.
    """
    try:
        with path.open("rb") as file:
            mode = stat.S_IMODE(path.stat().st_mode)
            if mode & _OTHERS:
                raise GatewaySettingsError(f"{path}: others may read it (mode {mode:o}): chmod 600 {path}")
            return file.read()
    except OSError as error:
        raise GatewaySettingsError(f"{key} {path}: {(error.strerror or str(error)).lower()}") from None


def read_password(path: Path, key: str) -> str:
    """Return the password in a file, without the newline at its end.

    Raises:
        GatewaySettingsError: If it cannot be read, or others may read it.
    """
    return re.sub(r"\r?\n$", "", read_secret(path, key).decode(errors="replace"))
