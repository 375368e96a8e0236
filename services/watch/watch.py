"""The watch service: holds a site's alarms, looks at the mesh, and tells both."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Coroutine, Iterable
from dataclasses import dataclass
from pathlib import Path

from robomesh.clock import read_clock
from robomesh.errors import MessageError, NoAnswerError, RefusedError
from robomesh.ignored import PUBLICATION
from robomesh.keys import ROOT, WHOLE_SITE, check_name, is_replay
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.server import Request
from robomesh.session import Session
from robomesh.subscription import Subscription
from robomesh.texts import one_line
from robomesh.topics import check_operator
from services.watch.alarm_registry import Book
from services.watch.alarms import AlarmError
from services.watch.conditions import Condition, Judge, robot_conditions
from services.watch.consistency import SETTLED_S, Expected, mesh_conditions
from services.watch.mesh import Mesh

log = logging.getLogger(__name__)

_LOOK_S = 0.25
_ALARMS_EACH, _MESH_EACH = 4, 8  # looks
_CLOCKS_EACH_S = 2.0
_CLOCKS_AT_ONCE = 4
# Of other sites only these are asked for their clocks: of a thousand sites all would be too many.
_ASKED_ELSEWHERE = ("router", "watch")
# So long after everybody has settled nobody knows yet what is so: what stood before the start stands on.
_KNOWN_AFTER_S = 2.0
_NAMES_MOST = 200
# Keys that fit no key of the contract: so many are events, the rest is counted in the services' health.
_MOST_IGNORED, _LONGEST_IGNORED = 64, 200


@dataclass(frozen=True, kw_only=True)
class Settings:
    """A site's watch.

    Attributes:
        folder: Where alarms outlive a restart.
        settled_s: So long somebody must be gone, or twice there, to be told of [s].
    """

    site: str
    folder: Path = Path("watch")
    settled_s: float = SETTLED_S


async def serve(session: Session, settings: Settings) -> None:
    """Watch until cancelled."""
    check_name(settings.site, "site")
    await _Watch(session, settings).run()


class _Watch:
    """One run of the service."""

    def __init__(self, session: Session, settings: Settings) -> None:
        self._session, self._site, self._settled_s = session, settings.site, settings.settled_s
        self._mesh = Mesh()
        self._expected = Expected()
        self._states: dict[str, schema.ControllerState] = {}
        self._book = Book(settings.folder / f"{settings.site}.json", self._say)
        self._judge = Judge()
        self._events = session.declare_publisher(settings.site, WHOLE_SITE, "events/watch")
        self._alarms_topic = session.declare_publisher(settings.site, WHOLE_SITE, "alarms")
        self._mesh_topic = session.declare_publisher(settings.site, WHOLE_SITE, "mesh")
        self._controllers = session.subscribe(f"{ROOT}/{self._site}/*/controller", newest=1000)
        self._blind_until_s = self._unsettled_until_s = 0.0
        # Alarms whose teller has been replaced, and since when.
        self._orphans: dict[str, float] = {}
        self._ignored: set[str] = set()
        self._zenoh_id = str(session.zenoh_session.info.zid())
        session.measure("alarms", "Alarms that are not over and seen", lambda: len(self._book.alarms.held))
        session.measure("processes", "Processes of the mesh", lambda: len(self._mesh.processes))

    async def run(self) -> None:
        """Until cancelled."""
        await self._book.open()
        before = self._book.conditions()
        self._judge.begun = dict(before)
        self._expected.remember(before.values())
        self._session.answer(self._site, WHOLE_SITE, "alarms/request/*", self._answer)
        session, events = self._session, f"{ROOT}/{self._site}/*/events"
        work: list[Coroutine[None, None, None]] = [
            self._follow_states(),
            self._follow_events(session.subscribe(events, newest=1000)),
            self._follow_events(session.subscribe(f"{events}/*", newest=1000)),
            self._follow_health(session.subscribe(f"{ROOT}/*/{WHOLE_SITE}/health/*", newest=1000)),
            self._follow_presence(),
            self._read_clocks(),
            self._look(before),
        ]
        try:
            async with asyncio.TaskGroup() as group:
                for each in work:
                    group.create_task(each)
        finally:
            await self._book.close()

    # ------------------------------------------------------------ what comes

    async def _follow_states(self) -> None:
        async for sample in self._controllers:
            if is_replay(sample.parsed.robot):
                continue  # it was so then
            try:
                state = sample.message()
            except MessageError as error:
                log.warning("%s: %s", sample.key, error)
                continue
            assert isinstance(state, schema.ControllerState)
            self._states[sample.parsed.robot] = state

    async def _follow_events(self, subscription: Subscription) -> None:
        async for sample in subscription:
            if is_replay(sample.parsed.robot):
                continue  # it happened then
            try:
                message = sample.message()
            except MessageError as error:
                log.warning("%s: %s", sample.key, error)
                continue
            now, key, intake = time.time(), sample.parsed, self._book.intake
            if isinstance(message, schema.EventList):
                told_by = self._teller(key.robot, message.events[-1].source) if message.events else ""
                intake.remembered(key, message.events, now, told_by=told_by)
            elif isinstance(message, schema.Event):
                intake.live(key, message, now, told_by=self._teller(key.robot, message.source))

    def _teller(self, robot: str, service: str) -> str:
        """The process that says something as a service; empty: it is none, or one of several."""
        serving = self._mesh.serving(self._site, service, robot)
        return serving.pop() if len(serving) == 1 else ""

    async def _follow_health(self, subscription: Subscription) -> None:
        async for sample in subscription:
            try:
                health = sample.message()
            except MessageError as error:
                log.warning("%s: %s", sample.key, error)
                continue
            assert isinstance(health, schema.ServiceHealth)
            if sample.parsed.topic != f"health/{health.service}.{health.id}":
                # What it says of itself names keys that it is asked on.
                self._session.ignored.note(PUBLICATION, f"{sample.key} of another process's name")
                continue
            if sample.parsed.site == self._site:
                self._say_ignored(health.ignored_examples)
            # The last words of who has gone are no sign of life.
            if sample.live or health.id in self._mesh.present:
                self._mesh.see(sample.parsed.site, health, sample.received)

    async def _follow_presence(self) -> None:
        async for who, alive in self._session.watch_presence():
            (self._mesh.come if alive else self._mesh.go)(who)

    async def _read_clocks(self) -> None:
        turns = asyncio.Semaphore(_CLOCKS_AT_ONCE)

        async def read(site: str, identity: str) -> None:
            async with turns:
                # Its health says whether it is there; a time that is none is no reading.
                with contextlib.suppress(NoAnswerError, ValueError):
                    self._mesh.read(identity, await read_clock(self._session, site, identity, hops=True))

        while True:
            asked = [
                read(process.site, identity)
                for identity, process in tuple(self._mesh.processes.items())
                if identity != self._session.identity
                and (process.site == self._site or process.health.service in _ASKED_ELSEWHERE)
            ]
            await asyncio.gather(*asked)
            self._mesh.forget_hops()
            await asyncio.sleep(_CLOCKS_EACH_S)

    # ------------------------------------------------------ what is made of it

    async def _look(self, before: dict[str, Condition]) -> None:
        looks, begun_s = 0, time.monotonic()
        while True:
            now, now_s = time.time(), time.monotonic()
            if now_s - begun_s > self._settled_s + _KNOWN_AFTER_S:
                before = {}
            self._say_ignored(tuple(self._session.ignored.examples))
            self._forget_robots()
            self._mesh.forget_gone(now_s)
            if self._sees(now_s):
                self._weigh(now, now_s, before)
            if self._book.look(now) or looks % _ALARMS_EACH == 0:
                self._alarms_topic.put(self._book.message(self._site))
            if looks % _MESH_EACH == 0:
                self._mesh_topic.put(self._mesh.state(self._site, self._zenoh_id, now_s))
            looks += 1
            await asyncio.sleep(_LOOK_S)

    def _sees(self, now_s: float) -> bool:
        """Whether what is not seen is not there: no while our own router is not reached, and a moment after.

        What a line lost while it was cut is no loss of a line that stands.
        """
        if not self._session.connected:
            self._blind_until_s = now_s + self._settled_s
        present = {who.site for who in self._mesh.services()}
        if now_s < self._blind_until_s or not self._expected.sites <= present:
            self._unsettled_until_s = now_s + self._settled_s
        if now_s < self._unsettled_until_s:
            self._mesh.forget_losses()
        return now_s >= self._blind_until_s

    def _weigh(self, now: float, now_s: float, before: dict[str, Condition]) -> None:
        """Conditions that have begun are alarms; what is over is told.

        Args:
            before: What stood before a restart, as long as it is not known whether it still does.
        """
        conditions = [
            condition
            for robot, state in self._states.items()
            for condition in robot_conditions(robot, state, self._age_s(robot))
        ]
        conditions += mesh_conditions(
            self._mesh,
            self._site,
            here=self._session.identity,
            expected=self._expected,
            begun=frozenset(self._judge.begun),
            now=now,
            now_s=now_s,
            settled_s=self._settled_s,
        )
        conditions += self._book.conditions_of_its_own()
        there = {condition.id for condition in conditions}
        conditions += [condition for name, condition in before.items() if name not in there]
        began, changed, over = self._judge.judge(conditions, now_s)
        for condition in began:
            self._book.begin(condition, now)
        for condition in changed:
            self._book.change(condition)
        for condition in over:
            self._book.end(condition, now)
        self._end_orphans(now, now_s)

    def _end_orphans(self, now: float, now_s: float) -> None:
        """Who has taken another's place does not know what that one had told, and ends none of it."""
        alarms, orphans = self._book.alarms, {}
        for alarm in alarms.held.values():
            if alarm.stands and alarm.told_by:
                serving = self._mesh.serving(self._site, alarm.source, alarm.robot)
                if serving and alarm.told_by not in serving:
                    orphans[alarm.id] = self._orphans.get(alarm.id, now_s)
        self._orphans = orphans
        for name, since_s in orphans.items():
            if now_s - since_s >= self._settled_s:
                alarms.orphan(name, now)

    def _forget_robots(self) -> None:
        """Whose gateway is gone, once somebody knows: nothing will say what they are in."""
        for name, robots in self._expected.without_gateway.items():
            alarm = self._book.alarms.held.get(name)
            if name in self._judge.begun and (alarm is None or not alarm.stands):
                for robot in robots:
                    self._states.pop(robot, None)

    def _age_s(self, robot: str) -> float:
        age_s = self._controllers.age_s(f"{ROOT}/{self._site}/{robot}/controller")
        return 0.0 if age_s is None else age_s

    def _say_ignored(self, examples: Iterable[str]) -> None:
        """Make each key that a process has ignored one event, however many processes have."""
        for example in examples:
            shown = one_line(example, _LONGEST_IGNORED)
            if shown not in self._ignored and len(self._ignored) < _MOST_IGNORED:
                self._ignored.add(shown)
                text = f"ignored: {shown}: it fits no key of the mesh; a program uses a wrong name"
                self._say(schema.Event.WARNING, "mesh.key_ignored", text, {"key": shown})

    def _say(self, severity: schema.Event.Severity, code: str, text: str, values: dict[str, str]) -> None:
        event = schema.Event(severity=severity, code=code, text=text, source="watch", values=values)
        event.timestamp.GetCurrentTime()
        self._events.put(event)
        log.log(logging.INFO if severity == schema.Event.INFO else logging.WARNING, "%s", text)

    async def _answer(self, request: Request) -> schema.AlarmList:
        """Acknowledge, shelve, unshelve; on disk before it is answered.

        Raises:
            RefusedError: Why not.
        """
        asked = request.message
        assert isinstance(asked, schema.AlarmRequest)
        by = check_operator(request.chunk[:_NAMES_MOST])
        try:
            await self._book.change_by(asked, by, time.time())
        except AlarmError as error:
            raise RefusedError(error.reason) from None
        message = self._book.message(self._site)
        self._alarms_topic.put(message)
        return message
