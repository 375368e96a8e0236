"""Errors of the protocol gateway.

ProtocolGatewayError
├── UnitError               bytes that are not a unit, or a record that is not what its type says
├── UnitFormatError         a value that no unit can hold: a separator in an item, a number that is not finite
├── CodeTableError          a site file's table of type codes that cannot be used
├── CommandError            a command that the controller's protocol cannot say
├── LinkError               a unit that did not reach the controller's socket
│   ├── LinkDownError       there is no connection
│   └── LinkCloggedError    the controller does not read: the connection was given up
├── AuthorityError          a failure of what guards the robot
│   ├── AuditError          an audit entry that is not on disk, or a line that is not an entry
│   └── CheckError          a motion that cannot be checked, or not in time
└── GatewaySettingsError    settings that no gateway can run with
"""

from robomesh import reason_codes as codes
from robomesh.reasons import Reason


class ProtocolGatewayError(Exception):
    """Base of the gateway's errors; its text is one line for people."""


class UnitError(ProtocolGatewayError):
    """A unit that is malformed. A peer's bad input: it becomes an event at the edge of the core."""


class UnitFormatError(ProtocolGatewayError):
    """A unit that cannot be written as it was asked for."""


class CodeTableError(ProtocolGatewayError):
    """A table of type codes that cannot be used; the text names the entry and says what would be right."""


class CommandError(ProtocolGatewayError):
    """A command that the controller's protocol cannot express; `reason` says why."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.reason = codes.COMMAND_UNSUPPORTED(detail=text)


class LinkError(ProtocolGatewayError):
    """A unit that did not reach the controller's socket; `reason` says why."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason.text)
        self.reason = reason


class LinkDownError(LinkError):
    """There is no connection to the controller."""


class LinkCloggedError(LinkError):
    """The controller does not read, so a unit did not fit; the connection was given up with it."""


class AuthorityError(ProtocolGatewayError):
    """A failure of what guards the robot; `reason` says why."""

    def __init__(self, reason: Reason | str) -> None:
        super().__init__(str(reason))
        self.reason = codes.OTHER(detail=reason) if isinstance(reason, str) else reason


class AuditError(AuthorityError):
    """An entry that could not be written to the audit log, or a line that is not an entry."""


class CheckError(AuthorityError):
    """A motion that cannot be checked, or not in time; the text says why."""


class GatewaySettingsError(ProtocolGatewayError):
    """Settings that no gateway can run with."""
