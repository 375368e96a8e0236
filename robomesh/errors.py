"""Errors of the library.

RobomeshError
├── SessionError            a session that cannot be opened with its settings
│   └── ForkedError         a session of the process from which this one was forked
├── ListenError             a service cannot listen on an address
│   └── UnavailableError    it cannot now: the address is in use, or not there
├── NoAnswerError           a request without an answer in time
│   └── BrokenAnswerError   a long answer that ended early
└── CodedError              an error with a reason of the table
    ├── KeyNameError        a site, robot, topic or operator name that is invalid in a key
    ├── UnknownTopicError   a topic that is not in the table
    ├── MessageError        bytes or JSON that are not the expected message
    ├── MotionError         a motion that ended before its target, with the reason
    ├── RecordingsError     errors of recordings, in robomesh.recordings.errors
    └── RefusedError        a request that its owner refused, with the reason
        ├── BusyError       a request that its owner is too busy to do
        ├── QuotaError      a request over the caller's quota; it may be repeated later
        └── NoRightError    a request that our certificate does not allow; it was not sent
"""

from robomesh import reason_codes as codes
from robomesh.reasons import Reason


class RobomeshError(Exception):
    """Base of the library's errors; the text is one line for people."""


class SessionError(RobomeshError):
    """A session that cannot be opened with its settings."""


class ForkedError(SessionError):
    """A session of the process from which this one was forked; open one here."""


class ListenError(RobomeshError):
    """A service cannot listen on an address: in use, unavailable, or not permitted."""


class UnavailableError(ListenError):
    """A service cannot listen on an address now: another program uses it, or its network is not there yet."""


class CodedError(RobomeshError):
    """An error with a reason of the table.

    Args:
        reason: A reason from the table; a plain text has the code `other`.
        text: Sentence for people; by default the reason's.

    Attributes:
        reason: The code and its parameters.
    """

    def __init__(self, reason: Reason | str, *, text: str = "") -> None:
        super().__init__(text or str(reason))
        self.reason = codes.OTHER(detail=reason) if isinstance(reason, str) else reason

    @property
    def code(self) -> str:
        """The reason's code: "lease.held"."""
        return self.reason.code


class KeyNameError(CodedError):
    """A name that is invalid in a key."""


class UnknownTopicError(CodedError):
    """A topic that is not in the table of `robomesh.contract.topics`."""


class MessageError(CodedError):
    """A payload that is not the expected message."""


class RefusedError(CodedError):
    """A refused request; the text says what was wrong and what to do.

    A request's handler raises it to refuse the request; `ask` raises it at the caller.
    """


class MotionError(CodedError):
    """A motion or program that ended before its target: stopped, control lost, a fault."""


class BusyError(RefusedError):
    """A request that its owner did not begin or finish because it is busy; it may be repeated."""


class QuotaError(RefusedError):
    """A request over the caller's quota; the text names the quota and when to repeat it.

    Attributes:
        again_s: Time until the quota allows the request again, as the owner estimates it [s].
    """

    def __init__(self, reason: Reason | str, *, again_s: float = 0.0) -> None:
        super().__init__(reason)
        self.again_s = again_s


class NoRightError(RefusedError):
    """A request that our certificate does not allow; the text says which roles may send it."""


class NoAnswerError(CodedError):
    """A request without an answer in time: no owner, no route, or too slow."""


class BrokenAnswerError(NoAnswerError):
    """A long answer that ended early; the text says how many bytes arrived."""
