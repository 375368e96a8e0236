"""What the site file says of quotas: `[quotas]`, what each name may ask for."""

from typing import Annotated

from pydantic import BaseModel, Field

from robomesh.quotas import DEFAULT_QUOTAS as DEFAULT
from robomesh.quotas import Quotas as QuotaSettings
from services.site_file.part import Quiet


class Quotas(BaseModel):
    """Of each asker; `robomesh/quotas.py` says of what."""

    model_config = Quiet
    views: Annotated[int, Field(ge=1, le=256)] = DEFAULT.views
    key_frames_a_minute: Annotated[float, Field(ge=1, le=60_000)] = DEFAULT.key_frames_a_minute
    checks: Annotated[int, Field(ge=1, le=16)] = DEFAULT.checks
    checks_a_minute: Annotated[float, Field(ge=1, le=60_000)] = DEFAULT.checks_a_minute
    # Less, and a piece of a download would wait for longer than it is waited for.
    recordings_mib_a_minute: Annotated[float, Field(ge=16, le=1 << 20)] = DEFAULT.recordings_mib_a_minute

    @property
    def settings(self) -> QuotaSettings:
        """For the services that keep them."""
        return QuotaSettings(**self.model_dump())
