"""Counters of a session by row of the topic table: sent, received and answered since it was opened.

They cost nothing until they are read: reading adds up the numbers that publishers, subscriptions and
servers of requests keep anyway.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from robomesh.publications.publisher import Publisher
from robomesh.publications.subscription import Subscription
from robomesh.requests.latencies import Latencies
from robomesh.requests.server import RequestServer


@dataclass(frozen=True, slots=True)
class Measure:
    """A metric that a service defines.

    Attributes:
        name: Prometheus name without `robomesh_`: "browsers"; a counter's name ends in "_total".
        text: Help text for people.
        read: Returns the current value, or one for each value of the labels; called on any thread.
        labels: Names of the labels of several values.
    """

    name: str
    text: str
    read: Callable[[], float | Mapping[str, float] | Mapping[tuple[str, ...], float]]
    labels: tuple[str, ...] = ("robot",)


@dataclass
class Counters:
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
        """Add the numbers of one publisher, subscription or server of requests."""
        match declared:
            case Publisher():
                self.published[declared.topic.name] += declared.published
            case Subscription():
                name = declared.topic.name
                self.received[name] += declared.received
                self.lost[name] += declared.total_lost
                self.skipped[name] += declared.skipped
                self.malformed[name] += declared.malformed
            case RequestServer():
                self.turned_away[declared.name] += declared.turned_away
                self.over_quota[declared.name] += declared.over_quota
                self.latencies[declared.name].add_all(declared.latencies)

    def copy(self) -> "Counters":
        """Return an independent copy."""
        counters = Counters()
        for name in ("published", "received", "lost", "skipped", "malformed", "turned_away", "over_quota"):
            getattr(counters, name).update(getattr(self, name))
        for request, latencies in self.latencies.items():
            counters.latencies[request].add_all(latencies)
        return counters
