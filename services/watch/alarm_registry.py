"""A site's alarms: fed by conditions, events and people; published, and saved to disk."""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Iterator
from pathlib import Path

from robomesh import reason_codes as codes
from robomesh.contract.messages import reason_message
from robomesh.schemas import robomesh_pb2 as schema
from services.watch import alarm_store
from services.watch.alarms import Alarm, Alarms
from services.watch.conditions import Condition, condition_of
from services.watch.subscriptions import EventHandler, alarm_of

log = logging.getLogger(__name__)

_S = schema.Event.Severity
_Request = schema.AlarmRequest
_P = schema.Alarm.Priority
_SEVERITY = {_P.LOW: _S.WARNING, _P.MEDIUM: _S.WARNING, _P.HIGH: _S.ERROR, _P.CRITICAL: _S.CRITICAL}

# Severity, code, text and values of an event, and the reason in its text.
PublishEvent = Callable[[schema.Event.Severity, str, str, dict[str, str], schema.Reason | None], None]


class AlarmRegistry:
    """A site's alarms and their file.

    Args:
        publish_event: Publishes an event.
    """

    def __init__(self, path: Path, publish_event: PublishEvent) -> None:
        self.alarms = Alarms()
        self.events = EventHandler(self.alarms)
        self._path, self._publish_event = path, publish_event
        self._saved: object = None
        self._published: object = None
        self._saving = asyncio.Lock()
        self._task: asyncio.Task[None] | None = None
        self._problem = ""

    async def open(self) -> None:
        """Load the alarms of the last run; an invalid file is renamed and reported by an event."""
        try:
            self.alarms.by_id, self.events.last_event_ns = await asyncio.to_thread(
                alarm_store.load, self._path
            )
        except (ValueError, OSError) as error:
            aside = self._path.with_suffix(".damaged")
            reason = codes.ALARM_FORGOTTEN(detail=error)
            log.error("%s", reason)
            self._publish_event(_S.ERROR, reason.code, reason.text, {}, reason_message(reason))
            if isinstance(error, ValueError):
                with contextlib.suppress(OSError):  # the next save reports a disk that refuses
                    await asyncio.to_thread(self._path.replace, aside)
        self._saved = self._state()

    async def close(self) -> None:
        """Save unsaved changes."""
        if self._task is not None:
            await asyncio.gather(self._task, return_exceptions=True)
        await self._save()

    # ---------------------------------------------------------- inputs

    def conditions(self) -> dict[str, Condition]:
        """Return the conditions that were active at the last restart, as their alarms describe them."""
        return {
            alarm.id: Condition(
                robot=alarm.robot,
                source=alarm.source,
                code=alarm.code,
                text=alarm.text,
                over=f"over: {alarm.text}",
                values=alarm.values,
                cause=alarm.cause,
                reported=alarm.source != "watch",
                what=alarm.id.removeprefix(f"{alarm.robot}:"),
            )
            for alarm in self.alarms.by_id.values()
            if alarm.active and alarm.by_state
        }

    def begin(self, condition: Condition, now: float) -> None:
        """Activate a condition's alarm."""
        alarm = alarm_of(condition, now)
        self.alarms.activate(alarm, now)
        if not condition.reported:
            self._publish_event(
                _SEVERITY[alarm.priority],
                condition.code,
                condition.text,
                dict(condition.values),
                condition.cause,
            )

    def change(self, condition: Condition) -> None:
        """Update the text of a condition's alarm."""
        self.alarms.change(condition.id, condition.code, condition.text, condition.values, condition.cause)

    def end(self, condition: Condition, now: float) -> None:
        """Clear a condition's alarm."""
        self.alarms.clear(condition.id, now)
        if not condition.reported:
            code, values = f"{condition.code}.over", dict(condition.values)
            self._publish_event(_S.INFO, code, condition.over, values, None)

    def own_conditions(self) -> Iterator[Condition]:
        """Yield the faults of alarm handling itself."""
        if self.alarms.flooding:
            yield Condition(
                code="alarm.flood",
                text="more than 10 alarms in 10 minutes: more than a person can handle",
                over="the rate of alarms is normal again",
            )
        if self._problem:
            yield condition_of(
                codes.ALARM_NOT_SAVED(detail=self._problem),
                code="alarm.not_saved",
                over="alarms are saved again",
            )

    async def apply_request(self, asked: _Request, by: str, now: float) -> None:
        """Apply a person's request; save before returning, if the disk allows it.

        Raises:
            AlarmError: If the alarm's state does not allow it.
        """
        alarms = self.alarms
        values = {"by": by}
        texts = {each: alarms.by_id[each].text for each in asked.ids if each in alarms.by_id}
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
            self._publish_event(_S.INFO, code, f"{by} {did}: {text}", values | {"id": identity}, None)
        await self._save()

    # ------------------------------------------------------------ outputs

    def update(self, now: float) -> bool:
        """Apply what depends on time, start a save if needed, and return whether the alarms have changed."""
        self.alarms.update(now)
        state = self._state()
        if state != self._saved and (self._task is None or self._task.done()):
            self._task = asyncio.create_task(self._save())
        changed, self._published = state != self._published, state
        return changed

    def message(self, site: str) -> schema.AlarmList:
        """Return all alarms as a message, most urgent first."""
        return schema.AlarmList(site=site, alarms=[_message(alarm, site) for alarm in self.alarms.sorted()])

    def _state(self) -> tuple[Alarm, ...]:
        return tuple(self.alarms.by_id.values())

    async def _save(self) -> None:
        async with self._saving:
            state = self._state()
            if state == self._saved:
                return
            try:
                await asyncio.to_thread(alarm_store.save, self._path, state, dict(self.events.last_event_ns))
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
        cause=alarm.cause,
    )
    for name in ("since", "last", "returned", "at", "shelved_until"):
        at = getattr(alarm, name)
        if at is not None:
            getattr(message, name).FromNanoseconds(round(at * 1e9))
    return message
