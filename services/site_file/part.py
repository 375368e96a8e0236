"""What every part of the site file keeps to."""

from pydantic import ConfigDict

# A key that nobody knows is an error, and so is a number that is none.
Quiet = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
