"""Errors of the protocol gateway.

ProtocolGatewayError
├── UnitError               bytes that are not a unit, or a record with data that do not fit its type
├── UnitFormatError         a value that a unit cannot hold: a separator in an item, or not finite
├── CodeTableError          a site file's table of type codes that cannot be used
├── CommandError            a command that the controller's protocol cannot express
├── LinkError               a unit that did not reach the controller's socket
│   ├── LinkDownError       there is no connection
│   ├── LinkCloggedError    the controller does not read, so the connection was closed
│   └── NotReadyError       the driver sends nothing now
├── AuthorityError          a failure of the audit log or of the motion check
│   ├── AuditError          an audit entry that is not on disk, or a line that is not an entry
│   └── CheckError          a motion that could not be checked, or not in time
└── GatewaySettingsError    settings that a gateway cannot use
"""

from robomesh import reason_codes as codes
from robomesh.reasons import Reason


class ProtocolGatewayError(Exception):
    """Base of the gateway's errors; its text is one line for people."""


class UnitError(ProtocolGatewayError):
    """A malformed unit. The stream turns it into an event, because it is a peer's bad input."""


class UnitFormatError(ProtocolGatewayError):
    """A value that a unit cannot hold."""


class CodeTableError(ProtocolGatewayError):
    """An invalid table of type codes; the text names the entry and the allowed ones."""


class CommandError(ProtocolGatewayError):
    """A command that the controller's protocol cannot express; `reason` says why.

    Args:
        why: A reason from the table, or a driver's own text.
    """

    def __init__(self, why: Reason | str) -> None:
        super().__init__(str(why))
        cause = codes.OTHER(detail=why) if isinstance(why, str) else why
        self.reason = codes.COMMAND_UNSUPPORTED(cause)


class LinkError(ProtocolGatewayError):
    """A unit that did not reach the controller's socket; `reason` says why."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason


class LinkDownError(LinkError):
    """There is no connection to the controller."""


class LinkCloggedError(LinkError):
    """The controller does not read, so a unit did not fit; the connection was closed."""


class NotReadyError(LinkError):
    """A command that a driver does not send in the controller's present state; nothing was sent."""


class AuthorityError(ProtocolGatewayError):
    """A failure of the audit log or of the motion check; `reason` says why."""

    def __init__(self, reason: Reason | str) -> None:
        super().__init__(str(reason))
        self.reason = codes.OTHER(detail=reason) if isinstance(reason, str) else reason


class AuditError(AuthorityError):
    """An entry that could not be written to the audit log, or a line that is not an entry."""


class CheckError(AuthorityError):
    """A motion that could not be checked, or not in time; the text says why."""


class GatewaySettingsError(ProtocolGatewayError):
    """Settings that a gateway cannot use."""
