"""The mesh as a site's watch observes it: processes, their clocks, hop times and message loss."""

from collections import defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from statistics import quantiles

from robomesh.contract.keys import WHOLE_SITE, PresenceKey
from robomesh.schemas.robomesh_pb2 import MeshState, ServiceHealth
from robomesh.service.clock import Clock, Reading
from robomesh.wire.presence import SILENT

_LOSS_OVER = 30  # health messages: a minute
_HOPS_KEPT = 200
_MOST_HOPS = 500
# A process whose health arrives without its presence token within this time has gone.
_TOKEN_WITHIN_S = 5.0


@dataclass
class Process:
    """A process of the mesh that has reported its health.

    Attributes:
        at_s: Monotonic time of its last report.
        counts: Messages received and lost at each report, newest last.
    """

    site: str
    health: ServiceHealth
    at_s: float
    clock: Clock = field(default_factory=Clock)
    counts: deque[tuple[int, int]] = field(default_factory=lambda: deque(maxlen=_LOSS_OVER))

    @property
    def name(self) -> str:
        """Return a label for people: service, site, robots and host."""
        robots = ", ".join(self.health.robots[:3]) + (", ..." if len(self.health.robots) > 3 else "")
        whose = f"{self.site}/{robots}" if robots else self.site
        return f"{self.health.service} ({whose}, {self.health.host}, {self.health.id})"

    @property
    def lost_lately(self) -> tuple[int, int]:
        """Return the messages received and lost in the last minute."""
        if not self.counts:
            return 0, 0
        (received, lost), (received_now, lost_now) = self.counts[0], self.counts[-1]
        return received_now - received, lost_now - lost


@dataclass
class ObservedMesh:
    """Present processes and their reports, by identity; a process has a new identity at each start."""

    present: dict[str, set[PresenceKey]] = field(default_factory=dict)
    processes: dict[str, Process] = field(default_factory=dict)
    # By the Zenoh id of the session that answered, the process's identity.
    _identities: dict[str, str] = field(default_factory=dict)
    _hops: dict[tuple[str, str], deque[float]] = field(default_factory=dict)

    def record_health(self, site: str, health: ServiceHealth, now_s: float) -> None:
        """Record a process's health."""
        process = self.processes.get(health.id)
        if process is None:
            process = self.processes[health.id] = Process(site, health, now_s)
        process.health, process.at_s = health, now_s
        process.counts.append((health.received, health.lost))

    def add_presence(self, who: PresenceKey) -> None:
        """Add a presence token."""
        self.present.setdefault(who.id, set()).add(who)

    def remove_presence(self, who: PresenceKey) -> None:
        """Remove a presence token; a process without any has gone."""
        tokens = self.present.get(who.id, set())
        tokens.discard(who)
        if not tokens:
            self.present.pop(who.id, None)
            self.processes.pop(who.id, None)

    def record_clock(self, identity: str, reading: Reading) -> None:
        """Record a clock reading and its hops."""
        if (process := self.processes.get(identity)) is None:
            return
        process.clock.readings.append(reading)
        if reading.hops:
            self._identities[reading.hops[-1][1]] = identity
        for near, far, seconds in reading.hops:
            if len(self._hops) < _MOST_HOPS or (near, far) in self._hops:
                self._hops.setdefault((near, far), deque(maxlen=_HOPS_KEPT)).append(seconds)

    def services(self) -> list[PresenceKey]:
        """Return the tokens of services, without those of people."""
        return sorted(who for tokens in self.present.values() for who in tokens if who.service not in SILENT)

    def serving(self, site: str, service: str, robot: str) -> set[str]:
        """Return the processes of a service that serve a robot, or the whole of its site."""
        return {
            who.id
            for tokens in self.present.values()
            for who in tokens
            if (who.site, who.service) == (site, service) and who.robot in (robot, WHOLE_SITE)
        }

    def forget_gone(self, now_s: float) -> None:
        """Remove processes whose last report arrived after their token had gone."""
        for name in [name for name in self.processes if name not in self.present]:
            if now_s - self.processes[name].at_s > _TOKEN_WITHIN_S:
                del self.processes[name]

    def forget_losses(self) -> None:
        """Restart the loss counters."""
        for process in self.processes.values():
            process.counts.clear()

    def forget_hops(self) -> None:
        """Remove hop times between processes that have gone."""
        self._identities = {node: each for node, each in self._identities.items() if each in self.processes}
        known = {*self._identities, *(process.health.zenoh_id for process in self.processes.values())}
        for pair in [pair for pair in self._hops if not known & {*pair}]:
            del self._hops[pair]

    def state(self, site: str, here: str, now_s: float) -> MeshState:
        """Return the state to publish.

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
        """Return hop times by the labels of both ends; a router's status session counts as the router."""
        names = {
            node: self.processes[each] for node, each in self._identities.items() if each in self.processes
        }
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
    """Return the median and the 99th percentile."""
    ordered = sorted(values)
    if len(ordered) == 1:
        return ordered[0], ordered[0]
    cuts = quantiles(ordered, n=100, method="inclusive")
    return cuts[49], cuts[98]
