"""What a session has sent, received and answered since it was opened, by row of the topic table.

Nobody counts for it: it adds up the numbers that publishers, subscriptions and answerers have anyway,
when somebody asks.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from robomesh.latencies import Latencies
from robomesh.publisher import Publisher
from robomesh.server import Answerer
from robomesh.subscription import Subscription


@dataclass(frozen=True, slots=True)
class Measure:
    """A number of a service's own.

    Attributes:
        name: As Prometheus has it, without `robomesh_`: "browsers"; one that only grows ends in "_total".
        text: What it is, for people.
        read: Its value now, or one for each robot; called on any thread.
    """

    name: str
    text: str
    read: Callable[[], float | Mapping[str, float]]


@dataclass
class Tally:
    """Numbers by topic or request."""

    published: Counter[str] = field(default_factory=Counter)
    received: Counter[str] = field(default_factory=Counter)
    lost: Counter[str] = field(default_factory=Counter)
    skipped: Counter[str] = field(default_factory=Counter)
    malformed: Counter[str] = field(default_factory=Counter)
    turned_away: Counter[str] = field(default_factory=Counter)
    over_quota: Counter[str] = field(default_factory=Counter)
    latencies: defaultdict[str, Latencies] = field(default_factory=lambda: defaultdict(Latencies))

    def add(self, declared: object) -> None:
        """What one publisher, subscription or answerer has done."""
        match declared:
            case Publisher():
                self.published[declared.topic.name] += declared.published
            case Subscription():
                name = declared.topic.name
                self.received[name] += declared.received
                self.lost[name] += declared.lost_in_all
                self.skipped[name] += declared.skipped
                self.malformed[name] += declared.malformed
            case Answerer():
                self.turned_away[declared.name] += declared.turned_away
                self.over_quota[declared.name] += declared.over_quota
                self.latencies[declared.name].add_all(declared.latencies)

    def copy(self) -> "Tally":
        """One of its own."""
        tally = Tally()
        for name in ("published", "received", "lost", "skipped", "malformed", "turned_away", "over_quota"):
            getattr(tally, name).update(getattr(self, name))
        for request, latencies in self.latencies.items():
            tally.latencies[request].add_all(latencies)
        return tally
