"""The mesh as one site's watch sees it: who is there, how far away, what clocks say, what goes lost."""

from collections import defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from statistics import quantiles

from robomesh.clock import Clock, Reading
from robomesh.keys import WHOLE_SITE, PresenceKey
from robomesh.presence import SILENT
from robomesh.schemas.robomesh_pb2 import MeshState, ServiceHealth

_LOSS_OVER = 30  # health messages: a minute
_HOPS_KEPT = 200
_MOST_HOPS = 500
# Who is heard, and is not present so long after, is not about to come.
_COMES_WITHIN_S = 5.0


@dataclass
class Process:
    """A process of the mesh that told its health.

    Attributes:
        at_s: When it did so last, on the watch's own clock that never goes back.
        counts: What it received and lost until then, the newest last.
    """

    site: str
    health: ServiceHealth
    at_s: float
    clock: Clock = field(default_factory=Clock)
    counts: deque[tuple[int, int]] = field(default_factory=lambda: deque(maxlen=_LOSS_OVER))

    @property
    def name(self) -> str:
        """For people: which, whose, and where."""
        robots = ", ".join(self.health.robots[:3]) + (", ..." if len(self.health.robots) > 3 else "")
        whose = f"{self.site}/{robots}" if robots else self.site
        return f"{self.health.service} of {whose} at {self.health.host} ({self.health.id})"

    @property
    def lost_lately(self) -> tuple[int, int]:
        """Messages that it received, and that it lost, in the last minute."""
        if not self.counts:
            return 0, 0
        (received, lost), (received_now, lost_now) = self.counts[0], self.counts[-1]
        return received_now - received, lost_now - lost


@dataclass
class Mesh:
    """Who is present, and what they told; by identity, which is new at each start of a process."""

    present: dict[str, set[PresenceKey]] = field(default_factory=dict)
    processes: dict[str, Process] = field(default_factory=dict)
    # Zenoh ids of the sessions that answered.
    _nodes: dict[str, str] = field(default_factory=dict)
    _hops: dict[tuple[str, str], deque[float]] = field(default_factory=dict)

    def see(self, site: str, health: ServiceHealth, now_s: float) -> None:
        """A process told its health."""
        process = self.processes.get(health.id)
        if process is None:
            process = self.processes[health.id] = Process(site, health, now_s)
        process.health, process.at_s = health, now_s
        process.counts.append((health.received, health.lost))

    def come(self, who: PresenceKey) -> None:
        """Somebody is there."""
        self.present.setdefault(who.id, set()).add(who)

    def go(self, who: PresenceKey) -> None:
        """Somebody is there no more, for one robot or at all."""
        tokens = self.present.get(who.id, set())
        tokens.discard(who)
        if not tokens:
            self.present.pop(who.id, None)
            self.processes.pop(who.id, None)

    def read(self, identity: str, reading: Reading) -> None:
        """A process answered for its clock."""
        if (process := self.processes.get(identity)) is None:
            return
        process.clock.readings.append(reading)
        if reading.hops:
            self._nodes[reading.hops[-1][1]] = identity
        for near, far, seconds in reading.hops:
            if len(self._hops) < _MOST_HOPS or (near, far) in self._hops:
                self._hops.setdefault((near, far), deque(maxlen=_HOPS_KEPT)).append(seconds)

    def services(self) -> list[PresenceKey]:
        """Tokens of all that are no people."""
        return sorted(who for tokens in self.present.values() for who in tokens if who.service not in SILENT)

    def serving(self, site: str, service: str, robot: str) -> set[str]:
        """The processes that are a service for a robot of a site, or for all of that."""
        return {
            who.id
            for tokens in self.present.values()
            for who in tokens
            if (who.site, who.service) == (site, service) and who.robot in (robot, WHOLE_SITE)
        }

    def forget_gone(self, now_s: float) -> None:
        """Whose last words came after it had gone."""
        for name in [name for name in self.processes if name not in self.present]:
            if now_s - self.processes[name].at_s > _COMES_WITHIN_S:
                del self.processes[name]

    def forget_losses(self) -> None:
        """Count anew what processes receive and lose."""
        for process in self.processes.values():
            process.counts.clear()

    def forget_hops(self) -> None:
        """Of ways that nobody takes any more."""
        self._nodes = {node: each for node, each in self._nodes.items() if each in self.processes}
        known = {*self._nodes, *(process.health.zenoh_id for process in self.processes.values())}
        for pair in [pair for pair in self._hops if not known & {*pair}]:
            del self._hops[pair]

    def state(self, site: str, here: str, now_s: float) -> MeshState:
        """What is told to everybody.

        Args:
            here: The watch's own Zenoh id.
        """
        state = MeshState(site=site)
        state.timestamp.GetCurrentTime()
        for process in self._in_order():
            health, best = process.health, process.clock.best
            seen = state.services.add(
                site=process.site,
                service=health.service,
                id=health.id,
                host=health.host,
                version=health.version,
                age_s=now_s - process.at_s,
                lost=process.health.lost,
                received=process.health.received,
                robots=health.robots,
                cpu=health.cpu,
                memory_bytes=health.memory_bytes,
                started=health.started,
                values=health.values,
            )
            if best is not None:
                seen.round_trip_s, seen.clock_offset_s = best.round_trip_s, best.offset_s
        for (sender, receiver), taken in self._named_hops(here, f"watch {site}").items():
            p50, p99 = _quantiles(taken)
            state.hops.add(
                key=f"robomesh/{site}/-/clock/*", sender=sender, receiver=receiver, p50_s=p50, p99_s=p99
            )
        return state

    def _named_hops(self, here: str, own: str) -> dict[tuple[str, str], list[float]]:
        """By who is at both ends, for people; a router's own session is the router."""
        names = {node: self.processes[each] for node, each in self._nodes.items() if each in self.processes}
        names |= {process.health.zenoh_id: process for process in self.processes.values()}
        named: dict[tuple[str, str], list[float]] = defaultdict(list)
        for pair, taken in self._hops.items():
            ends = [
                own
                if node == here
                else f"{names[node].health.service} {names[node].site}"
                if node in names
                else f"node {node[:6]}"
                for node in pair
            ]
            if ends[0] != ends[1]:
                named[ends[0], ends[1]] += taken
        return named

    def _in_order(self) -> list[Process]:
        return sorted(
            self.processes.values(), key=lambda each: (each.site, each.health.service, each.health.id)
        )


def _quantiles(values: Iterable[float]) -> tuple[float, float]:
    """The median and the 99th percentile."""
    ordered = sorted(values)
    if len(ordered) == 1:
        return ordered[0], ordered[0]
    cuts = quantiles(ordered, n=100, method="inclusive")
    return cuts[49], cuts[98]
