"""Errors of the library.

BusError
├── KeyNameError            a site, robot, topic or operator name that no key can hold
├── UnknownTopicError       a topic that the table does not have
├── MessageError            bytes or JSON that are not the message they should be
├── SessionError            a session that cannot be opened as it is configured
├── RefusedError            a request that its owner refused, with the reason
│   ├── BusyError           a request that its owner has not begun or finished: it is busy
│   ├── QuotaError          more than one name may ask for; it may be asked again later
│   └── NoRightError        what this end's certificate may not do: it was not even asked
└── NoAnswerError           a request that nobody answered in time
    └── BrokenAnswerError   a long answer that began, and whose rest did not come
"""

from robomesh import reason_codes as codes
from robomesh.reasons import Reason


class BusError(Exception):
    """Base of the library's errors; its text is one line for people."""


class KeyNameError(BusError):
    """A name that cannot stand in a key."""


class UnknownTopicError(BusError):
    """A topic that is not in the table of `robomesh.topics`."""


class MessageError(BusError):
    """A payload that is not the message that it should be."""


class SessionError(BusError):
    """A session that cannot be opened as it is configured."""


class RefusedError(BusError):
    """A request that was refused; the text says what was wrong and what would be right.

    Raised by a request's handler to refuse it, and by `ask` at the other end.

    Args:
        reason: Of the table; a bare text is a refusal without a code of its own.
        text: What people read; the reason's sentence, unless given.

    Attributes:
        reason: The code and its parameters.
    """

    def __init__(self, reason: Reason | str, *, text: str = "") -> None:
        super().__init__(text or str(reason))
        self.reason = codes.OTHER(detail=reason) if isinstance(reason, str) else reason


class BusyError(RefusedError):
    """A request that its owner has not begun, or not finished, because it is busy; it may be asked again."""


class QuotaError(RefusedError):
    """More than one name may ask for; the text names the quota and when to ask again.

    Attributes:
        again_s: When there is something left again, as far as its owner knows [s].
    """

    def __init__(self, reason: Reason | str, *, again_s: float) -> None:
        super().__init__(reason)
        self.again_s = again_s


class NoRightError(RefusedError):
    """What the certificate of this end may not do; the text says who may."""


class NoAnswerError(BusError):
    """Nobody answered a request in time: no owner, no route, or too slow."""


class BrokenAnswerError(NoAnswerError):
    """A long answer that began, and whose rest did not come; the text says how much did."""
