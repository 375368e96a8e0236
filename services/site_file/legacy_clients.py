"""The site file's part on old client programs: where they attach to a robot, and who of them commands."""

from typing import Annotated, Any

from pydantic import BaseModel, Field, StrictBool, field_validator, model_validator

from protocol_gateway.foreign_text import LONGEST
from protocol_gateway.legacy.settings import LegacySettings, plain_address
from robomesh import keys
from robomesh.errors import KeyNameError
from services.errors import ListenError
from services.site_file.listen_address import check_reach, is_loopback, split_address
from services.site_file.part import Quiet


class Commander(BaseModel):
    """An address whose old client programs may command, and in whose name."""

    model_config = Quiet
    address: str
    operator: str = ""

    @model_validator(mode="before")
    @classmethod
    def _alone(cls, value: Any) -> Any:
        return {"address": value} if isinstance(value, str) else value

    @field_validator("address")
    @classmethod
    def _address(cls, address: str) -> str:
        try:
            return plain_address(address)
        except ValueError:
            raise ValueError("should be an IP address, as in 10.0.0.9") from None

    @field_validator("operator")
    @classmethod
    def _operator(cls, operator: str) -> str:
        if len(operator) > LONGEST:
            raise ValueError(f"a name has at most {LONGEST} characters")
        try:
            return keys.check_chunk(operator) if operator else operator
        except KeyNameError as error:
            raise ValueError(str(error)) from None

    @property
    def name(self) -> str:
        """The operator's name; an address alone commands in its own."""
        return self.operator or self.address


class LegacyClients(BaseModel):
    """Where old client programs attach to a robot as if the gateway were its controller."""

    model_config = Quiet
    listen: str
    commanders: tuple[Commander, ...] = ()
    most: Annotated[int, Field(ge=1, le=1000, strict=True)] = 16
    insecure: StrictBool = False

    @field_validator("listen")
    @classmethod
    def _listen(cls, listen: str) -> str:
        try:
            split_address(listen)
        except ListenError as error:
            raise ValueError(str(error)) from None
        return listen

    @field_validator("commanders")
    @classmethod
    def _commanders(cls, commanders: tuple[Commander, ...]) -> tuple[Commander, ...]:
        names: dict[str, str] = {}
        for each in commanders:
            if names.setdefault(each.address, each.name) != each.name:
                raise ValueError(
                    f"{each.address} commands as {names[each.address]} and as {each.name}: one name is right"
                )
        return commanders

    @model_validator(mode="after")
    def _reach(self) -> "LegacyClients":
        host, _ = split_address(self.listen)
        if not self.insecure and not is_loopback(host):
            raise ValueError(
                f"others can reach {host}, and the protocol has no TLS: listen on 127.0.0.1, or write "
                "insecure = true"
            )
        return self

    def warning(self, what: str) -> str | None:
        """What has to be said of it at each start; None: nothing."""
        host, _ = split_address(self.listen)
        return check_reach(what, host, secured=False, insecure=self.insecure)

    @property
    def settings(self) -> LegacySettings:
        """As the gateway takes it."""
        host, port = split_address(self.listen)
        commanders = {each.address: each.name for each in self.commanders}
        return LegacySettings(host=host, port=port, commanders=commanders, most=self.most)
