"""The site file's `[quotas]`: limits for each client's name."""

from typing import Annotated

from pydantic import Field

from robomesh.contract.quotas import DEFAULT_QUOTAS as DEFAULT
from robomesh.contract.quotas import Quotas as QuotaSettings
from robots.schema.toml_table import TomlTable


class Quotas(TomlTable):
    """Limits for each client's name; `robomesh/contract/quotas.py` describes each."""

    views: Annotated[int, Field(ge=1, le=256)] = DEFAULT.views
    key_frames_a_minute: Annotated[float, Field(ge=1, le=60_000)] = DEFAULT.key_frames_a_minute
    checks: Annotated[int, Field(ge=1, le=16)] = DEFAULT.checks
    checks_a_minute: Annotated[float, Field(ge=1, le=60_000)] = DEFAULT.checks_a_minute
    # With less, a piece of a download would wait longer than its request's timeout.
    recordings_mib_a_minute: Annotated[float, Field(ge=16, le=1 << 20)] = DEFAULT.recordings_mib_a_minute
    program_saves_a_minute: Annotated[float, Field(ge=1, le=60_000)] = DEFAULT.program_saves_a_minute
    notes_a_minute: Annotated[float, Field(ge=1, le=60_000)] = DEFAULT.notes_a_minute
    cell_changes_a_minute: Annotated[float, Field(ge=1, le=60_000)] = DEFAULT.cell_changes_a_minute

    @property
    def settings(self) -> QuotaSettings:
        """The limits as the services take them."""
        return QuotaSettings(**self.model_dump())
