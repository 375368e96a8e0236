"""The gateway end to end: a real simulated controller behind a real socket, over a real router."""

import asyncio
import json
import time

import pytest

from protocol_gateway.audit.log import read_entries, verify
from protocol_gateway.gateway import RobotSettings, Settings, check
from protocol_gateway.seam.errors import GatewaySettingsError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.service.loop_turns import LONG_S, MeasuredLoop
from tests.conftest import last_value
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, refusal, simulator, until

TARGET = [0.3, 0.2, -0.2, 0.1, 0.5]
FAR = [2.4, 0.2, -0.2, 0.1, 0.5]


async def test_a_controllers_units_are_published_as_joint_states(mesh, tmp_path):
    async with simulator(demo=True) as port, gateway(mesh, tmp_path, port) as site:
        await until(lambda: len(site.seen["joints"]) > 150)
        first, last = site.seen["joints"][0], site.seen["joints"][-1]
        assert [joint.name for joint in last.joints] == ["waist", "shoulder", "elbow", "wrist", "roll"]
        assert all(joint.HasField("velocity") for joint in last.joints)
        assert first != last
        # Ten a second, even if the simulated controller sent fewer.
        tenths = len({each.timestamp.ToNanoseconds() // 100_000_000 for each in site.seen["joints"]})
        assert 0.5 * tenths < len(site.seen["joints/slow"]) < 1.2 * tenths + 3
        assert site.controller.mode == STATE.REMOTE
        assert last.timestamp.ToNanoseconds() <= time.time_ns()


def test_long_turn_of_the_gateways_loop_is_an_event(mesh, tmp_path):
    def occupied(event):
        return (
            float(event.values["seconds"]) >= 4 * LONG_S and "occupied the gateway's event loop" in event.text
        )

    async def main():
        async with simulator() as port, gateway(mesh, tmp_path, port) as site:
            asyncio.get_running_loop().call_soon(time.sleep, 4 * LONG_S)
            await until(lambda: any(map(occupied, site.events("gateway.occupied"))))

    with asyncio.Runner(loop_factory=MeasuredLoop) as runner:
        runner.run(main())


async def test_home_and_move_reach_their_targets(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.lease(A.ACQUIRE)
        assert "home it first" in await refusal(site.command(C.MOVE_ABSOLUTE, joint_positions=TARGET))
        await site.lease(A.RELEASE)
        await site.home()
        answer = await site.command(C.MOVE_ABSOLUTE, joint_positions=TARGET)
        assert answer.accepted
        await until(lambda: site.seen["lease"][-1].motion)
        await until(lambda: site.joints == pytest.approx(TARGET, abs=1e-6))
        await until(lambda: not site.seen["lease"][-1].motion)
        await site.lease(A.RENEW)
        await site.command(C.MOVE_RELATIVE, joint_positions=[0, 0, 0, 0, -0.1])
        await until(lambda: site.joints == pytest.approx([*TARGET[:4], 0.4], abs=1e-6))
        await until(lambda: not site.seen["lease"][-1].motion)
        await site.lease(A.RELEASE)
        await until(lambda: not site.seen["lease"][-1].holder)
        assert not site.events("stop.latched")
        assert not site.events("motion.foreign")


async def test_an_operator_keeps_control_of_an_arm_in_a_demonstration(mesh, tmp_path):
    async with simulator(demo=True) as port, gateway(mesh, tmp_path, port) as site:
        await until(lambda: site.controller.activity == STATE.MOVING)
        await site.lease(A.ACQUIRE)
        await site.command(C.MOVE_ABSOLUTE, joint_positions=TARGET)
        await until(lambda: site.joints == pytest.approx(TARGET, abs=1e-6))
        await until(lambda: len(site.events("motion.foreign")) >= 1)
        assert not site.events("lease.ended")


async def test_stop_needs_no_lease_and_latches_until_the_holder_resets_that_stop(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await site.command(C.MOVE_ABSOLUTE, joint_positions=FAR)
        await until(lambda: site.controller.activity == STATE.MOVING)
        stop = await site.stop(by="wang", reason="somebody in the cell")
        assert (stop.stop_id, stop.sent) == (1, True)
        await until(lambda: site.controller.activity == STATE.STOPPED)
        assert (site.controller.stop.id, site.controller.stop.by) == (1, "wang")
        await site.lease(A.RENEW)
        text = await refusal(site.command(C.MOVE_ABSOLUTE, joint_positions=TARGET))
        assert text == (
            "Not sent: stop 1 is latched (wang: somebody in the cell): "
            "remove the cause, then send RESET with stop_id 1."
        )
        again = await site.stop(by="zhao", reason="really")
        text = await refusal(site.command(C.RESET, stop_id=stop.stop_id))
        assert "RESET names stop 1, but stop 2 is latched" in text
        await site.command(C.RESET, stop_id=again.stop_id)
        # Immediately: the controller may still report the stop.
        await site.command(C.MOVE_ABSOLUTE, joint_positions=TARGET)
        await until(lambda: site.joints == pytest.approx(TARGET, abs=1e-6))
        assert not site.controller.HasField("stop")
        # The controller has stopped for the gateway, not by itself.
        assert not site.events("controller.stopped")


async def test_operators_texts_are_shortened_to_one_line(mesh, tmp_path, caplog):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.stop(by="wang\nERROR arm: forged", reason="\x1b[2J" + "r" * 150_000)
        await until(lambda: site.controller.HasField("stop"))
        await site.lease(A.TAKE, reason="he\nleft" * 1000)
        assert "at most 200 characters" in await refusal(site.lease(A.ACQUIRE, operator="o" * 201))
        stop = site.controller.stop
        assert stop.by == "wang ERROR arm: forged"
        assert (len(stop.reason), stop.reason[:5]) == (200 - 1, "[2Jrr")
        await until(lambda: len(site.seen["audit"]) >= 2)
        assert max(map(len, site.audit.read_text().splitlines())) < 1000
    assert all(len(line) < 1000 and line.isprintable() for line in caplog.messages)


async def test_stop_with_a_wildcard_stops_every_robot_and_reading_everything_stops_none(mesh, tmp_path):
    async with simulator() as one, simulator() as two, gateway(mesh, tmp_path, one, two) as site:
        await site.session.last("robomesh/hall/arm/lease")
        answers = await site.session.ask_all("robomesh/*/*/stop", schema.StopRequest(reason="fire"))
        assert sorted(answer.message.stop_id for answer in answers) == [1, 1]
        await until(lambda: site.controller.activity == STATE.STOPPED)


async def test_a_lease_that_is_not_renewed_stops_its_holders_motion(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await site.lease(A.RENEW, ttl_s=0.5)
        await site.command(C.MOVE_ABSOLUTE, joint_positions=FAR)
        await until(lambda: site.controller.activity == STATE.STOPPED)
        assert site.joints[0] < 2.0
        await until(lambda: site.events("lease.ended") and site.seen["lease"][-1].holder == "")
        (event,) = site.events("lease.ended")
        assert event.text == (
            "control ended: li's lease was not renewed within 0.5 s, its motion was stopped"
        )
        assert site.controller.stop.by == "gateway"
        await until(lambda: site.seen["lease"][-1].holder == "")


async def test_releasing_control_during_motion_stops_it(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await site.command(C.MOVE_ABSOLUTE, joint_positions=FAR)
        await site.lease(A.RELEASE)
        await until(lambda: site.controller.activity == STATE.STOPPED)
        assert site.controller.stop.reason == "dead-man: li released control"


@pytest.mark.exact_times
async def test_one_operator_at_a_time_and_a_secret_alone_is_not_enough(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        answer = await site.lease(A.ACQUIRE, ttl_s=60)
        assert answer.until.ToNanoseconds() - answer.now.ToNanoseconds() < 5.1e9
        assert "li is in control" in await refusal(site.lease(A.ACQUIRE, operator="wang"))
        assert "li is in control" in await refusal(site.command(C.HOME, operator="wang"))
        assert "another window or program" in await refusal(site.command(C.HOME, lease="guessed"))
        assert site.controller.counters.units_sent == 0
        everything = site.audit.read_text() + str(site.seen)
        assert site.secret not in everything


async def test_a_command_is_executed_once_and_its_repeat_gets_the_first_answer(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.lease(A.ACQUIRE)
        first = await site.command(C.SPEED, speed_percent=50, id=7)
        assert await site.command(C.SPEED, speed_percent=50, id=7) == first
        assert "id 6 is not higher than 7" in await refusal(site.command(C.HOME, id=6))
        refused = await refusal(site.command(C.SPEED, speed_percent=300, id=8))
        assert refused == "Not sent: speed 300 % is outside 1 to 100 %."
        assert await refusal(site.command(C.SPEED, speed_percent=300, id=8)) == refused
        late = schema.CommandRequest().not_after
        late.FromNanoseconds(time.time_ns() - 10**9)
        assert "after its not_after" in await refusal(site.command(C.HOME, id=9, not_after=late))
        await until(lambda: site.controller.counters.units_sent == 1)


async def test_a_command_id_with_other_content_is_refused_and_audited(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        key = site.key("command/li")

        async def as_json(**fields):
            """Send a request like a plain Zenoh client; return the answer."""
            payload = json.dumps({"lease": site.secret, "id": 9, **fields})
            get = site.session.zenoh_session.get
            replies = await asyncio.to_thread(lambda: list(get(key, payload=payload, timeout=40.0)))
            (reply,) = replies
            return (reply.ok or reply.err).payload.to_string()

        first = await as_json(command="SPEED", speed_percent=50)
        for other in (
            {"command": "SPEED", "speed_percent": 100},
            {"command": "SPEED"},
            {"command": "HOLD"},
            {"command": "MOVE_ABSOLUTE", "joint_positions": [0.5, 0, 0, 0, 0]},
            {"command": "RUN_PROGRAM", "program": "home"},
        ):
            refused = await as_json(**other)
            assert refused == "Not sent: id 9 was used for SPEED 50 %: use a higher id for each command."
        # Another encoding and time: the same command.
        soon = schema.CommandRequest().not_after
        soon.FromNanoseconds(time.time_ns() + 10**9)
        again = await site.command(C.SPEED, speed_percent=50, id=9, not_after=soon)
        assert json.loads(first)["text"] == again.text
        await until(lambda: site.controller.counters.units_sent == 2)
        refused = schema.AuditEntry.REFUSED
        await until(
            lambda: (
                sum(
                    each.outcome == refused and "id 9 was used for SPEED 50 %" in each.text
                    for each in site.seen["audit"]
                )
                == 5
            )
        )


async def test_a_refusal_gives_a_reason_and_sends_nothing(mesh, tmp_path):
    async with simulator(demo=True) as port, gateway(mesh, tmp_path, port) as site:
        assert "take control first" in await refusal(site.command(C.HOME))
        await site.lease(A.ACQUIRE)
        beyond = [0, 0, 131 * 3.141592653589793 / 180, 0, 0]
        text = await refusal(site.command(C.MOVE_ABSOLUTE, joint_positions=beyond))
        assert text == "Not sent: joint elbow at 131.00° is beyond its limit 110.00°."
        text = await refusal(site.command(C.MOVE_RELATIVE, joint_positions=[0, 0, 9, 0, 0]))
        assert "joint elbow at" in text
        text = await refusal(site.command(C.MOVE_ABSOLUTE, joint_positions=[0, 0]))
        assert "2 joint positions, but the robot has 5 joints" in text
        assert site.controller.counters.units_sent == 0
        await until(lambda: len(site.seen["audit"]) >= 5)
        assert [entry.outcome for entry in site.seen["audit"]].count(schema.AuditEntry.REFUSED) == 4


async def test_every_request_is_in_an_intact_audit_log(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.home()
        await site.command(C.TRACE_ON)
        await site.stop(by="wang")
        await site.lease(A.RELEASE)
        await until(lambda: len(site.seen["audit"]) >= 5)
    entries = list(read_entries(site.audit))
    assert [entry.request for entry in entries] == ["ACQUIRE", "HOME", "TRACE_ON", "STOP", "RELEASE"]
    assert [entry.operator for entry in entries] == ["li", "li", "li", "wang", "li"]
    published = site.seen["audit"][-1]
    assert published.hash.hex() == entries[-1].hash
    assert verify(site.audit, head=published.hash.hex()).ok


async def test_a_shutdown_stops_motion_and_a_start_restores_the_stop(mesh, tmp_path):
    async with simulator() as port:
        async with gateway(mesh, tmp_path, port) as site:
            await site.home()
            await site.command(C.MOVE_ABSOLUTE, joint_positions=FAR)
            await until(lambda: site.controller.activity == STATE.MOVING)
        async with gateway(mesh, tmp_path, port) as site:
            await until(lambda: site.controller.activity == STATE.STOPPED)
            # The stop was sent again, and that is the log's last entry.
            await until(lambda: [e.request for e in read_entries(site.audit)][-1] == "STOP_AGAIN")
            await until(lambda: site.seen["audit"] and site.seen["audit"][-1].request == "STOP_AGAIN")
            head = await last_value(site.session, site.key("audit"))
            written = [entry.hash for entry in read_entries(site.audit)]
            assert [entry.hash.hex() for entry in head.entries] == written
            assert site.joints[0] < 2.0
            assert site.controller.stop.id == 1
            await site.lease(A.ACQUIRE)
            assert "stop 1 is latched" in await refusal(site.command(C.HOME))
            await site.command(C.RESET, stop_id=1)
        async with gateway(mesh, tmp_path, port) as site:
            assert not site.controller.HasField("stop")
            assert (await site.stop()).stop_id == 2


async def test_control_is_handed_over_and_taken_with_a_reason(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        await site.lease(A.ACQUIRE)
        assert "not offered to wang" in await refusal(site.lease(A.ACCEPT, operator="wang"))
        await site.lease(A.OFFER, to="wang")
        await until(lambda: site.seen["lease"][-1].offered_to == "wang")
        await site.lease(A.ACCEPT, operator="wang")
        await site.command(C.TRACE_ON, operator="wang")
        assert "needs a reason" in await refusal(site.lease(A.TAKE))
        await site.lease(A.TAKE, reason="wang has gone home")
        await until(lambda: site.seen["lease"][-1].holder == "li")
        await until(lambda: "wang has gone home" in site.events("lease.ended")[-1].text)


def settings_with(*robots):
    return Settings(
        site="hall",
        audit_folder=".",
        robots=tuple(
            RobotSettings(**{"name": "arm", "description": "pt600", "host": "localhost", "port": 1, **robot})
            for robot in robots
        ),
    )


@pytest.mark.parametrize(
    ("robots", "words"),
    [
        ([{}, {}], "two robots are named 'arm'"),
        ([{"accept_unknown": frozenset({"limits"})}], "accept_unknown 'limits'"),
        ([{"stale_after_s": 9.0}], "stale_after_s = 9,"),
    ],
)
def test_invalid_settings_are_refused(robots, words):
    with pytest.raises(GatewaySettingsError, match=words):
        check(settings_with(*robots))


async def test_two_operators_never_both_get_control(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        for _ in range(10):
            asked = [site.lease(A.ACQUIRE, operator=name) for name in ("li", "wang", "zhao", "qian")]
            answers = await asyncio.gather(*asked, return_exceptions=True)
            (won,) = [each for each in answers if isinstance(each, schema.LeaseAnswer)]
            await site.lease(A.RELEASE, operator=won.holder, lease=won.lease)


async def test_the_speed_is_published_until_the_controller_may_have_lost_it(mesh, tmp_path):
    async with simulator() as port, gateway(mesh, tmp_path, port) as site:
        assert not site.controller.HasField("speed_percent")
        await site.lease(A.ACQUIRE)
        await site.command(C.SPEED, speed_percent=30)
        await until(lambda: site.controller.speed_percent == 30)
        assert "outside 1 to 100 %" in await refusal(site.command(C.SPEED, speed_percent=0))
        assert site.controller.speed_percent == 30
    async with gateway(mesh, tmp_path, port, up=False) as site:
        assert not site.controller.HasField("speed_percent")
