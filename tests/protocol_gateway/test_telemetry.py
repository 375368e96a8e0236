"""Publication of a controller's data, and events when the data stop."""

from types import SimpleNamespace

from protocol_gateway.link.link import EventTime
from protocol_gateway.seam import Activity, JointsReceived, Mode, StatusReceived
from protocol_gateway.telemetry.journal import Journal
from protocol_gateway.telemetry.signals import Signals
from protocol_gateway.telemetry.telemetry import Telemetry
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of


class Desk:
    """Publisher that keeps events and ignores everything else."""

    def __init__(self):
        self.now_s = 100.0
        self.codes = []
        self.own_stop = False
        publisher = SimpleNamespace(put=lambda message, **_: None)
        self.telemetry = Telemetry(
            joints_of(load("pt600")),
            fast=publisher,
            slow=publisher,
            raw=publisher,
            signals=Signals(publisher, Journal(self, "arm"), ["waist"]),
            journal=Journal(self, "arm", monotonic_s=lambda: self.now_s),
            stale_after_s=1.0,
            on_status=lambda: None,
            on_activity=lambda activity, dated_s: None,
            on_refused=lambda: None,
            stop_expected=lambda now_s: self.own_stop,
        )

    def put(self, event):
        self.codes.append(event.code)

    def goes_on(self, seconds, *, positions):
        for _ in range(round(seconds * 10)):
            self.now_s += 0.1
            if positions:
                self.telemetry.on_event(JointsReceived((0.0,) * 5), EventTime(self.now_s, 0))
            self.telemetry.check_timeouts(self.now_s)


def test_flapping_positions_are_one_event():
    desk = Desk()
    for _ in range(30):
        desk.goes_on(0.5, positions=True)
        desk.goes_on(1.5, positions=False)
    assert desk.codes == ["joints.gone"]
    desk.goes_on(10.0, positions=True)
    assert desk.codes == ["joints.gone", "joints.back"]
    desk.goes_on(10.0, positions=False)
    assert desk.codes[2:] == ["joints.gone"]


def test_the_last_event_of_flapping_data_is_never_suppressed():
    desk = Desk()
    for _ in range(30):
        desk.goes_on(6.2, positions=True)
        desk.goes_on(1.1, positions=False)
        assert desk.codes[-1] == "joints.gone"


def test_controller_that_stops_by_itself_is_an_event_and_its_end_another():
    desk = Desk()

    def does(activity, seconds=0.3):
        for _ in range(round(seconds * 10)):
            desk.now_s += 0.1
            desk.telemetry.on_event(StatusReceived(activity, Mode.REMOTE), EventTime(desk.now_s, 0))
            desk.telemetry.check_timeouts(desk.now_s)
        found, desk.codes = desk.codes, []
        return [code for code in found if code.startswith("controller.")]

    assert does(Activity.STOPPED) == []  # what was before is unknown
    assert does(Activity.IDLE, 10.0) == []
    assert does(Activity.STOPPED) == ["controller.stopped"]
    # A state that flaps is one event.
    for _ in range(20):
        assert does(None, 1.0) == []
        assert does(Activity.MOVING, 1.0) == []
        assert does(Activity.STOPPED, 1.0) == []
    assert does(Activity.MOVING, 10.0) == ["controller.stopped.over"]
    assert does(None) == []
    assert does(Activity.STOPPED) == []
    assert does(Activity.IDLE) == []
    desk.own_stop = True
    assert does(Activity.STOPPED) == []
    desk.own_stop = False
    assert does(Activity.STOPPED) == []
    assert does(Activity.IDLE, 10.0) == []
    assert does(Activity.STOPPED) == ["controller.stopped"]
    # Another controller may answer next.
    desk.telemetry.forget()
    assert does(Activity.IDLE, 10.0) == []
