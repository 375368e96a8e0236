"""Probes of a running site, which do no harm if a router lets them through.

- `lease/request/NAME` of a real robot: RENEW with a secret that no lease has. The gateway refuses it.
- `command/NAME` of a real robot: COMMAND_UNSPECIFIED without a lease. The gateway refuses it unevaluated.
- `alive/operator/NAME.doctor-probe-...` of a real robot: a token of a session that holds no lease and has
  opened no replay. It is withdrawn immediately; gateway and player then find nothing that the session held.
- `@/**`: the router's state is read, nothing is written.

A gateway writes each request that it receives into its audit log, as refused. No probe is a stop,
takes control, moves a robot or publishes. Robots whose gateway does not answer are left out: a token would
show a robot that does not run, and a missing answer says nothing about the rules.
"""

import time
from collections.abc import Iterable
from contextlib import ExitStack
from functools import partial
from typing import NamedTuple

import zenoh

from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest
from services.command_line.doctor.security_sessions import (
    TIMEOUT_S,
    AccessTrial,
    Person,
    ask_all,
    settle,
    wait_until,
)
from services.command_line.doctor.security_table import ROUTERS_OWN, names_of_operators, should

_RENEW = LeaseRequest(action=LeaseRequest.RENEW, lease="doctor --security", reason="doctor --security")
_REQUESTS = {
    "lease/request": _RENEW.SerializeToString(),
    "command": CommandRequest(command=CommandRequest.COMMAND_UNSPECIFIED).SerializeToString(),
}
_QUIET_S = 0.3


class ProbeResult(NamedTuple):
    """The trials on the running site, those that succeeded, and the robots without a gateway."""

    trials: set[AccessTrial]
    done: set[AccessTrial]
    left_out: list[str]


def probe(people: list[Person], witness: Person, site: str, robots: Iterable[str]) -> ProbeResult:
    """Try requests and tokens on real robots, in the own and in every operator's name, and `@/**`.

    Args:
        witness: Has the router's certificate, which may request everything and sees every token.
    """
    robots = list(robots)
    running = _running(witness, site, robots)
    tried = [person for person in people if person is not witness]
    operators = names_of_operators([person.principal for person in people])
    trials = {AccessTrial(person.principal.name, "query", ROUTERS_OWN) for person in tried}
    for person in tried:
        who = person.principal.name
        for base in (f"robomesh/{site}/{robot}" for robot in running):
            for name in {who, *operators}:
                trials |= {AccessTrial(who, "query", f"{base}/{request}/{name}") for request in _REQUESTS}
                session = f"{name}.doctor-probe-{who.replace('.', '-')}"
                trials.add(AccessTrial(who, "liveliness_token", f"{base}/alive/operator/{session}"))
    done = _ask(tried, trials) | _declare_tokens(tried, witness, site, trials)
    return ProbeResult(trials, done, [robot for robot in robots if robot not in running])


def _running(witness: Person, site: str, robots: Iterable[str]) -> list[str]:
    """Return the robots whose gateway answers."""
    name = witness.principal.name
    keys = {f"robomesh/{site}/{robot}/lease/request/{name}": robot for robot in robots}
    answered: set[str] = set()
    payload = _REQUESTS["lease/request"]
    ask_all(witness, dict.fromkeys(keys, payload), lambda key, _: answered.add(key))
    return [robot for key, robot in keys.items() if key in answered]


def _ask(people: list[Person], trials: set[AccessTrial]) -> set[AccessTrial]:
    """Return the requests that were answered: a gateway answers a refusal, a router drops the request."""
    done: set[AccessTrial] = set()
    for person in people:
        who = person.principal.name
        keys = sorted(trial.key for trial in trials if trial.who == who and trial.act == "query")
        questions = {key: _payload(key) for key in keys}

        def note(key: str, reply: zenoh.Reply, who: str = who) -> None:
            done.add(AccessTrial(who, "query", key))

        ask_all(person, questions, note, of=zenoh.Locality.REMOTE)
    return done


def _payload(key: str) -> bytes | None:
    return next((payload for request, payload in _REQUESTS.items() if f"/{request}/" in key), None)


def _declare_tokens(
    people: list[Person], witness: Person, site: str, trials: set[AccessTrial]
) -> set[AccessTrial]:
    """Return the tokens that the witness sees."""
    tokens = {trial.key: trial for trial in trials if trial.act == "liveliness_token"}
    roles = {person.principal.name: person.principal for person in people}
    expected = {each for each in tokens.values() if should(roles[each.who], each.act, each.key)}
    done: set[AccessTrial] = set()

    def see(sample: zenoh.Sample) -> None:
        if (trial := tokens.get(str(sample.key_expr))) is not None:
            done.add(trial)

    everywhere = f"robomesh/{site}/*/alive/operator/*"
    with witness.session.liveliness().declare_subscriber(everywhere, see), ExitStack() as declared:
        settle(witness, site)
        for person in people:
            for key in sorted(key for key, trial in tokens.items() if trial.who == person.principal.name):
                declared.callback(person.session.liveliness().declare_token(key).undeclare)
            settle(person, site)
        settle(witness, site)
        wait_until(partial(expected.issubset, done), TIMEOUT_S)
        time.sleep(_QUIET_S)
    return done
