"""Conditions of the mesh: duplicate names, differing clocks and versions, missing services and sites.

Each text names both sides. Pure.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

from robomesh import reason_codes as codes
from robomesh.contract.keys import WHOLE_SITE, PresenceKey, is_replay
from robomesh.contract.messages import received_reason
from robomesh.wire.session import CERTIFICATE
from services.watch.conditions import Condition, condition_of
from services.watch.observed_mesh import ObservedMesh, Process
from services.watch.settings import SETTLED_S

# One per robot or per site.
_UNIQUE = ("gateway", "kinematics", "watch", "store")
# Services that must run on every site. Others are optional; a missing simulated controller shows as a link
# that is down.
_REQUIRED = frozenset({*_UNIQUE, "router", "recorder", "player", "renderer", "console"})
_CLOCK_S, _CLOCK_OVER_S = 0.5, 0.4
_LOSS, _LOSS_OVER, _LOSS_LEAST = 5e-3, 1e-3, 20
_SILENT_S = 10.0
_UNLINKED_AFTER_S = 20.0
# On a busy machine a site takes this long to start.
_STARTED_S = 60.0
_DAY_S = 86_400.0
_EXPIRES_S = 10 * _DAY_S


@dataclass
class Expected:
    """Services and sites that were present once, and are expected to be present.

    Attributes:
        services: Names of the own site's processes, by service and robot (`-`: the whole site); empty: never
            seen.
        sites: Other sites.
        without_gateway: Robots without a gateway, by the id of its alarm.
    """

    services: dict[tuple[str, str], str] = field(default_factory=dict)
    sites: set[str] = field(default_factory=set)
    without_gateway: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def remember(self, conditions: Iterable[Condition]) -> None:
        """Restore what was missing before the watch restarted."""
        for condition in conditions:
            values = dict(condition.values)
            match condition.code:
                case "service.gone":
                    for robot in values.get("robots", "").split():
                        service = values.get("service", "")
                        # An alarm saved by an earlier version does not have the process's name.
                        self.expect(service, robot, values.get("name") or service)
                case "site.gone":
                    self.sites.add(values.get("site", ""))

    def expect(self, service: str, robot: str, name: str) -> None:
        """Expect a service from now on; a replay is excluded, because it ends by design."""
        if service in _REQUIRED and not is_replay(robot):
            self.services[service, robot] = name


def mesh_conditions(
    mesh: ObservedMesh,
    site: str,
    *,
    here: str,
    expected: Expected,
    begun: frozenset[str],
    now: float,
    now_s: float,
    settled_s: float = SETTLED_S,
) -> Iterator[Condition]:
    """Yield every fault between the mesh's processes.

    Args:
        here: This watch's own identity.
        begun: Ids of active conditions; they end only below a lower threshold.
        now: Time since the Unix epoch [s]; `now_s`: monotonic time, as in `Process.at_s`.
        settled_s: Minimum time for which a service must be present or missing.
    """
    tokens = mesh.services()
    for condition in (
        *_duplicates(mesh, [who for who in tokens if who.site == site]),
        *_missing(mesh, tokens, site, expected),
        *_versions(mesh),
    ):
        yield replace(condition, after_s=max(settled_s, condition.after_s))
    yield from _clocks(mesh, here, begun)
    for process in mesh.processes.values():
        if process.site == site:
            yield from _of_process(process, begun, now, now_s)


def _duplicates(mesh: ObservedMesh, tokens: list[PresenceKey]) -> Iterator[Condition]:
    owners: dict[tuple[str, str], list[PresenceKey]] = defaultdict(list)
    for who in tokens:
        if who.service in _UNIQUE:
            owners[who.service, who.robot].append(who)
    for (service, robot), twins in owners.items():
        if len(twins) < 2:
            continue
        names = "; ".join(_label(mesh, each) for each in twins)
        if robot == WHOLE_SITE:
            reason = codes.SITE_TWICE(site=twins[0].site, names=names)
        else:
            reason = codes.SERVICE_TWICE(robot=robot, count=len(twins), service=service, names=names)
        yield condition_of(
            reason,
            robot=robot,
            code="mesh.twice",
            over=f"only one {service} answers to {twins[0].site}/{robot} again",
            each=service,
            values=tuple((f"id_{number}", each.id) for number, each in enumerate(twins, 1)),
        )


def _missing(
    mesh: ObservedMesh, tokens: list[PresenceKey], site: str, expected: Expected
) -> Iterator[Condition]:
    here = {(who.service, who.robot) for who in tokens if who.site == site}
    for who in tokens:
        if who.site == site:
            expected.expect(who.service, who.robot, _label(mesh, who))
        else:
            expected.sites.add(who.site)
    # A gateway of a hundred robots gives one condition.
    gone: dict[tuple[str, str], list[str]] = defaultdict(list)
    for (service, robot), name in expected.services.items():
        if (service, robot) not in here:
            gone[service, name].append(robot)
    expected.without_gateway.clear()
    for (service, name), robots in gone.items():
        first = sorted(robots)[0]
        condition = condition_of(
            codes.SERVICE_GONE(name=name) if name else codes.SERVICE_MISSING(name=service),
            code="service.gone",
            after_s=0.0 if name else _STARTED_S,
            over=f"{service} is there again",
            each=service if first == WHOLE_SITE else f"{service}.{first}",
            values=(
                ("service", service),
                ("name", name or service),
                ("robots", " ".join(sorted(robots)[:20])),
            ),
            latching=True,
        )
        if service == "gateway":
            expected.without_gateway[condition.id] = tuple(robots)
        yield condition
    for other in sorted(expected.sites - {who.site for who in tokens}):
        yield condition_of(
            codes.SITE_GONE(other=other, site=site),
            code="site.gone",
            over=f"site {other} is there again",
            each=other,
            values=(("site", other),),
            latching=True,
        )


def _clocks(mesh: ObservedMesh, here: str, begun: frozenset[str]) -> Iterator[Condition]:
    own = mesh.processes.get(here)
    if own is None:
        return  # the text must name both clocks
    for host, (round_trip_s, offset_s) in _clock_readings(mesh, here).items():
        limit = _CLOCK_OVER_S if f"{WHOLE_SITE}:clock.off:{host}" in begun else _CLOCK_S
        if abs(offset_s) - round_trip_s / 2 > limit:
            code = codes.CLOCK_AHEAD if offset_s > 0 else codes.CLOCK_BEHIND
            mine = own.health.host
            yield condition_of(
                code(host=host, seconds=abs(offset_s), watch=mine),
                code="clock.off",
                over=f"the clocks of {host} and {mine} agree again",
                each=host,
                values=(("offset_s", f"{offset_s:.3f}"), ("uncertainty_s", f"{round_trip_s / 2:.3f}")),
                gist=code.name,
            )


def largest_clock_offset_s(mesh: ObservedMesh, here: str) -> float:
    """Return by how much at least the farthest host's clock differs from this watch's; on any thread."""
    readings = _clock_readings(mesh, here).values()
    return max((0.0, *(abs(offset_s) - round_trip_s / 2 for round_trip_s, offset_s in readings)))


def _clock_readings(mesh: ObservedMesh, here: str) -> dict[str, tuple[float, float]]:
    """Return the best reading, round trip and offset, of each host's clock."""
    hosts: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for process in tuple(mesh.processes.values()):
        best = process.clock.best
        if best is not None and process.health.id != here:
            hosts[process.health.host].append((best.round_trip_s, best.offset_s))
    return {host: min(readings) for host, readings in hosts.items()}


def _versions(mesh: ObservedMesh) -> Iterator[Condition]:
    versions: dict[str, list[str]] = defaultdict(list)
    for process in mesh.processes.values():
        versions[process.health.version].append(process.name)
    if len(versions) > 1:
        sides = "; ".join(
            f"{version}: {', '.join(sorted(names)[:3])}{', ...' if len(names) > 3 else ''}"
            for version, names in sorted(versions.items())
        )
        yield condition_of(
            codes.VERSIONS_DIFFER(versions=sides),
            code="mesh.versions",
            over="all have one version again",
        )


def _of_process(process: Process, begun: frozenset[str], now: float, now_s: float) -> Iterator[Condition]:
    health = process.health
    if now_s - process.at_s > _SILENT_S:
        yield condition_of(
            codes.SERVICE_SILENT(name=process.name, seconds=_SILENT_S),
            code="service.silent",
            over=f"{process.name} reports again",
            each=f"{health.service}.{health.id}",
        )
    received, lost = process.lost_lately
    each = f"{health.service}.{health.id}"
    for problem in health.problems:
        address = problem.values.get("address", problem.code)
        yield condition_of(
            codes.SERVICE_PROBLEM(received_reason(problem), name=process.name),
            code="service.problem",
            over=f"{process.name} listens on {address}",
            each=f"{each}.{address}",
        )
    share = lost / max(received + lost, 1)
    standing = f"{WHOLE_SITE}:mesh.loss:{each}" in begun
    if (lost >= _LOSS_LEAST and share > _LOSS) or (standing and share > _LOSS_OVER):
        yield condition_of(
            codes.MESSAGES_LOST(name=process.name, percent=100 * share),
            code="mesh.loss",
            over=f"{process.name} no longer loses messages at a notable rate",
            each=each,
            values=(("lost", str(lost)), ("received", str(received))),
            gist="loss",
        )
    links, wanted = (health.values.get(name, 0.0) for name in ("links", "links_wanted"))
    if links < wanted:
        yield condition_of(
            codes.ROUTER_UNLINKED(name=process.name, count=links, wanted=wanted),
            code="router.unlinked",
            over=f"{process.name} reaches every router that it should link to",
            each=health.id,
            after_s=_UNLINKED_AFTER_S,
        )
    if CERTIFICATE in health.values and health.values[CERTIFICATE] < _EXPIRES_S:
        left_s = health.values[CERTIFICATE] - (now_s - process.at_s)
        ends = datetime.fromtimestamp(max(now + left_s, 0.0), UTC)
        code = codes.CERTIFICATE_EXPIRES if left_s > 0 else codes.CERTIFICATE_EXPIRED
        yield condition_of(
            code(name=process.name, date=f"{ends:%Y-%m-%d %H:%M}"),
            code="certificate.expires",
            over=f"the certificate of {process.name} is renewed",
            each=each,
            gist=code.name,
        )


def _label(mesh: ObservedMesh, who: PresenceKey) -> str:
    process = mesh.processes.get(who.id)
    return process.name if process is not None else f"{who.service} ({who.site}, {who.id})"
