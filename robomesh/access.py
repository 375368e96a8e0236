"""Who may do what on the mesh: the table of topics as rules that a router keeps.

A right is judged where a session attaches, by the common name of its certificate: what comes in is
refused unless a rule allows it. The same rules tell a client in words what it may not do.

The rules name what Zenoh itself needs too: keys with `@adv` are the caches and heartbeats of recovered
topics, and the key that nobody has is asked to wait for a router (`endpoints.settle`).
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, get_args

import zenoh

from robomesh import keys
from robomesh.certificate_identity import Identity
from robomesh.errors import KeyNameError
from robomesh.topics import PEOPLE, REQUESTS, SERVICES, TOPICS, Request, Role, Topic

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

# Every gateway may speak for a robot of this name, and a player for its replay: there is none, so that
# rights can be tried on a live mesh.
NOBODYS_ROBOT = "matrix-probe"
_ROS_DOMAINS = 233
_REPLAYS = ("replay-$*",)
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
    """Somebody with a certificate.

    Attributes:
        name: Its common name, <name>.<site>.
        robots: A gateway's; None: its own file does not say, and the routers' rules do.
        sites: Another site's router: the sites that it speaks for; `*`: any but our own (a hub).
    """

    name: str
    role: Role
    robots: frozenset[str] | None = None
    sites: tuple[str, ...] = ()

    @property
    def site(self) -> str:
        """The site that it belongs to."""
        return self.name.rpartition(".")[2]


@dataclass(frozen=True, kw_only=True)
class Rule:
    """Acts on keys that are allowed, or forbidden whatever else allows them."""

    acts: tuple[Act, ...]
    keys: tuple[str, ...]
    allow: bool = True
    outwards: bool = False


def principal_of(identity: Identity) -> Principal:
    """Who an own certificate is, as far as its file says."""
    return Principal(name=identity.name, role=identity.role, robots=identity.robots)


@lru_cache(1024)
def rights(principal: Principal, site: str, border: Border = "open") -> tuple[Rule, ...]:
    """What a site's router lets somebody do."""
    if principal.role is Role.ROUTER and principal.site == site:
        # Another router of this site brings whatever it has let in.
        return (_everything(outwards=False), _everything(outwards=True))
    if principal.sites:
        return tuple(_guest(principal, site, border))
    return (*_own(principal, site), _everything(outwards=True))


@lru_cache(4096)
def may(principal: Principal, site: str, act: Act, key: str) -> bool:
    """Whether a router lets somebody do something on a key, or on all that a wildcard means."""
    asked = zenoh.KeyExpr(key)
    of_act = [rule for rule in rights(principal, site) if act in rule.acts and not rule.outwards]
    hits = [rule.allow for rule in of_act if any(zenoh.KeyExpr(each).includes(asked) for each in rule.keys)]
    return bool(hits) and all(hits)


def access_sections(site: str, principals: Iterable[Principal], border: Border = "open") -> dict[str, Any]:
    """The sections of a router's configuration that keep the rules, for ours and for zenohd.

    A name that stands in none of them may do nothing.
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
        # Nobody's message fills a router's memory.
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
    """Another site may have several routers, which it names router, router-2, router-3."""
    if not principal.sites:
        return [principal.name]
    return [principal.name, *(f"{Role.ROUTER.value}-{n}.{principal.site}" for n in (2, 3))]


# ------------------------------------------------------------------- our own


def _own(principal: Principal, site: str) -> Iterator[Rule]:
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
    yield Rule(acts=_LISTEN, keys=_heard(role))
    yield Rule(acts=_LOOK, keys=(f"{keys.ROOT}/**/@adv/**",))
    yield Rule(acts=("query",), keys=tuple(_asked(role, _names_of(principal, site))))
    yield Rule(acts=_PRESENT, keys=(f"{keys.ROOT}/*/*/alive/*/*",))
    # People are present by their sessions alone.
    present = () if role in PEOPLE else ours([f"alive/{role.value}/*"])
    yield Rule(acts=("liveliness_token",), keys=(*present, *_held(role, _names_of(principal, site))))
    if role is Role.ROS2:
        yield from _ros()


def _ros() -> Iterator[Rule]:
    """What ROS 2 nodes with rmw_zenoh say to each other, in every domain; no key of the mesh's own."""
    domains = tuple(f"{domain}/**" for domain in range(_ROS_DOMAINS))
    yield Rule(acts=ACTS, keys=(*domains, *(f"{each}/@adv/**" for each in domains), "@ros2_lv/**"))


def _robots_of(principal: Principal) -> tuple[str, ...]:
    """Whose keys a service may have, as chunks.

    A gateway's are exact names, never a wildcard less some: what forbids one name does not hold for a
    wildcard that means that name too.
    """
    if principal.role is Role.PLAYER:
        return (*_REPLAYS, keys.WHOLE_SITE)
    if principal.role is Role.GATEWAY and principal.robots is not None:
        return (*sorted(principal.robots), NOBODYS_ROBOT, keys.WHOLE_SITE)
    return ("*",)


def _published_as(row: Topic, role: Role) -> str:
    """A topic's name as a role may publish it: what is a key for each service has the service's name."""
    if role is Role.PLAYER and row.name.startswith("events/"):
        return row.name  # it plays what all of them said
    return row.name.replace("events/*", f"events/{role.value}").replace("health/*", f"health/{role.value}.$*")


def _names_of(principal: Principal, site: str) -> str:
    """In whose names somebody may ask, as a chunk: a console answers for those who signed in."""
    return f"$*.{site}" if principal.role is Role.CONSOLE else principal.name


def _heard(role: Role) -> tuple[str, ...]:
    """Row by row: who might listen to `robomesh/**` could make everybody send everything."""
    return tuple(f"{keys.ROOT}/*/*/{row.name}" for row in TOPICS.values() if role in row.subscribers)


def _asked(role: Role, names: str) -> Iterator[str]:
    """What a role may get or ask, everywhere."""
    yield f"{keys.ROOT}/-/-/-"
    for row in TOPICS.values():
        if role in row.subscribers:
            yield f"{keys.ROOT}/*/*/{row.name}"
    for request in REQUESTS.values():
        if role in request.askers:
            # Never `**`: it would hold whatever somebody calls an operator.
            yield f"{keys.ROOT}/*/*/{_asked_as(request, names)}"


def _asked_as(row: Request, names: str) -> str:
    return f"{row.name.rpartition('/')[0]}/{names}" if row.in_name else row.name


def _held(role: Role, names: str) -> Iterator[str]:
    """Tokens of sessions: an operator's at the robot, for its lease; anybody's at a site, for a replay.

    Args:
        names: In whose names, as a chunk: a token's id is <name>.<id>, and its owner alone may declare it.
            Held up by another, a lease would outlive its holder's session.
    """
    owned = names if names == "*" else f"{names}.$*"
    yield f"{keys.ROOT}/*/{keys.WHOLE_SITE}/alive/operator/{owned}"
    yield f"{keys.ROOT}/*/*/alive/monitor/*"
    if role in REQUESTS["lease/request/*"].askers:
        yield f"{keys.ROOT}/*/*/alive/operator/{owned}"


def _everything(*, outwards: bool) -> Rule:
    return Rule(acts=ACTS, keys=("**", "**/@adv/**", "@ros2_lv/**"), outwards=outwards)


# --------------------------------------------------------------- other sites


def _guest(principal: Principal, site: str, border: Border) -> Iterator[Rule]:
    """What another site's router may bring in, and what is let out to it."""
    hub = "*" in principal.sites
    theirs = tuple(f"{keys.ROOT}/{each}" for each in (("*",) if hub else principal.sites))
    brought = tuple(f"{each}/*/**{more}" for each in theirs for more in ("", "/@adv/**"))
    yield Rule(acts=(*_PUBLISH, "liveliness_token"), keys=brought)
    # Its people may ask and command here, in their own names, as our own roles may.
    names = ("*",) if hub else tuple(f"$*.{each}" for each in principal.sites)
    asked = dict.fromkeys(key for name in names for key in _asked(Role.CONSOLE, name))
    yield Rule(acts=("query",), keys=tuple(asked))
    yield Rule(acts=_LOOK, keys=(f"{keys.ROOT}/**/@adv/**",))
    yield Rule(acts=_PRESENT, keys=(f"{keys.ROOT}/*/*/alive/*/*",))
    held = dict.fromkeys(key for name in names for key in _held(Role.CONSOLE, name))
    yield Rule(acts=("liveliness_token",), keys=tuple(held))
    yield Rule(acts=_LISTEN, keys=(f"{keys.ROOT}/**",) if border == "open" else tuple(_let_out(site)))
    ours = f"{keys.ROOT}/{site}"
    if hub:
        # It speaks for everybody else, never for us; and what is asked of us is not asked of it.
        yield Rule(acts=_PUBLISH, keys=(f"{ours}/**", f"{ours}/**/@adv/**"), allow=False)
        present = tuple(f"{ours}/*/alive/{role.value}/*" for role in Role if role in SERVICES)
        own_people = f"{keys.ROOT}/*/*/alive/operator/$*.{site}.$*"
        yield Rule(acts=("liveliness_token",), keys=(*present, own_people), allow=False)
        named = tuple(f"{ours}/*/{_asked_as(row, '*')}" for row in REQUESTS.values())
        yield Rule(acts=("query",), keys=named, allow=False, outwards=True)
        own_names = tuple(f"{keys.ROOT}/*/*/{_asked_as(row, f'$*.{site}')}" for row in _in_names())
        yield Rule(acts=("query",), keys=own_names, allow=False)
    if border == "open":
        yield _everything(outwards=True)
        return
    yield Rule(
        acts=tuple(act for act in ACTS if act not in _PUBLISH),
        keys=_everything(outwards=True).keys,
        outwards=True,
    )
    yield Rule(acts=_PUBLISH, keys=tuple(_let_out(site)), outwards=True)


def _in_names() -> tuple[Request, ...]:
    return tuple(row for row in REQUESTS.values() if row.in_name)


def _let_out(site: str) -> Iterator[str]:
    """What a slow border lets through: what has no rate of its own, thinned joints, the far view."""
    for row in TOPICS.values():
        if row.rate_hz is None or row.name == "joints/slow":
            yield f"{keys.ROOT}/*/*/{row.name}"
            if row.recovered:
                yield f"{keys.ROOT}/*/*/{row.name}/@adv/**"
    yield f"{keys.ROOT}/*/*/video/far"
    for request in REQUESTS.values():
        yield f"{keys.ROOT}/*/*/{request.name}"


# --------------------------------------------------------------------- words


def refusal(principal: Principal, act: Act, key: str) -> str:
    """Why somebody may not do something on a key of the table, for people."""
    who = f"{principal.name} is {_a(principal.role)}"
    try:
        site, robot, name = keys.parse_expression(key)
    except KeyNameError:
        return f"{who}: it may not use {key}"
    row = _row(name)
    if row is None:
        return f"{who}: it may not use {key}"
    verb, roles = _verb(row, act)
    if principal.role not in roles:
        return f"{who}: it may not {verb} {name}; {_listed(roles)} may"
    if isinstance(row, Request) and row.in_name and act == "query":
        own = _asked_as(row, _names_of(principal, principal.site).replace("$*", "NAME"))
        return f"{who}: it may not {verb} {name}, which is another's name; {own} would be its own"
    if site != principal.site:
        return f"{who}: it may not {verb} {name} at site {site}, which is another site"
    own = ", ".join(sorted(principal.robots or ()))
    return f"{who}: it may not {verb} {name} of {robot}; its robots are {own}"


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


def _a(role: Role) -> str:
    return f"{'an' if role.value[0] in 'aeiou' else 'a'} {role.value}"


def _listed(roles: frozenset[Role]) -> str:
    names = sorted(_a(role) for role in roles)
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
