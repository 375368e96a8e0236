"""The methods of a driver."""

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

from protocol_gateway.seam.capabilities import Capabilities, StopEnds
from protocol_gateway.seam.commands import ControllerCommand
from protocol_gateway.seam.effects import Channel, Effects


@runtime_checkable
class FollowsControl(Protocol):
    """Addition to `Driver` that receives the state of control."""

    def controlled(self, taken: bool, now_s: float) -> Effects:
        """Handle the begin of control by an operator, also after another one, or its end.

        The stop of a lost lease precedes it.
        """
        ...


@runtime_checkable
class StopDepends(Protocol):
    """Addition to `Driver` whose stop depends on the state of the controller, such as its mode."""

    def stop_ends_now(self, now_s: float) -> StopEnds | None:
        """Return whose motion `Stop` ends now; None: the controller refuses it, or that is not known.

        It is asked only while a channel that carries STOP is connected.
        """
        ...


class Driver(Protocol):
    """Driver of a controller's protocol, without I/O.

    `FollowsControl` and `StopDepends` add methods that it may have.
    """

    @property
    def ports(self) -> frozenset[str]:
        """Names of the channels with a port of their own, which the site file's `ports` may replace."""
        ...

    @property
    def requests_a_second(self) -> float:
        """Most `Send` effects a second that are not the answer to `command`: greetings and questions.

        The link sends no more: 0 means that nothing is ever sent unasked. Those beside `FateUnknown` do not
        count.
        """
        ...

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities of the driver, which never change."""
        ...

    def started(self, now_s: float) -> Effects:
        """Begin, usually with `Open`; called again after a failure of the gateway for this robot."""
        ...

    def opened(self, channel: Channel, now_s: float) -> Effects:
        """Begin a new connection: discard unfinished units and open questions, and greet."""
        ...

    def received(self, channel: Channel, data: bytes, now_s: float) -> Effects:
        """Read the next bytes, split anywhere, or a datagram; invalid ones give a MalformedReceived."""
        ...

    def skipped(self, channel: Channel, now_s: float) -> Effects:
        """Go on after bytes were discarded, because the controller sent far too much."""
        ...

    def closed(self, channel: Channel, now_s: float) -> Effects:
        """Note that a connection has ended, or that an attempt to connect failed."""
        ...

    def timer_ended(self, ended: Mapping[str, float], now_s: float) -> Effects:
        """Do what timers were set for.

        Args:
            ended: Names of the timers of which the time has come, with that time [s].
        """
        ...

    def prepare(self, *commands: ControllerCommand) -> Any:
        """Return what `command` takes, for commands that the controller executes in order, all or none.

        It changes nothing. The gateway writes its audit entry afterwards, and then sends exactly this. `Stop`
        can be prepared at any time.

        Raises:
            CommandError: If the protocol cannot express them (wrong joint count, number not finite).
        """
        ...

    def command(self, prepared: Any, now_s: float) -> Effects:
        """Send what `prepare` returned.

        Raises:
            NotReadyError: If the driver sends nothing now; never for `Stop`.
        """
        ...
