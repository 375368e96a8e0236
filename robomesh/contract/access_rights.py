"""Access control: the rights in the topic table as rules that a router enforces.

The router to which a session connects checks each incoming message against the rules for the common name
of the session's certificate, and rejects it unless a rule allows it. A client uses the same rules to
explain a refusal in words, because a router rejects silently.

Some rules are for Zenoh itself: keys with `@adv` are the caches and heartbeats of recovered topics, and
`endpoints.wait_until_declared` queries a key without an owner to wait for a router.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, get_args

import zenoh

from robomesh import reason_codes as codes
from robomesh.contract import keys
from robomesh.contract.certificate_identity import Identity
from robomesh.contract.topics import PEOPLE, REQUESTS, SERVICES, TOPICS, Request, Role, Topic
from robomesh.errors import KeyNameError
from robomesh.reasons import Reason

Act = Literal[
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "declare_queryable",
    "reply",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
]
ACTS: tuple[Act, ...] = get_args(Act)
Border = Literal["open", "slow"]

# A robot that does not exist, so that rights can be tested on a live mesh. Every gateway may publish for
# it, and every player for its replay.
PROBE_ROBOT = "matrix-probe"
_ROS_DOMAINS = 233
_REPLAYS = (keys.replay_name("$*"),)
_PUBLISH: tuple[Act, ...] = ("put", "declare_queryable", "reply")
_ANSWER: tuple[Act, ...] = ("declare_queryable", "reply")
_LISTEN: tuple[Act, ...] = ("declare_subscriber",)
_ADVANCED: tuple[Act, ...] = ("put", "declare_queryable", "reply", "liveliness_token")
_LOOK: tuple[Act, ...] = ("query", "declare_subscriber", "liveliness_query", "declare_liveliness_subscriber")
_PRESENT: tuple[Act, ...] = ("liveliness_query", "declare_liveliness_subscriber")
_LARGEST_PUT = 8 << 20
_LARGEST_QUERY = 4 << 20
_LARGEST_REPLY = 256 << 20  # a mesh
_LARGEST = (("put", _LARGEST_PUT), ("query", _LARGEST_QUERY), ("reply", _LARGEST_REPLY))


@dataclass(frozen=True, kw_only=True)
class Principal:
    """The owner of a certificate.

    Attributes:
        name: The certificate's common name, <name>.<site>.
        robots: The robots of a gateway; None: only the routers' rules name them.
        sites: For another site's router: the sites that it represents; `*`: all sites but ours (a hub).
    """

    name: str
    role: Role
    robots: frozenset[str] | None = None
    sites: tuple[str, ...] = ()

    @property
    def site(self) -> str:
        """Site of the principal."""
        return self.name.rpartition(".")[2]


@dataclass(frozen=True, kw_only=True)
class Rule:
    """Acts allowed on keys, or forbidden on them even if another rule allows them.

    Attributes:
        outwards: The rule applies to messages from the router to the principal.
    """

    acts: tuple[Act, ...]
    keys: tuple[str, ...]
    allow: bool = True
    outwards: bool = False


def principal_of(identity: Identity) -> Principal:
    """Return the principal that a certificate's file describes."""
    return Principal(name=identity.name, role=identity.role, robots=identity.robots)


@lru_cache(1024)
def rights(principal: Principal, site: str, border: Border = "open") -> tuple[Rule, ...]:
    """Return the rules of a site's router for a principal."""
    if principal.role is Role.ROUTER and principal.site == site:
        # Another router of this site has already checked what it forwards.
        return (_everything(outwards=False), _everything(outwards=True))
    if principal.sites:
        return tuple(_linked_site(principal, site, border))
    return (*_own_site_rules(principal, site), _everything(outwards=True))


@lru_cache(4096)
def may(principal: Principal, site: str, act: Act, key: str) -> bool:
    """Return whether a router allows an act on a key, or on every key that a wildcard matches."""
    asked = zenoh.KeyExpr(key)
    of_act = [rule for rule in rights(principal, site) if act in rule.acts and not rule.outwards]
    hits = [rule.allow for rule in of_act if any(zenoh.KeyExpr(each).includes(asked) for each in rule.keys)]
    return bool(hits) and all(hits)


def access_sections(site: str, principals: Iterable[Principal], border: Border = "open") -> dict[str, Any]:
    """Return the sections of a router's configuration with the rules, for our router and for zenohd.

    A name without rules has no rights.
    """
    rules: dict[Rule, str] = {}
    subjects, policies = [], []
    for principal in sorted(principals, key=lambda each: each.name):
        own = [
            rules.setdefault(rule, f"{len(rules) + 1:03}-{principal.role.value}")
            for rule in rights(principal, site, border)
        ]
        subjects.append({"id": principal.name, "cert_common_names": _common_names(principal)})
        policies.append({"subjects": [principal.name], "rules": own})
    return {
        "access_control": {
            "enabled": True,
            "default_permission": "deny",
            "rules": [
                {
                    "id": name,
                    "permission": "allow" if rule.allow else "deny",
                    "flows": ["egress" if rule.outwards else "ingress"],
                    "messages": list(rule.acts),
                    "key_exprs": list(rule.keys),
                }
                for rule, name in rules.items()
            ],
            "subjects": subjects,
            "policies": policies,
        },
        # A large message must not fill a router's memory.
        "low_pass_filter": [
            {
                "flows": ["ingress"],
                "messages": [message],
                "key_exprs": ["**", "**/@adv/**"],
                "size_limit": limit,
            }
            for message, limit in _LARGEST
        ],
    }


def _common_names(principal: Principal) -> list[str]:
    """Return the names to match: another site may have the routers router, router-2 and router-3."""
    if not principal.sites:
        return [principal.name]
    return [principal.name, *(f"{Role.ROUTER.value}-{n}.{principal.site}" for n in (2, 3))]


# ----------------------------------------------------------------- this site


def _own_site_rules(principal: Principal, site: str) -> Iterator[Rule]:
    role, robots = principal.role, _robots_of(principal)

    def ours(names: Iterable[str], each: Iterable[str] = robots) -> tuple[str, ...]:
        return tuple(f"{keys.ROOT}/{site}/{robot}/{name}" for name in names for robot in each)

    published = [row for row in TOPICS.values() if role in row.publishers]
    if published:
        yield Rule(acts=_PUBLISH, keys=ours(_published_as(row, role) for row in published))
    if recovered := [row for row in published if row.recovered]:
        names = (f"{_published_as(row, role)}/@adv/**" for row in recovered)
        yield Rule(acts=_ADVANCED, keys=ours(names))
    if owned := [row for row in REQUESTS.values() if role in row.owners]:
        yield Rule(acts=_ANSWER, keys=ours(row.name for row in owned))
    yield Rule(acts=_LISTEN, keys=_subscribable(role))
    yield Rule(acts=_LOOK, keys=(f"{keys.ROOT}/**/@adv/**",))
    yield Rule(acts=("query",), keys=tuple(_queryable(role, _names_of(principal, site))))
    yield Rule(acts=_PRESENT, keys=(f"{keys.ROOT}/*/*/alive/*/*",))
    # People are present by their sessions alone.
    present = () if role in PEOPLE else ours([f"alive/{role.value}/*"])
    yield Rule(
        acts=("liveliness_token",), keys=(*present, *_session_tokens(role, _names_of(principal, site)))
    )
    if role is Role.ROS2:
        yield from _ros()


def _ros() -> Iterator[Rule]:
    """Allow the traffic between ROS 2 nodes with rmw_zenoh, in every domain; it uses no key of the mesh."""
    domains = tuple(f"{domain}/**" for domain in range(_ROS_DOMAINS))
    yield Rule(acts=ACTS, keys=(*domains, *(f"{each}/@adv/**" for each in domains), "@ros2_lv/**"))


def _robots_of(principal: Principal) -> tuple[str, ...]:
    """Return the robots below whose keys a service may publish, as chunks.

    A gateway gets exact names. A wildcard with exceptions would not do: a rule that forbids one name does
    not apply to a wildcard that matches the name.
    """
    if principal.role is Role.PLAYER:
        return (*_REPLAYS, keys.WHOLE_SITE)
    if principal.role is Role.GATEWAY and principal.robots is not None:
        return (*sorted(principal.robots), PROBE_ROBOT, keys.WHOLE_SITE)
    return ("*",)


def _published_as(row: Topic, role: Role) -> str:
    """Return a topic's name as a role may publish it; topics with a key for each service name the service."""
    if role is Role.PLAYER and row.name.startswith("events/"):
        return row.name  # a player replays the events of every service
    return row.name.replace("events/*", f"events/{role.value}").replace("health/*", f"health/{role.value}.$*")


def _names_of(principal: Principal, site: str) -> str:
    """Return the names that a principal may use in requests, as a chunk; a console uses its site's."""
    return f"$*.{site}" if principal.role is Role.CONSOLE else principal.name


def _subscribable(role: Role) -> tuple[str, ...]:
    """Return the topics that a role may subscribe to, row by row.

    A subscriber of `robomesh/**` would make every publisher send everything.
    """
    return tuple(f"{keys.ROOT}/*/*/{row.name}" for row in TOPICS.values() if role in row.subscribers)


def _queryable(role: Role, names: str) -> Iterator[str]:
    """Return the keys that a role may query, at every site."""
    yield f"{keys.ROOT}/-/-/-"
    for row in TOPICS.values():
        if role in row.subscribers:
            yield f"{keys.ROOT}/*/*/{row.name}"
    for request in REQUESTS.values():
        if role in request.askers:
            # Never `**`: it would match any operator's name.
            yield f"{keys.ROOT}/*/*/{_query_name(request, names)}"


def _query_name(row: Request, names: str) -> str:
    return f"{row.name.rpartition('/')[0]}/{names}" if row.in_name else row.name


def _session_tokens(role: Role, names: str) -> Iterator[str]:
    """Return the session tokens that a role may declare: at a robot for a lease, at a site for a replay.

    Args:
        names: The names that the tokens may carry, as a chunk. A token's id is <name>.<id>, and only its
            owner may declare it: another program's token would keep a lease after its holder's session.
    """
    owned = names if names == "*" else f"{names}.$*"
    yield f"{keys.ROOT}/*/{keys.WHOLE_SITE}/alive/operator/{owned}"
    yield f"{keys.ROOT}/*/*/alive/monitor/*"
    if role in REQUESTS["lease/request/*"].askers:
        yield f"{keys.ROOT}/*/*/alive/operator/{owned}"


def _everything(*, outwards: bool) -> Rule:
    return Rule(acts=ACTS, keys=("**", "**/@adv/**", "@ros2_lv/**"), outwards=outwards)


# --------------------------------------------------------------- other sites


def _linked_site(principal: Principal, site: str, border: Border) -> Iterator[Rule]:
    """Return the rules for another site's router: what it may send to us, and what we send to it."""
    hub = "*" in principal.sites
    theirs = tuple(f"{keys.ROOT}/{each}" for each in (("*",) if hub else principal.sites))
    brought = tuple(f"{each}/*/**{more}" for each in theirs for more in ("", "/@adv/**"))
    yield Rule(acts=(*_PUBLISH, "liveliness_token"), keys=brought)
    # Its users may send requests and commands here, in their own names, like our users.
    names = ("*",) if hub else tuple(f"$*.{each}" for each in principal.sites)
    asked = dict.fromkeys(key for name in names for key in _queryable(Role.CONSOLE, name))
    yield Rule(acts=("query",), keys=tuple(asked))
    yield Rule(acts=_LOOK, keys=(f"{keys.ROOT}/**/@adv/**",))
    yield Rule(acts=_PRESENT, keys=(f"{keys.ROOT}/*/*/alive/*/*",))
    held = dict.fromkeys(key for name in names for key in _session_tokens(Role.CONSOLE, name))
    yield Rule(acts=("liveliness_token",), keys=tuple(held))
    yield Rule(
        acts=_LISTEN, keys=(f"{keys.ROOT}/**",) if border == "open" else tuple(_sent_by_slow_border(site))
    )
    ours = f"{keys.ROOT}/{site}"
    if hub:
        # A hub represents all other sites, never ours; our site's requests do not go to it.
        yield Rule(acts=_PUBLISH, keys=(f"{ours}/**", f"{ours}/**/@adv/**"), allow=False)
        present = tuple(f"{ours}/*/alive/{role.value}/*" for role in Role if role in SERVICES)
        own_people = f"{keys.ROOT}/*/*/alive/operator/$*.{site}.$*"
        yield Rule(acts=("liveliness_token",), keys=(*present, own_people), allow=False)
        named = tuple(f"{ours}/*/{_query_name(row, '*')}" for row in REQUESTS.values())
        yield Rule(acts=("query",), keys=named, allow=False, outwards=True)
        own_names = tuple(f"{keys.ROOT}/*/*/{_query_name(row, f'$*.{site}')}" for row in _in_names())
        yield Rule(acts=("query",), keys=own_names, allow=False)
    if border == "open":
        yield _everything(outwards=True)
        return
    yield Rule(
        acts=tuple(act for act in ACTS if act not in _PUBLISH),
        keys=_everything(outwards=True).keys,
        outwards=True,
    )
    yield Rule(acts=_PUBLISH, keys=tuple(_sent_by_slow_border(site)), outwards=True)


def _in_names() -> tuple[Request, ...]:
    return tuple(row for row in REQUESTS.values() if row.in_name)


def _sent_by_slow_border(site: str) -> Iterator[str]:
    """Return what a slow border sends: topics without a rate, `joints/slow`, and the view `far`."""
    for row in TOPICS.values():
        if row.rate_hz is None or row.name == "joints/slow":
            yield f"{keys.ROOT}/*/*/{row.name}"
            if row.recovered:
                yield f"{keys.ROOT}/*/*/{row.name}/@adv/**"
    yield f"{keys.ROOT}/*/*/video/far"
    for request in REQUESTS.values():
        yield f"{keys.ROOT}/*/*/{request.name}"


# --------------------------------------------------------------------- words


def refusal(principal: Principal, act: Act, key: str) -> Reason:
    """Return why a principal may not do an act on a key."""
    who = {"name": principal.name, "role": principal.role.value}
    try:
        site, robot, topic = keys.parse_expression(key)
    except KeyNameError:
        return codes.RIGHT_KEY(**who, key=key)
    row = _row(topic)
    if row is None:
        return codes.RIGHT_KEY(**who, key=key)
    verb, roles = _verb(row, act)
    what = {**who, "act": verb, "topic": topic}
    if principal.role not in roles:
        return codes.RIGHT_ROLE(**what, roles=", ".join(sorted(role.value for role in roles)))
    if isinstance(row, Request) and row.in_name and act == "query":
        own = _query_name(row, _names_of(principal, principal.site).replace("$*", "NAME"))
        return codes.RIGHT_NAME(**what, own=own)
    if site != principal.site:
        return codes.RIGHT_SITE(**what, site=site)
    return codes.RIGHT_ROBOT(**what, robot=robot, robots=", ".join(sorted(principal.robots or ())))


def _verb(row: Topic | Request, act: Act) -> tuple[str, frozenset[Role]]:
    if isinstance(row, Topic):
        return ("publish", row.publishers) if act in _PUBLISH else ("read", row.subscribers)
    return ("answer", row.owners) if act in _ANSWER else ("ask", row.askers)


def _row(name: str) -> Topic | Request | None:
    asked = zenoh.KeyExpr(name)
    rows: tuple[Mapping[str, Topic | Request], ...] = (TOPICS, REQUESTS)
    return next(
        (row for table in rows for pattern, row in table.items() if zenoh.KeyExpr(pattern).includes(asked)),
        None,
    )
