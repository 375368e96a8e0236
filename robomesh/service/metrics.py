"""Prometheus metrics of one process, collected only when Prometheus reads them.

List of metrics: docs/monitoring.md.
"""

import asyncio
import time
from collections.abc import Callable, Iterator, Mapping

from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    InfoMetricFamily,
    Metric,
)
from prometheus_client.process_collector import ProcessCollector
from prometheus_client.registry import Collector

from robomesh.requests.latencies import STEPS_S, Latencies
from robomesh.wire.counters import Measure
from robomesh.wire.session import Session

_COUNTS = {
    "published": "Messages published",
    "received": "Messages received",
    "lost": "Messages that never arrived: gaps in their publisher's numbers",
    "skipped": "Messages that arrived and that the service was too slow to take",
    "malformed": "Messages without a right attachment, left out",
}
# An age above this is not reported: the publisher, for example an ended replay, has gone.
_LONGEST_AGE_S = 3600.0
_HEARTBEAT_S = 1.0


class SessionMetrics(Collector):
    """The counters of a session and the measures of its service.

    Args:
        about: Labels that identify the process.
        heartbeat_s: Returns the monotonic time at which its event loop last ran. Another thread answers
            Prometheus, so an answer alone does not prove that the service works.
    """

    def __init__(
        self, session: Session, about: Mapping[str, str], heartbeat_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._session, self._about, self._heartbeat_s = session, dict(about), heartbeat_s

    def collect(self) -> Iterator[Metric]:
        """Yield all metrics with their current values."""
        info = InfoMetricFamily("robomesh_process", "Which process this is")
        info.add_metric([], self._about)
        yield info
        yield GaugeMetricFamily(
            "robomesh_connected", "Whether a router is there", value=float(self._session.connected)
        )
        yield GaugeMetricFamily(
            "robomesh_heartbeat_age_seconds",
            "Since the event loop last ran",
            value=max(time.monotonic() - self._heartbeat_s(), 0.0),
        )
        counters = self._session.counters()
        for name, text in _COUNTS.items():
            counter = CounterMetricFamily(f"robomesh_{name}", f"{text}, by topic", labels=["topic"])
            for topic, count in sorted(getattr(counters, name).items()):
                counter.add_metric([topic], count)
            yield counter
        yield CounterMetricFamily(
            "robomesh_ignored",
            "Tokens, publications, replies and requests on keys that fit no key of the contract",
            value=self._session.ignored.count,
        )
        yield self._ages()
        away = CounterMetricFamily(
            "robomesh_turned_away", "Requests that found no place, by request", labels=["request"]
        )
        over = CounterMetricFamily(
            "robomesh_over_quota", "Requests of who has had its quota, by request", labels=["request"]
        )
        took = HistogramMetricFamily(
            "robomesh_request_seconds", "From a request's coming to its answer", labels=["request"]
        )
        for request, count in sorted(counters.turned_away.items()):
            away.add_metric([request], count)
            over.add_metric([request], counters.over_quota[request])
            latencies = counters.latencies[request]
            took.add_metric([request], _buckets(latencies), latencies.sum_s)
        yield away
        yield over
        yield took
        for measure in tuple(self._session.measures):
            yield _own(measure)

    def _ages(self) -> Metric:
        ages = GaugeMetricFamily(
            "robomesh_age_seconds",
            "Since something new came, of topics that can be stale; of several in one row the newest",
            labels=["site", "robot", "topic"],
        )
        newest: dict[tuple[str, str, str], float] = {}
        for subscription in self._session.subscriptions:
            if subscription.topic.stale_after_s is None:
                continue
            for key, age_s in subscription.ages_s().items():
                # The row's name, because a full name would leave a series for each former process.
                labels = key.site, key.robot, subscription.topic.name
                if age_s < min(newest.get(labels, _LONGEST_AGE_S), _LONGEST_AGE_S):
                    newest[labels] = age_s
        for labels, age_s in sorted(newest.items()):
            ages.add_metric(labels, age_s)
        return ages


def serve_metrics(session: Session, host: str, port: int, about: Mapping[str, str]) -> str:
    """Serve the metrics until the process ends; return the address with the actual port.

    Call it in the event loop whose heartbeat the metrics report.

    Raises:
        OSError: If it cannot listen at that address.
    """
    registry = CollectorRegistry()
    registry.register(SessionMetrics(session, about, _heartbeat(asyncio.get_running_loop())))
    ProcessCollector(registry=registry)
    server, _ = start_http_server(port, addr=host, registry=registry)
    shown = f"[{host}]" if ":" in host else host
    return f"http://{shown}:{server.server_port}/metrics"


def _heartbeat(loop: asyncio.AbstractEventLoop) -> Callable[[], float]:
    """Return a function that returns the monotonic time at which the event loop last ran."""
    last_s = time.monotonic()

    def beat() -> None:
        nonlocal last_s
        last_s = time.monotonic()
        loop.call_later(_HEARTBEAT_S, beat)

    beat()
    return lambda: last_s


def _own(measure: Measure) -> Metric:
    value = measure.read()
    family = CounterMetricFamily if measure.name.endswith("_total") else GaugeMetricFamily
    if not isinstance(value, Mapping):
        return family(f"robomesh_{measure.name}", measure.text, value=value)
    metric = family(f"robomesh_{measure.name}", measure.text, labels=measure.labels)
    for labels, number in sorted(value.items()):
        metric.add_metric([labels] if isinstance(labels, str) else labels, number)
    return metric


def _buckets(latencies: Latencies) -> list[tuple[str, float]]:
    """Return Prometheus's cumulative buckets."""
    steps = [*map(str, STEPS_S), "+Inf"]
    return [(step, float(sum(latencies.counts[: number + 1]))) for number, step in enumerate(steps)]
