"""`robomesh doctor --security`: every role against every key, tried on the live mesh.

The keys are those of a robot that does not exist, of its replay, of a wildcard that matches it, and of
another site; publishing and deleting is also tried on the site's real robots. No service accepts a trial:
published messages have no header, and answers are empty. `security_probes` tries leases, commands and tokens
of real robots. Without a harmless probe (presence of services, which every client would see; stops, other
requests, reading and answering on real robots), nothing is tried, and the file of rules is compared with
principals.toml. The topic table gives the expected result.
"""

import time
from collections.abc import Iterable
from contextlib import ExitStack
from functools import partial
from itertools import chain, product

import zenoh

from robomesh.contract.access_rights import PROBE_ROBOT, Act, Principal
from robomesh.contract.keys import has_wildcard
from robomesh.contract.topics import Role, Topic
from services.command_line.doctor.security_probes import probe
from services.command_line.doctor.security_rules import wrong_rules
from services.command_line.doctor.security_sessions import (
    AccessTrial,
    Person,
    open_as,
    settle,
    wait_until,
    who_answers,
    with_files,
)
from services.command_line.doctor.security_table import ROBOTS, ROWS, names, should, tried, tried_on_real
from services.command_line.terminal.output import print_json, print_line
from services.pki import Folder, site_keys
from services.pki.errors import KeysError

_QUIET_S = 0.3
_WORDS: dict[Act, str] = {
    "put": "publish",
    "delete": "delete",
    "declare_subscriber": "read",
    "declare_queryable": "answer",
    "query": "ask",
    "liveliness_token": "be present as",
}


def run(keys: Folder, connect: tuple[str, ...], as_json: bool) -> int:
    """Print the matrix; return 1 if it differs from the topic table.

    Raises:
        KeysError: If there are no keys, or no router accepts them.
    """
    principals = site_keys.principals_of(keys)
    routers = connect or principals.routers
    if not routers:
        raise KeysError(f"{keys.principals} names no routers: give --connect tls/HOST:PORT")
    with ExitStack() as sessions:
        people = [
            Person(entry, sessions.enter_context(open_as(routers, file)))
            for entry, file in with_files(keys, principals)
        ]
        robots = sorted({robot for each in principals.entries for robot in each.robots or ()})
        trials = _trials(people, principals.site, robots)
        witness = next((each for each in people if each.principal.role is Role.ROUTER), None)
        if witness is None:
            raise KeysError("the router's certificate is needed to observe the trials: keys/router.pem")
        done = _try(people, witness, principals.site, trials)
        probed = probe(people, witness, principals.site, robots)
        trials |= probed.trials
        done |= probed.done
    rules = wrong_rules(keys, principals)
    roles = {person.principal.name: person.principal for person in people}
    allowed = {trial for trial in trials if should(roles[trial.who], trial.act, trial.key)}
    wrong = sorted(done ^ allowed, key=lambda trial: (trial.who, trial.act, trial.key))
    if as_json:
        for trial in sorted(done | allowed, key=lambda trial: (trial.who, trial.act, trial.key)):
            row = {"who": trial.who, "act": _WORDS[trial.act], "key": trial.key}
            print_json(row | {"should": trial in allowed, "does": trial in done})
        for problem in rules:
            print_json({"rules": problem})
        for robot in probed.left_out:
            print_json({"not_running": robot})
        return 1 if wrong or rules else 0
    _print([*roles.values()], principals.site, done)
    for trial in wrong:
        does, should_ = ("can", "should not") if trial in done else ("cannot", "should")
        print_line(f"WRONG: {trial.who} {does} {_WORDS[trial.act]} {trial.key}, and {should_}")
    for problem in rules:
        print_line(f"WRONG: {keys.access}: {problem}")
    print_line(
        f"{len(trials)} operations of {len(people)} certificates tried: "
        + (f"{len(wrong)} wrong" if wrong else "all as the table says")
    )
    absent = sorted({role.value for role in Role} - {each.role.value for each in roles.values()})
    if absent:
        print_line(f"not tried, without a certificate here: {', '.join(absent)}")
    if probed.left_out:
        print_line(
            f"leases, commands and tokens not tried, without a running gateway: {', '.join(probed.left_out)}"
        )
    print_line(
        "not tried, compared in the rules only: presence of services; of real robots what is read and "
        "answered, stops, and requests other than leases and commands: "
        + (f"{len(rules)} wrong" if rules else "the rules are what principals.toml gives")
    )
    return 1 if wrong or rules else 0


# ---------------------------------------------------------------------- trials


def _trials(people: list[Person], site: str, robots: Iterable[str]) -> set[AccessTrial]:
    trials = set()
    real = tuple(f"{site}/{robot}" for robot in robots)
    for who, row in product((person.principal for person in people), ROWS):
        for robot in ROBOTS:
            for name, act in product(names(row, who), tried(row, robot)):
                trials.add(AccessTrial(who.name, act, f"robomesh/{site}/{robot}/{name}"))
        for where in (*real, f"{site}x/{PROBE_ROBOT}"):
            for name, act in product(names(row, who), tried_on_real(row)):
                trials.add(AccessTrial(who.name, act, f"robomesh/{where}/{name}"))
    return trials


def _try(people: list[Person], witness: Person, site: str, trials: set[AccessTrial]) -> set[AccessTrial]:
    """Return the trials that succeeded."""
    keys = {act: sorted({trial.key for trial in trials if trial.act == act}) for act in _WORDS}
    by_name = {each.principal.name: each for each in people}
    done: set[AccessTrial] = set()

    def of(person: Person, act: Act) -> list[str]:
        return sorted(
            trial.key for trial in trials if trial.who == person.principal.name and trial.act == act
        )

    # Publishing: the witness receives the message, with the name of its publisher.
    def hear(sample: zenoh.Sample) -> None:
        # The attachment of a real robot's messages is a header, not text.
        mark = sample.attachment.to_bytes() if sample.attachment is not None else b""
        if (name := mark.decode(errors="replace")) in by_name:
            act: Act = "delete" if sample.kind == zenoh.SampleKind.DELETE else "put"
            done.add(AccessTrial(name, act, str(sample.key_expr)))

    with ExitStack() as declared:
        # Exact keys: a subscription to all keys of a robot would start its video.
        for key in {*keys["put"], *keys["delete"]}:
            declared.enter_context(witness.session.declare_subscriber(key, hear))
        settle(witness, site)
        for person in people:
            for key in of(person, "put"):
                person.session.put(key, b"", attachment=person.principal.name)
            for key in of(person, "delete"):
                person.session.delete(key, attachment=person.principal.name)
            settle(person, site)
        time.sleep(_QUIET_S)
    done -= {trial for trial in done if trial not in trials}
    # Reading: the witness publishes on every key once.
    with ExitStack() as declared:
        for person in people:

            def note(sample: zenoh.Sample, person: Person = person) -> None:
                if sample.attachment is not None and sample.attachment.to_bytes() == b"witness":
                    person.received.add(str(sample.key_expr))

            for key in of(person, "declare_subscriber"):
                declared.enter_context(person.session.declare_subscriber(key, note))
            settle(person, site)
        for key in keys["declare_subscriber"]:
            witness.session.put(key, b"", attachment="witness")
        for person in people:
            wanted = set(of(person, "declare_subscriber"))
            wait_until(partial(wanted.issubset, person.received))
            done |= {AccessTrial(person.principal.name, "declare_subscriber", key) for key in person.received}
    # Answering: the witness queries. Wildcards separately: a session with both would answer with either.
    answered = keys["declare_queryable"]
    for vague in (False, True):
        with ExitStack() as declared:
            for person in people:
                for key in of(person, "declare_queryable"):
                    if has_wildcard(key) is vague:
                        declared.enter_context(_answering(person, key))
                settle(person, site)
            asked = who_answers(witness, (key for key in answered if not has_wildcard(key)))
            done |= {AccessTrial(name, "declare_queryable", key) for name, key in chain(*asked.values())}
    # Requesting: the witness answers.
    with ExitStack() as declared:
        for key in keys["query"]:
            declared.enter_context(_answering(witness, key))
        settle(witness, site)
        for person in people:
            asked = who_answers(person, of(person, "query"))
            done |= {AccessTrial(person.principal.name, "query", key) for key, by in asked.items() if by}
    return done & trials


def _answering(person: Person, key: str) -> zenoh.Queryable[None]:
    def reply(query: zenoh.Query) -> None:
        with query:
            query.reply(str(query.key_expr), b"", attachment=f"{person.principal.name} {key}")

    return person.session.declare_queryable(key, reply)


# ---------------------------------------------------------------------- output


def _print(people: list[Principal], site: str, done: set[AccessTrial]) -> None:
    """Print a row for each topic or request, a column for each certificate, with the rights found."""
    heads = [each.name.rpartition(".")[0] for each in people]
    width = max(len(row.name) for row in ROWS) + 2
    columns = [max(len(name), 2) + 1 for name in heads]
    print_line("p: publishes, r: reads, o: answers as owner, a: requests")
    print_line("")
    print_line(" " * width + "".join(f"{name:<{size}}" for name, size in zip(heads, columns, strict=True)))
    for row in ROWS:
        letters: dict[Act, str] = (
            {"put": "p", "declare_subscriber": "r"}
            if isinstance(row, Topic)
            else {"declare_queryable": "o", "query": "a"}
        )
        cells = []
        for who in people:
            keys = {f"robomesh/{site}/{robot}/{topic}" for robot in ROBOTS for topic in names(row, who)}
            cells.append(
                "".join(
                    letter if any(AccessTrial(who.name, act, key) in done for key in keys) else "-"
                    for act, letter in letters.items()
                )
            )
        line = "".join(f"{cell:<{size}}" for cell, size in zip(cells, columns, strict=True))
        print_line(f"{row.name:<{width}}{line}")
    print_line("")
