"""Every role against every key of the topic table, on a live router with TLS and the generated rules."""

import json
import threading
from dataclasses import dataclass, field
from itertools import chain, product
from pathlib import Path

import pytest
import zenoh

from robomesh.contract.endpoints import Tls, bundle, client_config, router_config
from robomesh.contract.keys import parse_presence_key
from robomesh.contract.topics import PEOPLE, REQUESTS, SERVICES, TOPICS, Role
from robomesh.errors import KeyNameError
from services.pki import Folder, site_keys
from services.router.router import read_access
from tests.ports import free_port
from tests.site import wait_until

SITE, OTHER_SITE, HUB = "here", "there", "hub"
OWN_ROBOT, STARTED_ROBOT, FOREIGN_ROBOT, REPLAY = "arm", "mine", "not-ours", "replay-1"
ROBOTS = (OWN_ROBOT, STARTED_ROBOT, FOREIGN_ROBOT, REPLAY)
# A principal that may use these may use the keys of every robot that they match.
VAGUE = ("*", "ar$*")
DEADLINE_S = 20.0
# The site's second router sees and answers everything.
WITNESS = "router-2.here"
IN_NAME = (
    "lease/request/*",
    "command/*",
    "jog/*",
    "alarms/request/*",
    "cell/request/*",
    "programs/request/*",
    "layouts/request/*",
    "notes/request/*",
    "notes/withdraw/*",
    "kinematics/check/*",
    "views/*",
    "video/*/keyframe/*",
    "recordings/request/*",
    "recordings/range/*",
    "recordings/series/*",
    "recordings/piece/*",
)
# An operator's name that contains a request's: rules for the request's key must not match it.
REQUESTS_OF_ONE_WORD = ("stop",)


@dataclass
class Party:
    """Plain Zenoh client with a certificate, without the checks of this library."""

    name: str
    role: Role
    session: zenoh.Session
    heard: set[str] = field(default_factory=set)

    def settle(self) -> None:
        """Wait until the router has processed everything sent: one link keeps the order."""
        list(self.session.get(f"robomesh/{SITE}/{OWN_ROBOT}/stop", timeout=DEADLINE_S))


def people() -> dict[str, Role]:
    named = {f"{role.value}.{SITE}": role for role in SERVICES}
    named["started.here"] = Role.GATEWAY
    return named | {"li.here": Role.OPERATOR, "wang.here": Role.ENGINEER, "mo.here": Role.MONITOR}


def one_link(endpoint: str, tls: Tls) -> zenoh.Config:
    config = client_config((endpoint,), tls)
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    return config


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    """Yield a router, a client for each principal, and the witness, which answers every request."""
    folder = Folder(tmp_path_factory.mktemp("site") / "keys")
    site_keys.prepare(folder, SITE, robots=[OWN_ROBOT], border="open", routers=[], started=[STARTED_ROBOT])
    for name, role in people().items():
        if role in PEOPLE:
            site_keys.issue(folder, name, role)
    site_keys.issue(folder, WITNESS, Role.ROUTER)
    site_keys.issue(folder, "gone", Role.OPERATOR)
    site_keys.revoke(folder, "gone")
    site_keys.issue_guest(folder, OTHER_SITE)
    site_keys.issue_guest(folder, HUB, sites=["*"])
    endpoint = f"tls/127.0.0.1:{free_port()}"
    opened = [zenoh.open(router_config((endpoint,), (), folder.tls_of("router"), read_access(folder.access)))]

    def attach(name: str, role: Role, file: Path) -> Party:
        opened.append(zenoh.open(one_link(endpoint, bundle(file))))
        return Party(name, role, opened[-1])

    try:
        everybody = {
            name: attach(
                name, role, folder.person(name[:-5]) if role in PEOPLE else folder.service(name[:-5])
            )
            for name, role in people().items()
        }
        yield (
            everybody,
            attach(WITNESS, Role.ROUTER, folder.service("router-2")),
            attach("gone.here", Role.OPERATOR, folder.person("gone")),
            {site: attach(f"router.{site}", Role.ROUTER, folder.guest(site)) for site in (OTHER_SITE, HUB)},
        )
    finally:
        for session in reversed(opened):
            session.close()


# ------------------------------------------------ expected rights, derived independently


def speaks_for(name: str, role: Role, robot: str) -> bool:
    if role is Role.GATEWAY:
        return robot == {"gateway.here": OWN_ROBOT, "started.here": STARTED_ROBOT}[name]
    return role is not Role.PLAYER or robot == REPLAY


def may_publish(name: str, role: Role, robot: str, row: str, topic: str) -> bool:
    if role is Role.ROUTER:
        return True  # a router of the site forwards what it allowed
    if role not in TOPICS[row].publishers or not speaks_for(name, role, robot):
        return False
    if row == "events/*" and role is not Role.PLAYER:
        return topic == f"events/{role.value}"
    return row != "health/*" or topic.startswith(f"health/{role.value}.")


def may_answer(name: str, role: Role, robot: str, row: str) -> bool:
    return role is Role.ROUTER or (role in REQUESTS[row].owners and speaks_for(name, role, robot))


def may_ask(name: str, role: Role, row: str, topic: str) -> bool:
    if role is Role.ROUTER:
        return True
    if role not in REQUESTS[row].askers:
        return False
    asked_by = topic.rpartition("/")[2]
    if row not in IN_NAME:
        return True
    return asked_by.endswith(f".{SITE}") if role is Role.CONSOLE else asked_by == name


def topics_of(row: str) -> list[str]:
    """Return the keys of a topic's or request's row, with the own and with other names."""
    chunks = {
        "events/*": [role.value for role in SERVICES],
        "health/*": [f"{role.value}.0a" for role in SERVICES],
        **{row: ["li.here", "wang.here", "li.there", *REQUESTS_OF_ONE_WORD] for row in IN_NAME},
    }
    return [row.replace("*", chunk) for chunk in chunks.get(row, ["x"])] if "*" in row else [row]


PUBLISHED = [(row, topic) for row in TOPICS for topic in topics_of(row)]
ASKED = [(row, topic) for row in REQUESTS for topic in topics_of(row)]


def key(robot: str, topic: str, site: str = SITE) -> str:
    return f"robomesh/{site}/{robot}/{topic}"


class Arrived:
    """Condition that the expected set has arrived."""

    def __init__(self) -> None:
        self._seen: set[tuple[str, str]] = set()
        self._changed = threading.Condition()

    def __call__(self, sample: zenoh.Sample) -> None:
        with self._changed:
            self._seen.add((sample.payload.to_string(), str(sample.key_expr)))
            self._changed.notify_all()

    def once_there(self, wanted: set[tuple[str, str]]) -> set[tuple[str, str]]:
        with self._changed:
            self._changed.wait_for(lambda: wanted <= self._seen, DEADLINE_S)
            return set(self._seen)


def declare_queryables(party: Party, keys: list[str]) -> list[zenoh.Queryable]:
    def reply(query: zenoh.Query) -> None:
        with query:
            query.reply(str(query.key_expr), party.name)

    return [party.session.declare_queryable(each, reply) for each in keys]


def asked(party: Party, keys: list[str]) -> dict[str, set[str]]:
    """Return the principals that answered each key; all keys are queried in parallel."""
    left, done = len(keys), threading.Condition()
    answers: dict[str, set[str]] = {each: set() for each in keys}

    def ended() -> None:
        nonlocal left
        with done:
            left -= 1
            done.notify_all()

    for each in keys:
        heard = answers[each]

        def on_reply(reply: zenoh.Reply, heard: set[str] = heard) -> None:
            if reply.ok is not None:
                heard.add(reply.ok.payload.to_string())

        party.session.get(
            each,
            zenoh.handlers.Callback(on_reply, ended),
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=DEADLINE_S,
        )
    with done:
        assert done.wait_for(lambda: left == 0, DEADLINE_S)
    return answers


# --------------------------------------------------------------------- tests


def test_each_role_publishes_only_its_topics(mesh):
    everybody, witness, gone, _ = mesh
    wanted = {
        (who.name, key(robot, topic))
        for who, robot, (row, topic) in product(everybody.values(), (*ROBOTS, *VAGUE), PUBLISHED)
        if may_publish(who.name, who.role, robot, row, topic)
    }
    arrived = Arrived()
    subscriber = witness.session.declare_subscriber("robomesh/**", arrived)
    answers = declare_queryables(witness, [key(OWN_ROBOT, "stop")])
    witness.settle()
    for who in (*everybody.values(), gone):
        for robot, (_, topic) in product((*ROBOTS, *VAGUE), PUBLISHED):
            who.session.put(key(robot, topic), who.name)
        who.settle()
    assert arrived.once_there(wanted) == wanted
    for each in (subscriber, *answers):
        each.undeclare()


def test_each_role_makes_only_its_requests_in_its_own_name(mesh):
    everybody, witness, gone, _ = mesh
    keys = [key(OWN_ROBOT, topic) for _, topic in ASKED]
    answers = declare_queryables(witness, keys)
    witness.settle()
    for who in everybody.values():
        wanted = {key(OWN_ROBOT, topic) for row, topic in ASKED if may_ask(who.name, who.role, row, topic)}
        assert {each for each, by in asked(who, keys).items() if by} == wanted, who.name
    assert not any(asked(gone, keys).values())
    for each in answers:
        each.undeclare()


# Routers compare each answerer with all others: half as many keys cost a quarter. At a foreign robot no
# gateway is an owner, so an answer through `*` shows for every gateway. `ar$*` matches only the own robot.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "vague"),
    [
        (OWN_ROBOT, "ar$*"),
        (FOREIGN_ROBOT, "*"),
        *(pytest.param(robot, "*", marks=pytest.mark.long) for robot in (STARTED_ROBOT, REPLAY)),
    ],
)
def test_only_owners_of_a_request_and_publishers_of_a_topic_answer(mesh, robot, vague):
    everybody, witness, gone, _ = mesh
    declared, wanted = [], {}
    both = [*((row, topic, True) for row, topic in PUBLISHED), *((row, topic, False) for row, topic in ASKED)]
    for row, topic, published in both:
        wanted[key(robot, topic)] = {
            who.name
            for who in everybody.values()
            if (
                may_publish(who.name, who.role, robot, row, topic)
                if published
                else may_answer(who.name, who.role, robot, row)
            )
        }
    for who in (*everybody.values(), gone):
        declared += declare_queryables(who, [*wanted, *(key(vague, topic) for _, topic, _ in both)])
        who.settle()
    assert asked(witness, list(wanted)) == wanted
    for each in declared:
        each.undeclare()


def test_each_role_reads_its_topics_and_a_revoked_certificate_reads_none(mesh):
    everybody, witness, gone, _ = mesh
    keys = [key(OWN_ROBOT, topic) for _, topic in PUBLISHED]
    readers = (*everybody.values(), gone)
    arrived = {who.name: Arrived() for who in readers}
    declared = []

    def once_all_listen_to(*expressions):
        for who in readers:
            declared.extend(who.session.declare_subscriber(each, arrived[who.name]) for each in expressions)
            who.settle()

    once_all_listen_to("robomesh/**")
    for each in keys:
        witness.session.put(each, "to all")
    # Otherwise a delayed message could reach the subscribers of the rows.
    to_all = {("to all", each) for each in keys}
    routers = [who for who in everybody.values() if who.role is Role.ROUTER]
    assert all(to_all <= arrived[who.name].once_there(to_all) for who in routers)
    once_all_listen_to(*(f"robomesh/*/*/{row}" for row in TOPICS))
    for each in keys:
        witness.session.put(each, "to rows")
    wanted = {("to rows", each) for each in keys}
    for who in everybody.values():
        seen = arrived[who.name].once_there(wanted)
        assert wanted <= seen, who.name
        assert who.role is Role.ROUTER or not any(payload == "to all" for payload, _ in seen), who.name
    assert arrived[gone.name].once_there(set()) == set()
    for each in declared:
        each.undeclare()


def test_a_service_declares_presence_only_with_its_name_and_a_gateway_only_for_its_robots(mesh):
    everybody, witness, gone, _ = mesh
    tokens, wanted = [], set()
    for who in (*everybody.values(), gone):
        for robot, service, of in product((*ROBOTS, *VAGUE), Role, (who.name, "wang.here", "wang.there")):
            by = who.name.replace(".", "-")
            token = key(robot, f"alive/{service.value}/{of}.{by}")
            tokens.append(who.session.liveliness().declare_token(token))
            own = service is who.role and service not in PEOPLE and speaks_for(who.name, who.role, robot)
            # Only the operator declares its session's token; a console declares those of the site's people.
            owner = of == who.name or (who.role is Role.CONSOLE and of.endswith(f".{SITE}"))
            held = service is Role.OPERATOR and who.role in REQUESTS["command/*"].askers and owner
            if who is not gone and (who.role is Role.ROUTER or own or held or service is Role.MONITOR):
                wanted.add(token)
        who.settle()
    replies = witness.session.liveliness().get("robomesh/*/*/alive/*/*", timeout=DEADLINE_S)
    assert {str(reply.ok.key_expr) for reply in replies if reply.ok is not None} == wanted
    for each in tokens:
        each.undeclare()


def test_a_linked_sites_router_forwards_only_its_own_site_and_people(mesh):
    _, witness, _, guests = mesh
    guest = guests[OTHER_SITE]
    sites = (SITE, OTHER_SITE, "third")
    arrived = Arrived()
    subscriber = witness.session.declare_subscriber("robomesh/**", arrived)
    names = ["command/li.here", "command/li.there", "command/li.third", "lease/request/li.there", "stop"]
    names += ["views/li.here", "views/li.there", "views/li.third"]
    answers = declare_queryables(witness, [key(OWN_ROBOT, each) for each in names])
    witness.settle()
    for site, topic in product(sites, ("joints", "events", "audit", "video/x")):
        guest.session.put(key(OWN_ROBOT, topic, site), guest.name)
    guest.settle()
    wanted = {
        (guest.name, key(OWN_ROBOT, each, OTHER_SITE)) for each in ("joints", "events", "audit", "video/x")
    }
    assert arrived.once_there(wanted) == wanted
    by = asked(guest, [key(OWN_ROBOT, each) for each in names])
    assert {each for each, answered in by.items() if answered} == {
        key(OWN_ROBOT, each)
        for each in ("command/li.there", "lease/request/li.there", "views/li.there", "stop")
    }
    by = asked(guests[HUB], [key(OWN_ROBOT, each) for each in names])  # of every site but ours
    assert {each for each in names if not by[key(OWN_ROBOT, each)]} == {"command/li.here", "views/li.here"}
    for each in (subscriber, *answers):
        each.undeclare()
    queryables = declare_queryables(guest, [key(OWN_ROBOT, "command/x", site) for site in sites])
    guest.settle()
    by = asked(witness, [key(OWN_ROBOT, "command/x", site) for site in sites])
    assert [bool(by[key(OWN_ROBOT, "command/x", site)]) for site in sites] == [False, True, False]
    for each in queryables:
        each.undeclare()


def test_a_hub_declares_presence_for_any_site_but_ours(mesh):
    _, witness, _, guests = mesh
    sites, services = (SITE, OTHER_SITE), (Role.GATEWAY, Role.WATCH, Role.OPERATOR)
    named = [key(OWN_ROBOT, f"alive/{role.value}/0a", site) for site, role in product(sites, services)]
    named += [key(OWN_ROBOT, f"alive/operator/li.{site}.0a") for site in sites]
    vague = [f"robomesh/*/{OWN_ROBOT}/alive/gateway/0a", f"robomesh/{SITE[:2]}$*/arm/alive/gateway/0b"]
    tokens = [guests[HUB].session.liveliness().declare_token(each) for each in (*named, *vague)]
    guests[HUB].settle()
    replies = witness.session.liveliness().get("robomesh/*/*/alive/*/*", timeout=DEADLINE_S)
    seen = {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}
    assert {each for each in seen if each in named} == {
        key(OWN_ROBOT, "alive/operator/0a"),
        key(OWN_ROBOT, f"alive/operator/li.{OTHER_SITE}.0a"),
        *(key(OWN_ROBOT, f"alive/{role.value}/0a", OTHER_SITE) for role in services),
    }
    for each in vague:  # a router cannot exclude ours from the match; receivers can
        with pytest.raises(KeyNameError, match="cannot be used"):
            parse_presence_key(each)
    for each in tokens:
        each.undeclare()


def test_the_router_drops_a_message_above_the_limit_on_every_key(mesh):
    everybody, witness, _, _ = mesh
    arrived = []
    published = {
        f"gateway.{SITE}": [key(OWN_ROBOT, "raw"), key(OWN_ROBOT, "events/@adv/x")],
        f"ros2.{SITE}": ["7/image"],
    }
    subscribers = [
        witness.session.declare_subscriber(
            each, lambda sample: arrived.append((str(sample.key_expr), len(sample.payload)))
        )
        for each in chain(*published.values())
    ]
    answers = declare_queryables(witness, [key(OWN_ROBOT, "stop")])
    witness.settle()
    for name, keys in published.items():
        for each, mebibytes in product(keys, (9, 1)):
            everybody[name].session.put(
                each, bytes(mebibytes << 20), congestion_control=zenoh.CongestionControl.BLOCK
            )
        everybody[name].settle()
    expected = sorted((each, 1 << 20) for each in chain(*published.values()))
    # The larger message of each key would arrive first.
    wait_until(lambda: len(arrived) >= len(expected), DEADLINE_S, "not every message arrived")
    assert sorted(arrived) == expected
    for each in (*subscribers, *answers):
        each.undeclare()
