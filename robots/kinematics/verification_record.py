"""The file that `robomesh robot verify --out` writes: evidence that a controller's joints fit a model.

Plain JSON. The site file names it, and the gateway compares it with what runs now.
"""

import errno
import json
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from robots.schema.errors import VerificationRecordError

_MOST_BYTES = 1_000_000


class VerifiedPose(BaseModel):
    """A pose in which the arm rested.

    Attributes:
        positions: Of the joints [rad] or [m].
        distance_m, angle_rad: Between the tool of the model and that of the controller.
        tool_to_base, tool_to_flange: Placements [m], (4, 4) row by row, as the controller computed them;
            empty in files of earlier versions.
    """

    model_config = ConfigDict(frozen=True)
    positions: tuple[float, ...]
    distance_m: float
    angle_rad: float
    tool_to_base: tuple[float, ...] = ()
    tool_to_flange: tuple[float, ...] = ()


class VerificationRecord(BaseModel):
    """Result of a comparison of a robot's model with its controller.

    Attributes:
        robot: <site>/<robot>.
        time: When it was made, ISO 8601, UTC.
        agrees: Model and controller agree.
        model: Name of the model.
        joints_sha256: Hash of the model and the joint mapping; see `verification.joints_sha256`.
        software: Version of the controller's software; empty: not reported.
        joints: Names of the joints.
        unmoved: Joints that moved too little, in words.
        suspects: Single changes that explain a deviation, in words.
    """

    model_config = ConfigDict(frozen=True)
    robot: str
    time: str
    agrees: bool
    model: str
    joints_sha256: str
    software: str
    joints: tuple[str, ...]
    poses: tuple[VerifiedPose, ...]
    unmoved: tuple[str, ...]
    suspects: tuple[str, ...]


def read_record(path: Path) -> VerificationRecord:
    """Read the record of a verification.

    Raises:
        VerificationRecordError: If the file cannot be read, or is not a record.
    """
    try:
        if path.is_fifo():
            raise OSError(errno.EINVAL, "it is a pipe")
        with path.open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
    except OSError as error:
        raise VerificationRecordError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise VerificationRecordError(f"{str(path)!r}: cannot be read: {error}") from None
    try:
        if len(data) > _MOST_BYTES:
            raise ValueError
        return VerificationRecord.model_validate(json.loads(data))
    except (ValueError, RecursionError, ValidationError):
        raise VerificationRecordError(
            f"{path}: is no file of `robomesh robot verify --out`: make it anew with that command"
        ) from None
