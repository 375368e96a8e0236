"""Model settings of all parts of the site file."""

from pydantic import ConfigDict

# Unknown keys are errors, and so are NaN and infinity.
PART_CONFIG = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
