"""Events of refused sign-ins and tokens, few enough for the event list under a flood."""

import time
from collections.abc import Callable, Mapping

from robomesh.schemas.robomesh_pb2 import Event

PublishEvent = Callable[[Event.Severity, str, str, Mapping[str, str]], None]

_EVERY_S = 1.0


class RefusalEvents:
    """Publishes one refusal a second; its text counts the refusals since the last one.

    Args:
        publish_event: Publishes an event: severity, code, text, values.
        code: The events' code.
    """

    def __init__(self, publish_event: PublishEvent, code: str) -> None:
        self._publish_event, self._code = publish_event, code
        self._refusals, self._published_at = 0, -_EVERY_S

    def publish(self, text: str, values: Mapping[str, str]) -> None:
        """Publish a refusal, or only count it if another was published within the last second."""
        self._refusals += 1
        now = time.monotonic()
        if now - self._published_at < _EVERY_S:
            return
        more = f" (and {self._refusals - 1} more refusals)" if self._refusals > 1 else ""
        self._publish_event(Event.WARNING, self._code, f"{text}{more}", values)
        self._refusals, self._published_at = 0, now
