"""The watch service: keeps a site's alarms, observes the mesh, and publishes both."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Coroutine, Iterable

from robomesh.contract.ignored import PUBLICATION
from robomesh.contract.keys import ROOT, WHOLE_SITE, check_name, is_replay
from robomesh.contract.topics import check_operator
from robomesh.errors import MessageError, NoAnswerError, RefusedError
from robomesh.publications.subscription import Subscription
from robomesh.publications.wall_clock import ForwardClock
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.service.clock import read_clock
from robomesh.texts import one_line
from robomesh.wire.session import Session
from services.watch.alarm_registry import AlarmRegistry
from services.watch.alarms import AlarmError
from services.watch.conditions import Condition, ConditionTracker, robot_conditions
from services.watch.consistency import Expected, largest_clock_offset_s, mesh_conditions
from services.watch.observed_mesh import ObservedMesh
from services.watch.settings import Settings

log = logging.getLogger(__name__)

_ROUND_S = 0.25
_ALARMS_EACH, _MESH_EACH = 4, 8  # rounds of `_run_checks`
_CLOCKS_EACH_S = 2.0
_CLOCKS_AT_ONCE = 4
# Clocks of other sites: only these services are read, because thousands of services would be too many.
_ASKED_ELSEWHERE = ("router", "watch")
# Until this long after presence has settled, conditions from before the start count as active.
_KNOWN_AFTER_S = 2.0
_NAMES_MOST = 200
# Keys outside the contract: this many become events; the services' health counts all.
_MOST_IGNORED, _LONGEST_IGNORED = 64, 200


async def serve(session: Session, settings: Settings) -> None:
    """Watch a site until cancelled."""
    check_name(settings.site, "site")
    await _Watch(session, settings).run()


class _Watch:
    """One run of the service."""

    def __init__(self, session: Session, settings: Settings) -> None:
        self._session, self._site, self._settled_s = session, settings.site, settings.settled_s
        self._mesh = ObservedMesh()
        # A clock that is set back must not hide an alarm for longer than it was shelved.
        self._clock = ForwardClock()
        self._expected = Expected(dict.fromkeys(settings.expected, ""))
        self._states: dict[str, schema.ControllerState] = {}
        self._registry = AlarmRegistry(settings.folder / f"{settings.site}.json", self._publish_event)
        self._conditions = ConditionTracker()
        self._events = session.declare_publisher(settings.site, WHOLE_SITE, "events/watch")
        self._alarms_topic = session.declare_publisher(settings.site, WHOLE_SITE, "alarms")
        self._mesh_topic = session.declare_publisher(settings.site, WHOLE_SITE, "mesh")
        self._controllers = session.subscribe(f"{ROOT}/{self._site}/*/controller", newest=1000)
        self._blind_until_s = self._unsettled_until_s = 0.0
        # Alarms without their reporter, which was replaced, and since when.
        self._orphans: dict[str, float] = {}
        self._ignored: set[str] = set()
        self._zenoh_id = str(session.zenoh_session.info.zid())
        session.measure(
            "alarms", "Alarms that are not over and seen", lambda: len(self._registry.alarms.by_id)
        )
        session.measure(
            "alarm",
            "1: the alarm is active and not shelved",
            self._registry.alarms.active,
            labels=("robot", "alarm", "priority"),
        )
        session.measure(
            "alarms_active",
            "Alarms that are active and not shelved",
            self._registry.alarms.active_by_priority,
            labels=("priority",),
        )
        session.measure(
            "clock_off_seconds",
            "Certain difference between the watch's clock and the farthest host's",
            lambda: largest_clock_offset_s(self._mesh, session.identity),
        )
        session.measure("processes", "Processes of the mesh", lambda: len(self._mesh.processes))

    async def run(self) -> None:
        """Run until cancelled."""
        await self._registry.open()
        before = self._registry.conditions()
        self._conditions.active = dict(before)
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
            self._run_checks(before),
        ]
        try:
            async with asyncio.TaskGroup() as group:
                for each in work:
                    group.create_task(each)
        finally:
            await self._registry.close()

    # ------------------------------------------------------------ inputs

    async def _follow_states(self) -> None:
        async for sample in self._controllers:
            if is_replay(sample.parsed.robot):
                continue  # a replay, not the present
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
                continue  # a replay, not the present
            try:
                message = sample.message()
            except MessageError as error:
                log.warning("%s: %s", sample.key, error)
                continue
            now, key, events = self._clock.now_s(), sample.parsed, self._registry.events
            if isinstance(message, schema.EventList):
                reporter = self._reporter(key.robot, message.events[-1].source) if message.events else ""
                events.handle_history(key, message.events, now, wall_s=time.time(), reporter=reporter)
            elif isinstance(message, schema.Event):
                events.handle(key, message, now, reporter=self._reporter(key.robot, message.source))

    def _reporter(self, robot: str, service: str) -> str:
        """Return the process that is a robot's service; empty if there is none or several."""
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
                # Its service and id become keys of requests, so they must match the key that it used.
                self._session.ignored.note(PUBLICATION, f"{sample.key} of another process's name")
                continue
            if sample.parsed.site == self._site:
                self._publish_ignored(health.ignored_examples)
            # A last report that arrives after its sender has gone is no sign of life.
            if sample.live or health.id in self._mesh.present:
                self._mesh.record_health(sample.parsed.site, health, sample.received)

    async def _follow_presence(self) -> None:
        async for who, alive in self._session.watch_presence():
            (self._mesh.add_presence if alive else self._mesh.remove_presence)(who)

    async def _read_clocks(self) -> None:
        turns = asyncio.Semaphore(_CLOCKS_AT_ONCE)

        async def read(site: str, identity: str) -> None:
            async with turns:
                # Health shows whether it runs; an invalid time is no reading.
                with contextlib.suppress(NoAnswerError, ValueError):
                    self._mesh.record_clock(
                        identity, await read_clock(self._session, site, identity, hops=True)
                    )

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

    # ------------------------------------------------------ results

    async def _run_checks(self, before: dict[str, Condition]) -> None:
        rounds, begun_s = 0, time.monotonic()
        while True:
            now, now_s = self._clock.now_s(), time.monotonic()
            if now_s - begun_s > self._settled_s + _KNOWN_AFTER_S:
                before = {}
            self._publish_ignored(tuple(self._session.ignored.examples))
            self._forget_offline_robots()
            self._mesh.forget_gone(now_s)
            if self._can_observe(now_s):
                self._update_alarms(now, now_s, before)
            if self._registry.update(now) or rounds % _ALARMS_EACH == 0:
                self._alarms_topic.put(self._registry.message(self._site))
            if rounds % _MESH_EACH == 0:
                self._mesh_topic.put(self._mesh.state(self._site, self._zenoh_id, now_s))
            rounds += 1
            await asyncio.sleep(_ROUND_S)

    def _can_observe(self, now_s: float) -> bool:
        """Return whether a missing service really is missing, not merely out of reach.

        The service also waits a moment after its router is back: messages lost during a cut are not losses.
        """
        if not self._session.connected:
            self._blind_until_s = now_s + self._settled_s
        present = {who.site for who in self._mesh.services()}
        if now_s < self._blind_until_s or not self._expected.sites <= present:
            self._unsettled_until_s = now_s + self._settled_s
        if now_s < self._unsettled_until_s:
            self._mesh.forget_losses()
        return now_s >= self._blind_until_s

    def _update_alarms(self, now: float, now_s: float, before: dict[str, Condition]) -> None:
        """Activate alarms for conditions that began; clear those that ended.

        Args:
            before: Conditions from before a restart, until it is known whether they still hold.
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
            begun=frozenset(self._conditions.active),
            now=now,
            now_s=now_s,
            settled_s=self._settled_s,
        )
        conditions += self._registry.own_conditions()
        there = {condition.id for condition in conditions}
        conditions += [condition for name, condition in before.items() if name not in there]
        began, changed, over = self._conditions.update(conditions, now_s)
        for condition in began:
            self._registry.begin(condition, now)
        for condition in changed:
            self._registry.change(condition)
        for condition in over:
            self._registry.end(condition, now)
        self._clear_orphans(now, now_s)

    def _clear_orphans(self, now: float, now_s: float) -> None:
        """Clear alarms after their reporter was replaced: the new process will not report their end."""
        alarms, orphans = self._registry.alarms, {}
        for alarm in alarms.by_id.values():
            if alarm.active and alarm.reporter:
                serving = self._mesh.serving(self._site, alarm.source, alarm.robot)
                if serving and alarm.reporter not in serving:
                    orphans[alarm.id] = self._orphans.get(alarm.id, now_s)
        self._orphans = orphans
        for name, since_s in orphans.items():
            if now_s - since_s >= self._settled_s:
                alarms.lose_reporter(name, now)

    def _forget_offline_robots(self) -> None:
        """Forget the state of robots without a gateway, once its alarm has been handled."""
        for name, robots in self._expected.without_gateway.items():
            alarm = self._registry.alarms.by_id.get(name)
            if name in self._conditions.active and (alarm is None or not alarm.active):
                for robot in robots:
                    self._states.pop(robot, None)

    def _age_s(self, robot: str) -> float:
        age_s = self._controllers.age_s(f"{ROOT}/{self._site}/{robot}/controller")
        return 0.0 if age_s is None else age_s

    def _publish_ignored(self, examples: Iterable[str]) -> None:
        """Publish one event for each ignored key, however many processes have ignored it."""
        for example in examples:
            shown = one_line(example, _LONGEST_IGNORED)
            if shown not in self._ignored and len(self._ignored) < _MOST_IGNORED:
                self._ignored.add(shown)
                text = f"ignored: {shown}: not a key of the mesh; a program uses a wrong name"
                self._publish_event(schema.Event.WARNING, "mesh.key_ignored", text, {"key": shown}, None)

    def _publish_event(
        self,
        severity: schema.Event.Severity,
        code: str,
        text: str,
        values: dict[str, str],
        reason: schema.Reason | None,
    ) -> None:
        event = schema.Event(
            severity=severity, code=code, text=text, source="watch", values=values, reason=reason
        )
        event.timestamp.GetCurrentTime()
        self._events.put(event)
        log.log(logging.INFO if severity == schema.Event.INFO else logging.WARNING, "%s", text)

    async def _answer(self, request: Request) -> schema.AlarmList:
        """Acknowledge, shelve or unshelve alarms; reply after the change is on disk.

        Raises:
            RefusedError: If the alarm's state does not allow it.
        """
        asked = request.message
        assert isinstance(asked, schema.AlarmRequest)
        by = check_operator(request.chunk[:_NAMES_MOST])
        try:
            await self._registry.apply_request(asked, by, self._clock.now_s())
        except AlarmError as error:
            raise RefusedError(error.reason) from None
        message = self._registry.message(self._site)
        self._alarms_topic.put(message)
        return message
