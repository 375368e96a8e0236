"""The alarms of all sites, and the sites that alarms report as gone."""

from collections.abc import Iterable

from robomesh.contract.keys import ROOT, WHOLE_SITE
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.last_values import last_values
from robomesh.wire.session import Session

_GONE = "site.gone"


async def lists(session: Session) -> list[schema.AlarmList]:
    """Return every site's alarms, as its watch holds them, sorted by site."""
    found = await last_values(session, f"{ROOT}/*/{WHOLE_SITE}/alarms")
    return [each for each in found.values() if isinstance(each, schema.AlarmList)]


def gone_sites(found: Iterable[schema.AlarmList]) -> dict[str, schema.Alarm]:
    """Return the sites that are gone, each with its oldest alarm."""
    gone: dict[str, schema.Alarm] = {}
    for each in found:
        for alarm in each.alarms:
            if alarm.code != _GONE or alarm.state == schema.Alarm.RETURNED:
                continue
            name = alarm.values["site"]
            if name not in gone or alarm.since.ToNanoseconds() < gone[name].since.ToNanoseconds():
                gone[name] = alarm
    return gone
