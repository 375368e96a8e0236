"""Base of the models of TOML files' tables."""

from pydantic import BaseModel, ConfigDict


class TomlTable(BaseModel):
    """A table of a TOML file; an unknown key, NaN and infinity are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
