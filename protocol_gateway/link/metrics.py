"""Metrics of a gateway's links, evaluated when they are requested."""

import time
from collections.abc import Callable, Mapping
from functools import partial

from protocol_gateway.link.link import ControllerLink, LinkState
from robomesh.wire.session import Session


def measure_links(session: Session, links: Mapping[str, ControllerLink]) -> None:
    """Register the metrics of each robot's link.

    Args:
        links: Links by robot name.
    """

    def by_robot(read: Callable[[ControllerLink], float]) -> Callable[[], dict[str, float]]:
        return lambda: {robot: float(read(link)) for robot, link in links.items()}

    def age_s(link: ControllerLink) -> float:
        last = link.last_received
        return float("nan") if last is None else time.monotonic() - last.monotonic_s

    def up(link: ControllerLink) -> bool:
        return link.status.state is LinkState.UP

    measure = session.measure
    measure("links_up", "Links to controllers that are up", lambda: sum(map(up, links.values())))
    measure("link_up", "Whether the link to the controller is up", by_robot(up))
    measure("unit_age_seconds", "Time since the last unit; NaN: none yet", by_robot(age_s))
    measure("units_per_second", "Units received in the last second", by_robot(lambda link: link.rate_hz))
    for name, text in (
        ("units_received", "Units received"),
        ("units_malformed", "Malformed units received"),
        ("units_lost", "Units lost: gaps in the controller's clock"),
        ("units_skipped", "Units of a flood, replaced by newer ones"),
        ("units_sent", "Units sent to the controller"),
    ):
        measure(f"{name}_total", text, by_robot(partial(_count, name)))


def _count(name: str, link: ControllerLink) -> float:
    return float(getattr(link.counters, name))
