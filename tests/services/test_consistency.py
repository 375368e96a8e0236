"""Conditions of the mesh, from the processes' reports."""

import pytest

from robomesh import reason_codes as codes
from robomesh.contract.keys import PresenceKey
from robomesh.contract.messages import reason_message
from robomesh.schemas.robomesh_pb2 import ControllerState, ServiceHealth
from robomesh.service.clock import Reading
from services.errors import SiteFileError
from services.site_file import site as site_file
from services.watch.conditions import Condition, ConditionTracker, robot_conditions
from services.watch.consistency import Expected, largest_clock_offset_s, mesh_conditions
from services.watch.observed_mesh import ObservedMesh

# 2026-11-22 12:00 UTC.
EPOCH = 1795348800.0


def mesh_of(*reports: ServiceHealth, site: str = "s") -> ObservedMesh:
    mesh = ObservedMesh()
    for health in reports:
        mesh.add_presence(PresenceKey(site, "-", health.service, health.id))
        mesh.record_health(site, health, 0.0)
    return mesh


def found(mesh: ObservedMesh, *, now_s: float = 1.0, begun: frozenset[str] = frozenset()) -> dict[str, str]:
    conditions = mesh_conditions(
        mesh, "s", here="me", expected=Expected(), begun=begun, now=EPOCH + now_s, now_s=now_s
    )
    return {condition.id: condition.text for condition in conditions}


def health(service: str = "recorder", **values: object) -> ServiceHealth:
    return ServiceHealth(service=service, id="a1", host="host-a", version="1.0", **values)


def test_all_is_well_when_all_is_well():
    assert found(mesh_of(health())) == {}


def test_a_process_that_is_there_and_says_nothing_hangs():
    mesh = mesh_of(health())
    assert "recorder (s, host-a, " in found(mesh, now_s=11.0)["-:service.silent:recorder.a1"]


def test_losses_are_reported_between_two_thresholds():
    mesh = mesh_of(health(received=1000))
    name = "-:mesh.loss:recorder.a1"
    mesh.record_health("s", health(received=2000, lost=4), 1.0)
    assert found(mesh) == {}  # too few
    mesh.record_health("s", health(received=3000, lost=40), 2.0)
    assert "2.0 %" in found(mesh)[name]
    for second in range(40):
        mesh.record_health("s", health(received=13000 + 100 * second, lost=50), 3.0 + second)
    assert name not in found(mesh)
    mesh.record_health("s", health(received=18000, lost=60), 43.0)
    assert name not in found(mesh)
    assert name in found(mesh, begun=frozenset({name}))


@pytest.mark.parametrize(
    ("left_s", "expected"),
    [
        (864000 - 60.0, "expires on 2026-12-02 11:59 UTC"),
        (-60.0, "expired on 2026-11-22 11:59 UTC"),
        (float("-inf"), "expired on 1970-01-01"),
    ],
)
def test_a_certificate_that_expires_soon_is_reported(left_s, expected):
    assert found(mesh_of(health(values={"certificate_seconds": 900000.0}))) == {}
    texts = found(mesh_of(health(values={"certificate_seconds": left_s})))
    assert expected in texts["-:certificate.expires:recorder.a1"]


def test_a_router_with_a_missing_link_is_reported():
    assert found(mesh_of(health("router", values={"links": 2.0, "links_wanted": 2.0}))) == {}
    texts = found(mesh_of(health("router", values={"links": 1.0, "links_wanted": 2.0})))
    assert "reaches 1 of the 2 routers" in texts["-:router.unlinked:a1"]
    assert found(mesh_of(health("router", values={"links": float("nan"), "links_wanted": 2.0}))) == {}


def test_the_metric_of_clocks_is_the_certain_part_of_the_largest_offset():
    mesh = mesh_of(health())
    assert largest_clock_offset_s(mesh, "me") == 0.0
    mesh.record_clock("a1", Reading(offset_s=0.01, round_trip_s=0.1))
    assert largest_clock_offset_s(mesh, "me") == 0.0
    mesh.record_clock("a1", Reading(offset_s=-2.0, round_trip_s=0.01))
    assert largest_clock_offset_s(mesh, "me") == pytest.approx(1.995)
    assert largest_clock_offset_s(mesh, "a1") == 0.0


def test_an_alarm_keeps_its_words_while_only_a_number_in_them_counts_on():
    mesh, tracker = mesh_of(health(received=1000)), ConditionTracker()
    mesh.record_clock("a1", Reading(offset_s=2.0, round_trip_s=0.01))

    def judged(now_s: float, left_s: float, received: int, lost: int) -> tuple[list[Condition], ...]:
        report = health(values={"certificate_seconds": left_s}, received=received, lost=lost)
        mesh.record_health("s", report, now_s)
        mesh.record_health("s", ServiceHealth(service="watch", id="me", host="host-b", version="1.0"), now_s)
        conditions = mesh_conditions(
            mesh,
            "s",
            here="me",
            expected=Expected(),
            begun=frozenset(tracker.active),
            now=EPOCH + now_s,
            now_s=now_s,
        )
        return tracker.update(conditions, now_s)

    day_s = 86400.0
    began, _, _ = judged(1.0, 9 * day_s, 2000, 40)
    assert {each.code for each in began} == {"clock.off", "mesh.loss", "certificate.expires"}
    mesh.processes["a1"].clock.readings.clear()
    mesh.record_clock("a1", Reading(offset_s=2.4, round_trip_s=0.01))
    assert judged(2.0 + day_s, 8 * day_s, 3000, 90) == ([], [], [])
    _, changed, _ = judged(3.0 + 9 * day_s, -1.0, 4000, 120)
    assert [(each.cause.code, each.cause.values["date"]) for each in changed] == [
        ("certificate.expired", "2026-12-01 12:00")
    ]
    mesh.processes["a1"].clock.readings.clear()
    mesh.record_clock("a1", Reading(offset_s=-2.0, round_trip_s=0.01))
    _, changed, _ = judged(4.0 + 9 * day_s, -2.0, 5000, 150)
    assert [(each.cause.code, each.cause.values) for each in changed] == [
        ("clock.behind", {"host": "host-a", "seconds": "2.0", "watch": "host-b"})
    ]


def test_whose_last_words_come_after_it_has_gone_does_not_hang():
    mesh = mesh_of(health())
    mesh.remove_presence(PresenceKey("s", "-", "recorder", "a1"))
    mesh.record_health("s", health(), 1.0)
    mesh.forget_gone(2.0)
    assert "a1" in mesh.processes, "it may be about to come"
    mesh.forget_gone(11.0)
    assert found(mesh, now_s=12.0) == {}
    assert "a1" not in mesh.processes


def test_a_site_that_is_seen_no_more_is_gone_once():
    mesh, expected, tracker = mesh_of(health("router"), site="beijing"), Expected(), ConditionTracker()

    def judged(now_s: float) -> tuple[list[Condition], list[Condition]]:
        conditions = mesh_conditions(
            mesh, "s", here="me", expected=expected, begun=frozenset(), now=EPOCH, now_s=now_s, settled_s=5.0
        )
        began, _, over = tracker.update(conditions, now_s)
        return began, over

    assert judged(0.0) == ([], [])
    mesh.remove_presence(PresenceKey("beijing", "-", "router", "a1"))
    assert judged(1.0) == ([], [])
    (gone,), _ = judged(6.0)
    assert gone.id == "-:site.gone:beijing"
    assert judged(7.0) == ([], [])
    mesh.add_presence(PresenceKey("beijing", "-", "router", "b2"))
    _, (over,) = judged(8.0)
    assert over.over == "site beijing is there again"


def test_each_address_that_a_process_cannot_listen_on_is_a_condition():
    problems = [
        reason_message(codes.ADDRESS_ABSENT(what="the router", address=address))
        for address in ("tcp/192.0.2.1:7447", "tcp/192.0.2.2:7447")
    ]
    assert found(mesh_of(health("router", problems=problems))).keys() == {
        "-:service.problem:router.a1.tcp/192.0.2.1:7447",
        "-:service.problem:router.a1.tcp/192.0.2.2:7447",
    }


def test_a_service_that_should_run_and_was_never_seen_is_missed_after_a_minute():
    expected = Expected({("recorder", "-"): "", ("gateway", "arm"): ""})
    mesh, tracker = ObservedMesh(), ConditionTracker()
    mesh.add_presence(PresenceKey("s", "arm", "gateway", "a1"))

    def judged(now_s: float) -> list[str]:
        conditions = mesh_conditions(
            mesh, "s", here="me", expected=expected, begun=frozenset(), now=EPOCH, now_s=now_s
        )
        return [condition.text for condition in tracker.update(conditions, now_s)[0]]

    assert judged(0.0) == judged(59.0) == []
    assert judged(61.0) == ["recorder has not started"]


@pytest.mark.parametrize(
    ("service", "robot", "missed"),
    [
        ("gateway", "arm", True),
        ("recorder", "-", True),
        ("foxglove", "-", False),
        ("ros2", "-", False),
        ("simulator", "arm", False),
        ("player", "replay-1", False),
    ],
    ids=str,
)
def test_only_required_services_are_missed(service, robot, missed):
    mesh, expected, who = ObservedMesh(), Expected(), PresenceKey("s", robot, service, "a1")

    def gone() -> list[str]:
        conditions = mesh_conditions(
            mesh, "s", here="me", expected=expected, begun=frozenset(), now=EPOCH, now_s=0.0, settled_s=0.0
        )
        return [condition.code for condition in conditions]

    mesh.add_presence(who)
    assert gone() == []
    mesh.remove_presence(who)
    assert gone() == ["service.gone"] * missed
    # Nor does one from an earlier version's file, after the watch's restart.
    then = Condition(
        code="service.gone", text=f"{service} of s is gone", values=(("service", service), ("robots", robot))
    )
    expected = Expected()
    expected.remember([then])
    assert gone() == ["service.gone"] * missed


def test_a_router_that_is_to_link_to_itself_is_refused(tmp_path):
    path = tmp_path / "site.toml"
    path.write_text(
        'site = "x"\n[router]\nlisten = ["tcp/127.0.0.1:7447"]\nconnect = ["tcp/localhost:7447"]\n',
        encoding="utf-8",
    )
    with pytest.raises(SiteFileError, match="localhost:7447 is given twice, to the router and to another"):
        site_file.load(path)


def test_a_check_that_is_getting_ready_is_no_alarm_and_one_that_fails_is():
    starting = ControllerState(link=ControllerState.UP, check_text="getting ready", check_starting=True)
    failed = ControllerState(link=ControllerState.UP, check_text="the check does not work: no memory")
    assert [each.code for each in robot_conditions("arm", starting, 0.0)] == []
    assert [each.code for each in robot_conditions("arm", failed, 0.0)] == ["check.missing"]


def test_a_frozen_controller_that_is_connected_to_again_and_again_is_one_alarm_in_the_same_words():
    tracker, state = (
        ConditionTracker(),
        ControllerState(link=ControllerState.SILENT, link_text="10.0.0.7 sends nothing"),
    )

    def judged(now_s: float) -> tuple[list[str], list[Condition], list[str]]:
        began, changed, over = tracker.update(robot_conditions("arm", state, 0.0), now_s)
        return [each.text for each in began], changed, [each.code for each in over]

    assert judged(0.0) == ([], [], [])
    assert judged(3.0) == (["link to the controller: 10.0.0.7 sends nothing"], [], [])
    state.link, state.link_text = ControllerState.DOWN, "10.0.0.7 sends nothing; connecting again"
    assert judged(4.0) == ([], [], [])
    state.link = ControllerState.UP
    assert judged(5.0) == ([], [], ["link.silent"])


def test_a_link_that_is_down_for_a_new_reason_is_reported_with_it():
    tracker, state = (
        ConditionTracker(),
        ControllerState(link=ControllerState.DOWN, link_text="connecting to 10.0.0.7"),
    )

    def changed(now_s: float) -> list[str]:
        return [each.text for each in tracker.update(robot_conditions("arm", state, 0.0), now_s)[1]]

    assert [changed(now_s) for now_s in (0.0, 3.0)] == [[], []]
    state.link_text = "cannot connect to 10.0.0.7: Connection refused"
    assert changed(4.0) == []
    assert changed(15.0) == ["link to the controller: cannot connect to 10.0.0.7: Connection refused"]
    assert changed(16.0) == []


@pytest.mark.parametrize(
    ("reason", "text"),
    [
        ("robomesh send stop", 'stop 1 is latched by li: reason "robomesh send stop"'),
        ("", "stop 1 is latched by li: no reason given"),
    ],
)
def test_a_latched_stops_alarm_quotes_its_reason(reason, text):
    state = ControllerState(link=ControllerState.UP, stop={"id": 1, "by": "li", "reason": reason})
    assert [each.text for each in robot_conditions("arm", state, 0.0)] == [text]
