"""Parts of drivers that only read."""

from collections.abc import Mapping
from typing import Any

from protocol_gateway.seam.commands import ControllerCommand
from protocol_gateway.seam.effects import Effects
from protocol_gateway.seam.errors import CommandError, GatewaySettingsError
from robomesh import reason_codes


class OnlyReads:
    """Base of drivers that only read: they refuse each command, and send none."""

    def prepare(self, *commands: ControllerCommand) -> Any:
        """Refuse: nothing is ever commanded.

        Raises:
            CommandError: Always.
        """
        raise CommandError(reason_codes.READS_ONLY())

    def command(self, prepared: Any, now_s: float) -> Effects:
        """Send nothing."""
        return ()


def check_no_type_codes(protocol: str, codes: Mapping[int, str]) -> None:
    """Raise GatewaySettingsError if the site file declares type codes."""
    if codes:
        raise GatewaySettingsError(f"protocol '{protocol}' has no type codes: remove codes")
