"""`robomesh list` and `robomesh alarms`: alarms of the watches, and gone sites."""

import asyncio

import pytest
from rich.console import Console

from robomesh.client.mesh import RobotNotFoundError
from robomesh.contract.keys import PresenceKey
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from services.command_line.terminal import discovery
from services.command_line.terminal.alarm_lists import gone_sites, lists
from services.command_line.watch import alarms, listing, listing_text
from tests.conftest import run

Alarm = schema.Alarm
LONG = "service.silent:recorder.0123456789abcdef0123456789abcdef"


def alarm(name="arm:link", code="link.down", *, robot="arm", state=Alarm.UNACKNOWLEDGED, at_s=1e9, **values):
    defaults = {"source": "gateway", "text": "connecting to 10.0.0.7:5400", "priority": Alarm.HIGH}
    made = Alarm(id=name, code=code, robot=robot, state=state, **(defaults | values))
    made.since.FromSeconds(round(at_s))
    return made


def gone(site="beijing", **values):
    text = f"site {site} is gone: shanghai does not see any of its services"
    values = {"source": "watch", "text": text, "values": {"site": site}} | values
    return alarm(f"-:site.gone:{site}", "site.gone", robot="-", **values)


SHANGHAI = schema.AlarmList(site="shanghai", alarms=[gone(), alarm()])
WUHAN = schema.AlarmList(site="wuhan", alarms=[gone(at_s=9e8), gone("hub", state=Alarm.RETURNED)])
ALIVE = [PresenceKey(site, "-", "watch", f"w-{site}") for site in ("shanghai", "wuhan")]


def test_a_gone_site_is_listed_with_the_earliest_time_of_the_watches():
    rows = {row["site"]: row for row in listing._sites(ALIVE, [SHANGHAI, WUHAN])}
    assert rows.keys() == {"beijing", "shanghai", "wuhan"}
    assert rows["beijing"]["gone_since"] == 9e8
    assert listing_text._site(rows["beijing"]).startswith("beijing — gone since 1998-07-")
    assert rows["shanghai"]["gone_since"] is None
    # The unacknowledged alarm is named, not only counted.
    assert "-:site.gone:beijing: site beijing is gone" in listing_text._site(rows["shanghai"])


def test_a_returned_site_is_not_gone():
    alive = [*ALIVE, PresenceKey("beijing", "-", "router", "r")]
    (row,) = (row for row in listing._sites(alive, [SHANGHAI]) if row["site"] == "beijing")
    assert row["gone_since"] is None
    assert not gone_sites([schema.AlarmList(site="a", alarms=[gone(state=Alarm.RETURNED)])])


async def test_a_robots_row_has_what_its_driver_can_do(mesh):
    state = schema.ControllerState(link=schema.ControllerState.UP)
    can = state.capabilities
    can.stops, can.absolute = schema.Capabilities.OURS, True
    can.dies_with_link = schema.ControllerState.NO
    can.recoveries.extend([schema.Recover.POWER_ON, schema.Recover.BRAKE_RELEASE])
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        gateway.declare_publisher("hall", "arm", "controller").put(state)
        while (await listing._row(monitor, "hall", "arm", gateway=True))["link"] != "up":
            await asyncio.sleep(0.02)
        arm, other = [await listing._row(monitor, "hall", name, gateway=False) for name in ("arm", "other")]
    keys = ("stops", "commands", "absolute", "dies_with_link", "recoveries")
    assert [arm[key] for key in keys] == ["ours", [], True, False, ["power_on", "brake_release"]]
    assert [other[key] for key in keys] == [None, [], None, None, []]
    assert "a motion goes on without the gateway" in listing_text._state(arm)


def test_a_gateway_that_answers_late_is_not_called_missing(mesh, monkeypatch):
    monkeypatch.setattr("services.command_line.watch.listing._LATE_S", 4.0)
    monkeypatch.setattr("services.command_line.watch.listing._ANSWER_S", 0.2)

    async def main():
        async with open_session(mesh) as gateway, open_session(mesh) as monitor:
            gateway.declare_presence("hall", "arm", "gateway")
            gateway.declare_presence("hall", "mute", "gateway")
            gateway.declare_presence("hall", "other", "kinematics")
            asyncio.get_running_loop().call_later(
                1.0,
                gateway.declare_publisher("hall", "arm", "controller").put,
                schema.ControllerState(link=1),
            )
            while len((found := await listing._collect(monitor, listing._Clocks()))["robots"]) < 3:
                pass
            return {row["robot"]: row["link"] for row in found["robots"]}

    assert run(main()) == {"arm": "down", "mute": "no answer", "other": "no gateway"}


async def test_a_list_that_leaves_out_sessions_says_that_it_is_partial(mesh, capsys):
    async with open_session(mesh) as eve, open_session(mesh) as monitor:
        eve.declare_presence("hall", "arm", "gateway")
        names = [f"eve.{number}" for number in range(100)]
        tokens = [eve.declare_presence_of("hall", "arm", "operator", name) for name in names]
        while True:
            found = await listing._collect(monitor, listing._Clocks())
            if len(found["services"]) == 1 + 64:
                break
        for token in tokens:
            token.undeclare()
    assert (found["partial"], [row["robot"] for row in found["robots"]]) == (True, ["arm"])
    Console(width=200).print(listing_text.listing_text(found, 200))
    assert "This list is partial" in capsys.readouterr().out
    Console(width=200).print(listing_text.listing_text(found | {"partial": False}, 200))
    assert "partial" not in capsys.readouterr().out


async def test_the_error_for_an_unknown_robot_names_gone_sites(mesh):
    async with open_session(mesh) as watch, open_session(mesh) as monitor:
        watch.declare_publisher("shanghai", "-", "alarms").put(SHANGHAI)
        while not await lists(monitor):
            await asyncio.sleep(0.02)
        with pytest.raises(RobotNotFoundError, match=r"no robot 'beijing/pt500-1'.*; gone.*beijing"):
            await discovery.find(monitor, "beijing/pt500-1")


@pytest.mark.parametrize(
    "name",
    ["arm:link", "shanghai/arm:link", "link.down", "gateway · link.down", "arm:link.down"],
)
def test_an_alarm_is_found_by_its_id_and_by_its_name_on_the_page(name):
    assert alarms._by_site([name], [SHANGHAI]) == {"shanghai": ["arm:link"]}


def test_an_ambiguous_alarm_name_is_refused_with_the_candidates():
    both = schema.AlarmList(site="shanghai", alarms=[alarm(), alarm("arm-2:link", robot="arm-2")])
    with pytest.raises(alarms.NoSuchAlarmError, match=r"shanghai/arm:link, shanghai/arm-2:link"):
        alarms._by_site(["link.down"], [both])
    with pytest.raises(alarms.NoSuchAlarmError, match=r"there are: arm:link \(gateway · link\.down\)"):
        alarms._by_site(["nothing"], [both])


async def test_acknowledging_names_the_alarms_that_it_acknowledged(mesh, capsys):
    async def acknowledge(_):
        return schema.AlarmList(site="shanghai")

    async with open_session(mesh) as watch, open_session(mesh) as monitor:
        watch.declare_publisher("shanghai", "-", "alarms").put(SHANGHAI)
        watch.answer("shanghai", "-", "alarms/request/*", acknowledge)
        while not await lists(monitor):
            await asyncio.sleep(0.02)
        await asyncio.to_thread(alarms.ack, ["link.down"], mesh.connect[0], "li")
    first, *_ = capsys.readouterr().out.splitlines()
    assert first == "acknowledged: shanghai/arm:link"


def test_an_alarms_name_is_not_wrapped_and_its_text_uses_the_full_width(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    text = "word " * 30
    long_alarm = alarm(f"-:{LONG}", "service.silent", text=text, advice="Look at it.", count=3, by="li")
    alarms._print([schema.AlarmList(site="a-site-with-a-name-that-is-long", alarms=[long_alarm])])
    lines = capsys.readouterr().out.splitlines()
    assert f"  a-site-with-a-name-that-is-long/-:{LONG}" in lines
    assert lines[0].startswith("HIGH  unacknowledged  2001-09-")
    assert lines[0].endswith("gateway · service.silent")
    assert [line.strip() for line in lines[-2:]] == ["3 times, by li", "Look at it."]
    assert len(lines) == 6


def test_a_slow_robot_is_marked_in_the_list():
    row = listing._row_without_gateway("hall", "arm", "up") | {"state": "idle", "slow_hz": 0.5}
    assert listing_text._state(row) == "idle, slow, joints at 0.5 Hz"
