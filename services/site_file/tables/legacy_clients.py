"""The site file's part on legacy clients: where they connect, and which of them may command."""

from typing import Annotated, Any

from pydantic import Field, StrictBool, field_validator, model_validator

from protocol_gateway.legacy.settings import LegacySettings, plain_address
from protocol_gateway.seam.text_limits import LONGEST_TEXT
from robomesh.contract import keys
from robomesh.errors import KeyNameError, ListenError
from robomesh.listen_address import check_reach, is_loopback, split_address
from robots.schema.toml_table import TomlTable


class Commander(TomlTable):
    """An address from which legacy clients may command; in place of the table, the address alone.

    Attributes:
        address: IP address.
        operator: The operator's name for its commands; empty: the address.
    """

    address: str
    operator: str = ""

    @model_validator(mode="before")
    @classmethod
    def _address_only(cls, value: Any) -> Any:
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
        if len(operator) > LONGEST_TEXT:
            raise ValueError(f"a name has at most {LONGEST_TEXT} characters")
        try:
            return keys.check_chunk(operator) if operator else operator
        except KeyNameError as error:
            raise ValueError(str(error)) from None

    @property
    def name(self) -> str:
        """The operator's name; by default the address."""
        return self.operator or self.address


class LegacyClients(TomlTable):
    """The address on which the gateway serves legacy clients as if it were the robot's controller.

    Attributes:
        listen: Address, as in `127.0.0.1:5401`.
        commanders: IP addresses from which programs may command; all others only read.
        most: Largest number of clients.
        insecure: Accept an address that other machines reach: the protocol has no TLS.
    """

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
                    f"{each.address} commands as {names[each.address]} and as {each.name}: give it one name"
                )
        return commanders

    @model_validator(mode="after")
    def _reach(self) -> "LegacyClients":
        host, _ = split_address(self.listen)
        if not self.insecure and not is_loopback(host):
            raise ValueError(
                f"other machines can reach {host}, but there is no TLS: listen on 127.0.0.1, or write "
                "insecure = true"
            )
        return self

    def warning(self, what: str) -> str | None:
        """Return the warning to log at each start, or None."""
        host, _ = split_address(self.listen)
        return check_reach(what, host, secured=False, insecure=self.insecure)

    @property
    def settings(self) -> LegacySettings:
        """The settings as the gateway takes them."""
        host, port = split_address(self.listen)
        commanders = {each.address: each.name for each in self.commanders}
        return LegacySettings(host=host, port=port, commanders=commanders, most=self.most)
