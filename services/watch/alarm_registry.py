"""The alarms as they are kept: changed by what happens and by people, told, and on disk."""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Iterator
from pathlib import Path

from robomesh.schemas import robomesh_pb2 as schema
from services.watch import alarm_store
from services.watch.alarms import Alarm, Alarms
from services.watch.conditions import Condition
from services.watch.subscriptions import Intake, alarm_of

log = logging.getLogger(__name__)

_S = schema.Event.Severity
_Request = schema.AlarmRequest
_P = schema.Alarm.Priority
_SEVERITY = {_P.LOW: _S.WARNING, _P.MEDIUM: _S.WARNING, _P.HIGH: _S.ERROR, _P.CRITICAL: _S.CRITICAL}

# Severity, code, text and values of an event.
Say = Callable[[schema.Event.Severity, str, str, dict[str, str]], None]


class Book:
    """A site's alarms, and their file.

    Args:
        say: Publishes an event.
    """

    def __init__(self, path: Path, say: Say) -> None:
        self.alarms = Alarms()
        self.intake = Intake(self.alarms)
        self._path, self._say = path, say
        self._saved: object = None
        self._told: object = None
        self._saving = asyncio.Lock()
        self._task: asyncio.Task[None] | None = None
        self._problem = ""

    async def open(self) -> None:
        """Take up what was so before a restart; a file that cannot be read is put aside and told of."""
        try:
            self.alarms.held, self.intake.told_ns = await asyncio.to_thread(alarm_store.load, self._path)
        except (ValueError, OSError) as error:
            aside = self._path.with_suffix(".damaged")
            text = f"alarms from before cannot be read, who had seen what is not known: {error}"
            log.error("%s", text)
            self._say(_S.ERROR, "alarm.forgotten", text, {})
            if isinstance(error, ValueError):
                with contextlib.suppress(OSError):  # a disk that refuses is told of when it is saved
                    await asyncio.to_thread(self._path.replace, aside)
        self._saved = self._state()

    async def close(self) -> None:
        """Save what is not yet."""
        if self._task is not None:
            await asyncio.gather(self._task, return_exceptions=True)
        await self._save()

    # ---------------------------------------------------------- what happens

    def conditions(self) -> dict[str, Condition]:
        """Those that stood at the last restart, as far as an alarm tells them."""
        return {
            alarm.id: Condition(
                robot=alarm.robot,
                source=alarm.source,
                code=alarm.code,
                text=alarm.text,
                over=f"over: {alarm.text}",
                values=alarm.values,
                told=alarm.source != "watch",
                what=alarm.id.removeprefix(f"{alarm.robot}:"),
            )
            for alarm in self.alarms.held.values()
            if alarm.stands and alarm.by_state
        }

    def begin(self, condition: Condition, now: float) -> None:
        """It has begun to be so."""
        alarm = alarm_of(condition, now)
        self.alarms.come(alarm, now)
        if not condition.told:
            self._say(_SEVERITY[alarm.priority], condition.code, condition.text, dict(condition.values))

    def change(self, condition: Condition) -> None:
        """It is still so, in other words."""
        self.alarms.change(condition.id, condition.code, condition.text, condition.values)

    def end(self, condition: Condition, now: float) -> None:
        """It is so no more."""
        self.alarms.go(condition.id, now)
        if not condition.told:
            self._say(_S.INFO, f"{condition.code}.over", condition.over, dict(condition.values))

    def conditions_of_its_own(self) -> Iterator[Condition]:
        """What is wrong with the alarms themselves."""
        if self.alarms.flooding:
            yield Condition(
                code="alarm.flood",
                text="more than 10 alarms in 10 minutes: more than a person can follow",
                over="alarms come at a rate again that a person can follow",
            )
        if self._problem:
            yield Condition(
                code="alarm.not_saved",
                text=f"alarms cannot be saved, a restart would forget them: {self._problem}",
                over="alarms are saved again",
            )

    async def change_by(self, asked: _Request, by: str, now: float) -> None:
        """What a person does with alarms; saved when it returns, if the disk is well.

        Raises:
            AlarmError: Why not.
        """
        alarms = self.alarms
        values = {"by": by}
        texts = {each: alarms.held[each].text for each in asked.ids if each in alarms.held}
        match asked.action:
            case _Request.ACKNOWLEDGE:
                alarms.acknowledge(asked.ids, by, now)
                code, did = "alarm.acknowledged", "acknowledged"
            case _Request.SHELVE:
                alarms.shelve(asked.ids, by, now, for_s=asked.shelve_s, reason=asked.reason)
                code, did = (
                    "alarm.shelved",
                    f"shelved for {asked.shelve_s / 60:.0f} min ({asked.reason.strip()})",
                )
                values |= {"minutes": f"{asked.shelve_s / 60:.0f}", "reason": asked.reason.strip()}
            case _:
                alarms.unshelve(asked.ids, by, now)
                code, did = "alarm.unshelved", "put back"
        for identity, text in texts.items():
            self._say(_S.INFO, code, f"{by} {did}: {text}", values | {"id": identity})
        await self._save()

    # ------------------------------------------------------------ what is told

    def look(self, now: float) -> bool:
        """What time changes; whether anything has since the last look, and is being saved."""
        self.alarms.look(now)
        state = self._state()
        if state != self._saved and (self._task is None or self._task.done()):
            self._task = asyncio.create_task(self._save())
        changed, self._told = state != self._told, state
        return changed

    def message(self, site: str) -> schema.AlarmList:
        """Everything, most urgent first."""
        return schema.AlarmList(site=site, alarms=[_message(alarm, site) for alarm in self.alarms.sorted()])

    def _state(self) -> tuple[Alarm, ...]:
        return tuple(self.alarms.held.values())

    async def _save(self) -> None:
        async with self._saving:
            state = self._state()
            if state == self._saved:
                return
            try:
                await asyncio.to_thread(alarm_store.save, self._path, state, dict(self.intake.told_ns))
                self._saved, self._problem = state, ""
            except OSError as error:
                self._problem = f"{self._path}: {error.strerror or error}"


def _message(alarm: Alarm, site: str) -> schema.Alarm:
    message = schema.Alarm(
        id=alarm.id,
        site=site,
        robot=alarm.robot,
        source=alarm.source,
        code=alarm.code,
        text=alarm.text,
        priority=alarm.priority,
        state=alarm.state,
        count=alarm.count,
        by=alarm.by,
        reason=alarm.reason,
        advice=alarm.advice,
        values=dict(alarm.values),
    )
    for name in ("since", "last", "returned", "at", "shelved_until"):
        at = getattr(alarm, name)
        if at is not None:
            getattr(message, name).FromNanoseconds(round(at * 1e9))
    return message
