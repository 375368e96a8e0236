"""A plant and a hub over a slow line that loses packets, breaks and recovers: the view of other sites."""

import threading
import time
from pathlib import Path

import pytest

from tests.site import wait_until
from tests.wan.network import Link, Network, missing
from tests.wan.sites import ARM, PORT, Probe, Site

pytestmark = [pytest.mark.long, pytest.mark.processes]

JOINTS = "robomesh/plant/arm/joints"
EVENTS = "robomesh/plant/arm/events"
STOP = "robomesh/plant/arm/stop"
GATEWAY = "plant/arm/gateway/"
HUB = "hub/-/router/"
DELAY_S = 0.04


@pytest.fixture(scope="module")
def network():
    if why := missing():
        pytest.skip(why)
    with Network() as made:
        yield made


class Plant:
    """Plant linked to a hub, a probe next to each router, and the stops that reached the controller."""

    def __init__(self, network: Network, folder: Path) -> None:
        self.site = Site(network.host("plant"), "plant", folder, more=ARM)
        self.hub = Site(network.host("hub"), "hub", folder)
        self.line: Link = network.link(self.site.host, self.hub.host)
        self.hub.start("router")
        self.site.links = (f"tcp/{self.line.far}:{PORT}",)
        self.near, self.far = self.site.with_arm(), Probe(self.hub.host)
        self.stops = 0
        threading.Thread(target=self._count_stops, daemon=True).start()
        for probe in (self.near, self.far):
            for topic in (JOINTS, EVENTS):
                probe.do("watch", topic)
            probe.until(JOINTS, stale=False, within_s=60.0)
        self.line.change(delay_ms=1e3 * DELAY_S)

    def cut(self) -> None:
        """Cut the line until both routers have closed the link: no buffered message is left."""
        wait_until(lambda: self._seen() == {GATEWAY, HUB})
        self.line.change(cut=True)
        self.far.until(JOINTS, stale=True, within_s=60.0)
        wait_until(lambda: not self._seen())

    def mend(self) -> None:
        """Restore the line until live joints arrive and, later, each router knows the other side."""
        self.line.change(cut=False)
        self.far.until(JOINTS, stale=False, within_s=60.0)
        wait_until(lambda: self._seen() == {GATEWAY, HUB})

    def _seen(self) -> set[str]:
        """Return the participants of the other side that each side sees."""
        sides = ((self.far, GATEWAY), (self.near, HUB))
        return {token for probe, token in sides if any(who.startswith(token) for who in probe.do("present"))}

    def _count_stops(self) -> None:
        for _ in self.site.processes["controller"].stdout or ():
            self.stops += 1


@pytest.fixture(scope="module")
def plant(network, tmp_path_factory):
    return Plant(network, tmp_path_factory.mktemp("wan"))


@pytest.fixture(autouse=True)
def well(plant):
    plant.line.change(loss=0.0, delay_ms=1e3 * DELAY_S)
    plant.mend()
    plant.far.do("samples", JOINTS)


def test_joints_are_as_late_as_the_line_and_no_earlier(plant):
    lags = []

    def came():
        lags.extend(lag for _, lag, live, *_ in plant.far.do("samples", JOINTS) if live)
        return len(lags) > 20

    # Those that were on their way when the line grew longer may still come.
    wait_until(lambda: any(lag >= DELAY_S for _, lag, live, *_ in plant.far.do("samples", JOINTS) if live))
    wait_until(came)
    assert min(lags) >= DELAY_S


def test_a_cut_line_is_seen_as_stale_and_silences_nobody_at_the_plant(plant):
    plant.cut()
    plant.near.do("samples", JOINTS)
    plant.near.wait_for("samples", JOINTS)

    def told(probe):
        return [(each["code"], each["text"]) for each in probe.wait_for("last", EVENTS, 10.0)["events"]]

    def stopped():  # of many stops one event each few seconds
        answer = plant.near.do("ask", STOP, {"by": "zhao", "reason": "while the line was cut"}, 20.0)
        assert answer["answer"]["sent"], answer
        return any("while the line was cut" in text for _, text in told(plant.near))

    wait_until(stopped)
    assert plant.far.do("state", JOINTS, JOINTS)["age_s"] > 1.0
    plant.mend()
    wait_until(lambda: told(plant.far) == told(plant.near))


def test_a_stop_over_a_line_that_loses_is_done_once(plant):
    plant.line.change(loss=0.02)
    before, numbers = plant.stops, set()
    for _ in range(8):
        answer = plant.far.do("ask", STOP, {"by": "zhao"}, 20.0)
        assert answer["answer"]["sent"], answer
        numbers.add(answer["answer"]["stop_id"])
        time.sleep(0.12)  # those closer than 0.1 s share a unit
    # One more from the arm's side, which arrives after all others.
    last = plant.near.do("ask", STOP, {"by": "li"}, 20.0)["answer"]["stop_id"]
    wait_until(lambda: plant.stops >= before + 9)
    assert plant.stops == before + 9
    # A repeat of the latched stop keeps its number.
    assert numbers == {str(int(last) - 1)}


def test_what_was_kept_back_comes_late_and_never_looks_live(plant):
    # By a line that gets longer and longer, and never silent: a cut may outlast the connection, and then
    # nothing of it is kept back.
    for tenths in range(1, 11):
        plant.line.change(direction="forth", delay_ms=100.0 * tenths)
        time.sleep(0.1)
    late = []

    def came():
        late.extend(
            (lag, age) for _, lag, live, _, age in plant.far.do("samples", JOINTS) if live and lag > 0.6
        )
        return late

    wait_until(came)
    # Each is as old as its own time says, but for what the quickest took.
    assert all(age > lag - 0.3 for lag, age in late), late


def test_losses_are_counted_over_a_cut(plant):
    def counted():
        """Return the counts after all traffic has arrived."""
        found = [plant.far.do("sequence", JOINTS, JOINTS)]

        def quiet():
            time.sleep(0.2)
            found.append(plant.far.do("sequence", JOINTS, JOINTS))
            return found[-1] == found[-2]

        wait_until(quiet)
        return found[-1]

    plant.cut()
    first = counted()
    plant.mend()
    plant.cut()
    last = counted()
    gone = {name: last[name] - first[name] for name in first}
    assert gone["number"] == gone["lost"] + gone["received"]
    assert gone["lost"] > 0
