"""What a recorder has to say: events, of a robot or of the whole site."""

import logging

from robomesh.keys import WHOLE_SITE
from robomesh.publisher import Publisher
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import Session
from services.recorder.disk import Disk, Taken

log = logging.getLogger(__name__)

_S = schema.Event.Severity
_LEVEL = {_S.INFO: logging.INFO, _S.WARNING: logging.WARNING}
# A disk that takes this long is told of.
_SLOW_S = 0.8
_GIVEN_UP = {
    Taken.NO_VIDEO: "video is recorded no more",
    Taken.STATES_ONLY: "only states, events and commands are recorded: no video, no frames, no kinematics",
    Taken.NOTHING: "nothing is recorded",
}


class Notices:
    """Publishes events at `events/recorder`."""

    def __init__(self, session: Session, site: str) -> None:
        self._session, self._site = session, site
        self._publishers: dict[str, Publisher] = {}
        self._now: dict[tuple[str, str], str] = {}
        self.ready(WHOLE_SITE)

    def ready(self, robot: str) -> None:
        """Be ready to say something of a robot at once."""
        if robot not in self._publishers:
            self._publishers[robot] = self._session.declare_publisher(self._site, robot, "events/recorder")

    def say(self, robot: str, severity: schema.Event.Severity, code: str, text: str, **values: str) -> None:
        """An event of a robot, or of the whole site (`-`)."""
        log.log(_LEVEL.get(severity, logging.ERROR), "%s: %s", robot, text)
        event = schema.Event(severity=severity, code=code, text=text, source="recorder", values=values)
        event.timestamp.GetCurrentTime()
        self.ready(robot)
        self._publishers[robot].put(event)

    def is_so(
        self, code: str, severity: schema.Event.Severity, text: str, over: str, *, robot: str = WHOLE_SITE
    ) -> None:
        """What lasts, told when it begins, changes and ends; an empty text: it is over."""
        if self._now.get((robot, code), "") == text:
            return
        self._now[robot, code] = text
        self.say(robot, severity if text else _S.INFO, code, text or over)


def disk_notices(notices: Notices, disk: Disk) -> None:
    """Say what there is to say of the disk."""
    taken = disk.taken
    notices.is_so(
        "recorder.gives_up",
        _S.CRITICAL,
        f"the disk cannot take everything: {_GIVEN_UP[taken]}" if taken is not Taken.ALL else "",
        "everything is recorded again",
    )
    notices.is_so(
        "recorder.disk_slow",
        _S.CRITICAL,
        "the disk is slow: what is recorded waits in memory" if disk.behind_s > _SLOW_S else "",
        "the disk takes what is recorded again",
    )
    notices.is_so(
        "recorder.space",
        _S.WARNING,
        f"little space is left in {disk.folder}" if disk.warned else "",
        f"there is space again in {disk.folder}",
    )
