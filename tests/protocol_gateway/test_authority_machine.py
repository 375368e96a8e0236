"""Random sequences of events: one holder, no motion after a stop, a stop when a lease ends during motion."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from protocol_gateway.authority.admission import admit, keep_answer
from protocol_gateway.authority.lease_rules import (
    MOTION_COMMANDS,
    Answer,
    Authority,
    Now,
    end_lease,
    end_session,
    expire,
    holds,
    request_lease,
)
from protocol_gateway.authority.motion_owner import drop_refused, follow_motion, follow_status, record_command
from protocol_gateway.authority.stop_rules import latch_stop
from robomesh import reason_codes as codes
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest

A = LeaseRequest.Action
C = CommandRequest.Command

names = st.sampled_from(["li", "wang", "zhao"])
commands = st.sampled_from(
    [C.HOME, C.HOLD, C.RESUME, C.RESET, C.TRACE_ON, C.SPEED, C.MOVE_ABSOLUTE, C.MOVE_RELATIVE]
)


class Machine(RuleBasedStateMachine):
    """Random actions of operators, a controller and a clock."""

    def __init__(self):
        super().__init__()
        self.authority = Authority()
        self.now_s = 0.0
        self.known: dict[str, str] = {}
        self.made = 0
        self.sent_under: dict[str, int] = {}
        self.rests = 0  # units in a row that reported rest at the target, behind motion that was seen

    @property
    def now(self):
        return Now(self.now_s, round(self.now_s * 1e9), round(self.now_s * 1e9))

    @property
    def motion_may_run(self):
        return self.authority.lease.motion is not None and self.rests < 2

    def ends(self, authority, ended):
        """Handle the end of the lease `self.authority.lease`."""
        if ended is not None:
            assert ended.stop or not self.motion_may_run
            assert ended.why == authority.ended
        self.authority = authority

    @rule(
        action=st.sampled_from([A.ACQUIRE, A.RENEW, A.RELEASE, A.OFFER, A.ACCEPT, A.TAKE, A.ASK]),
        name=names,
        to=names,
        reason=st.sampled_from(["", "fire"]),
        knows=st.booleans(),
        ttl_s=st.sampled_from([0.0, 0.5, 5.0]),
    )
    def lease(self, action, name, to, reason, knows, ttl_s):
        self.made += 1
        before, lease = self.authority, self.authority.lease
        request = LeaseRequest(
            action=action,
            lease=self.known.get(name, "") if knows else "",
            ttl_s=ttl_s,
            to=to,
            reason=reason,
            session=f"session of {name}",
        )
        outcome = request_lease(
            self.authority, request, operator=name, now=self.now, secret=f"secret {self.made}"
        )
        if not outcome.answer.accepted:
            assert outcome.authority == before
        if outcome.granted is not None:
            assert outcome.granted.holder == name
            self.known[name] = outcome.granted.secret
        if lease is not None and outcome.authority.lease is None:
            assert action == A.RELEASE
        if lease is not None and outcome.granted is not None and outcome.granted.holder != lease.holder:
            assert (action == A.TAKE and reason) or (action == A.ACCEPT and lease.offered_to == name)
            assert outcome.ended is not None
        if outcome.ended is not None:
            assert outcome.ended.stop == self.motion_may_run
        self.authority = outcome.authority

    @rule(name=names, command=commands, stop_back=st.integers(0, 2), repeat=st.booleans())
    def command(self, name, command, stop_back, repeat):
        secret = self.known.get(name, "")
        latched = self.authority.stop
        last = self.sent_under.get(secret, 0)
        number = last if repeat else last + 1
        request = CommandRequest(
            lease=secret, id=number, command=command, stop_id=max(self.authority.last_stop_id - stop_back, 0)
        )
        admission = admit(self.authority, request, operator=name, now=self.now)
        if admission.repeat or not admission.answer.accepted:
            if admission.id_used:
                self.sent_under[secret] = number
                self.authority = keep_answer(self.authority, request, admission.answer)
            return
        assert self.authority.lease is not None
        assert self.authority.lease.holder == name
        assert number > last
        if latched is not None:
            assert command not in MOTION_COMMANDS
            assert command != C.RESET or request.stop_id == latched.id
        self.sent_under[secret] = number
        self.authority = keep_answer(self.authority, request, Answer(True, ""))
        self.authority = record_command(self.authority, request, self.now)
        if command in MOTION_COMMANDS or command == C.HOLD:
            self.rests = 0
        assert command not in MOTION_COMMANDS or self.authority.lease.motion is not None
        assert (self.authority.stop is None) == (latched is None or command == C.RESET)

    @precondition(lambda self: self.authority.lease is not None)
    @rule(command=commands)
    def holder_commands(self, command):
        self.command(self.authority.lease.holder, command, 0, False)

    @precondition(lambda self: self.authority.lease is None)
    @rule(name=names)
    def somebody_takes_control(self, name):
        self.lease(A.ACQUIRE, name, "", "", False, 5.0)

    @rule()
    def stop(self):
        last = self.authority.last_stop_id
        self.authority, latched = latch_stop(self.authority, by="anybody", reason="", now=self.now)
        assert self.authority.stop is latched
        assert latched.id == last + 1

    @rule(wait_s=st.sampled_from([0.1, 0.2, 0.6, 1.0, 2.0, 40.0]))
    def time_goes_on(self, wait_s):
        self.now_s += wait_s
        self.ends(*expire(self.authority, self.now))

    @rule(moving=st.booleans(), pending=st.booleans(), arrived=st.booleans())
    def observe(self, moving, pending, arrived):
        commanded = self.authority.lease is not None and self.authority.lease.motion is not None
        self.authority, uncommanded = follow_motion(
            self.authority, moving=moving, pending=pending, arrived=arrived, now=self.now
        )
        assert not (uncommanded and commanded)
        if moving:
            self.rests = 0
        if uncommanded and self.authority.lease is not None and not self.authority.lease.tolerates_motion:
            lease = self.authority.lease
            authority, ended = end_lease(self.authority, codes.ENDED_FOREIGN_MOTION(), uncommanded=True)
            assert ended.stop == lease.commanded
            self.authority = authority

    @rule(resting=st.booleans())
    def unit_is_received(self, resting):
        lease = self.authority.lease
        if lease is None or lease.motion is None:
            return
        counts = resting and lease.motion.seen and not lease.motion.held
        counts = counts and lease.motion.conclusive and lease.motion.last_s < self.now_s
        self.rests = self.rests + 1 if counts else 0
        self.authority = follow_status(self.authority, resting=resting, dated_s=self.now_s)
        assert self.authority.lease.motion is not None

    @rule()
    def controller_refuses(self):
        self.authority = drop_refused(self.authority)

    @precondition(lambda self: self.authority.lease is not None)
    @rule(name=names)
    def session_is_gone(self, name):
        lease = self.authority.lease
        authority, ended = end_session(self.authority, f"session of {name}")
        assert (ended is not None) == (lease.holder == name)
        self.ends(authority, ended)

    @invariant()
    def one_holder_at_most(self):
        holders = [name for name, secret in self.known.items() if holds(self.authority, name, secret)]
        lease = self.authority.lease
        assert holders == ([lease.holder] if lease else [])

    @invariant()
    def nothing_is_left_of_a_motion_behind_a_stop(self):
        lease = self.authority.lease
        assert self.authority.stop is None or lease is None or lease.motion is None

    @invariant()
    def who_asks_is_shown_for_half_a_minute(self):
        assert all(self.now_s - each.since_ns * 1e-9 < 30.0 for each in self.authority.asked_by)


TestAuthorityMachine = pytest.mark.slow(Machine.TestCase)
TestAuthorityMachine.settings = settings(max_examples=200, stateful_step_count=40)
