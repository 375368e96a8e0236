"""Events of the recorder, for a robot or for the whole site."""

import logging
from collections.abc import Mapping

from robomesh.contract.keys import WHOLE_SITE
from robomesh.contract.messages import reason_message
from robomesh.publications.publisher import Publisher
from robomesh.reasons import Reason
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from services.recorder.disk import Disk, RecordingLevel

log = logging.getLogger(__name__)

_S = schema.Event.Severity
_LEVEL = {_S.INFO: logging.INFO, _S.WARNING: logging.WARNING}
# A disk that is further behind causes an event.
_SLOW_S = 0.8
_DROPPED = {
    RecordingLevel.NO_VIDEO: "video is not recorded",
    RecordingLevel.STATES_ONLY: (
        "only states, events and commands are recorded: no video, no frames, no kinematics"
    ),
    RecordingLevel.NOTHING: "nothing is recorded",
}


class EventReporter:
    """Publisher of `events/recorder`."""

    def __init__(self, session: Session, site: str) -> None:
        self._session, self._site = session, site
        self._publishers: dict[str, Publisher] = {}
        self._states: dict[tuple[str, str], str] = {}
        self.declare(WHOLE_SITE)

    def declare(self, robot: str) -> None:
        """Declare a robot's publisher in advance, so that its first event is not delayed."""
        if robot not in self._publishers:
            self._publishers[robot] = self._session.declare_publisher(self._site, robot, "events/recorder")

    def report(
        self, robot: str, severity: schema.Event.Severity, code: str, text: str, **values: str
    ) -> None:
        """Log and publish an event of a robot, or of the whole site (`-`)."""
        self._publish(
            robot, schema.Event(severity=severity, code=code, text=text, source="recorder", values=values)
        )

    def _publish(self, robot: str, event: schema.Event) -> None:
        log.log(_LEVEL.get(event.severity, logging.ERROR), "%s: %s", robot, event.text)
        event.timestamp.GetCurrentTime()
        self.declare(robot)
        self._publishers[robot].put(event)

    def report_reason(
        self, robot: str, severity: schema.Event.Severity, reason: Reason, values: Mapping[str, str]
    ) -> None:
        """Log and publish an event with a reason, which the page shows in its language."""
        event = schema.Event(
            severity=severity,
            code=reason.code,
            text=reason.text,
            source="recorder",
            values={**reason.values, **values},
            reason=reason_message(reason),
        )
        self._publish(robot, event)

    def report_state(
        self, code: str, severity: schema.Event.Severity, text: str, over: str, *, robot: str = WHOLE_SITE
    ) -> None:
        """Report a lasting condition when it begins, changes or ends; an empty text means that it is over."""
        if self._states.get((robot, code), "") == text:
            return
        self._states[robot, code] = text
        self.report(robot, severity if text else _S.INFO, code, text or over)


def report_disk(events: EventReporter, disk: Disk) -> None:
    """Report the disk's conditions."""
    level = disk.level
    events.report_state(
        "recorder.gives_up",
        _S.CRITICAL,
        f"the disk cannot store everything: {_DROPPED[level]}" if level is not RecordingLevel.ALL else "",
        "everything is recorded again",
    )
    events.report_state(
        "recorder.disk_slow",
        _S.CRITICAL,
        "the disk is slow: recorded data waits in memory" if disk.behind_s > _SLOW_S else "",
        "the disk is fast enough again",
    )
    events.report_state(
        "recorder.space",
        _S.WARNING,
        f"little space is left in {disk.folder}" if disk.is_low else "",
        f"there is space again in {disk.folder}",
    )
