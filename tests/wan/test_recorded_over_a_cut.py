"""A line cut for seconds: data that recorders at its ends hold and miss, and data that is complete."""

import time
from pathlib import Path

import pytest

from robomesh.recordings.errors import RecordingError
from robomesh.recordings.files import describe_file
from robomesh.recordings.reading import RecordingFile
from robomesh.schemas.robomesh_pb2 import Recording
from tests.wan.network import Network, missing
from tests.wan.sites import ARM, PORT, Probe, Site, stop

pytestmark = [pytest.mark.long, pytest.mark.processes]

JOINTS = "robomesh/plant/arm/joints"
EVENTS = "robomesh/plant/arm/events"
STOP = "robomesh/plant/arm/stop"
RECORD = "robomesh/plant/arm/recorder/request"
AUDIT = "robomesh/plant/arm/audit/find"
CUT_S = 5.0


def recorded(site: Site) -> Path | None:
    """Return the file of a site's capture, if there is one."""
    for path in (site.folder / "recordings").rglob("*.mcap"):
        try:
            if describe_file(path).name == "cut":
                return path
        except RecordingError:  # just being made
            continue
    return None


def joints_of(path: Path) -> tuple[Recording.TopicCount, list[int]]:
    """Return a recording's summary of its joints, and the sequence numbers that it holds."""
    told = next(each for each in describe_file(path).topics if each.topic == JOINTS)
    with RecordingFile(path) as file:
        return told, [each.sequence for each in file.messages([JOINTS])]


def test_recorders_at_both_ends_tell_what_each_missed_and_events_and_audit_are_whole_again(tmp_path):
    if why := missing():
        pytest.skip(why)
    with Network() as network:
        plant = Site(network.host("plant"), "plant", tmp_path / "near", more=ARM)
        hub = Site(network.host("hub"), "hub", tmp_path / "hub")
        line = network.link(plant.host, hub.host)
        plant.links = (f"tcp/{line.far}:{PORT}",)
        hub.start("router")
        beside, away = plant.with_arm(), Probe(hub.host)
        # The plant's recorder as it would be if it stood at the hub.
        far = Site(hub.host, "plant", tmp_path / "far", more=ARM)
        recorders = [site.start("recorder") for site in (plant, far)]
        away.do("watch", JOINTS)
        away.until(JOINTS, stale=False, within_s=60.0)
        line.change(delay_ms=40.0)
        until = time.monotonic() + 60.0
        while not (recorded(plant) and recorded(far)):
            away.do("ask", RECORD, {"action": "TRACE_ON", "name": "cut"}, 2.0)
            assert time.monotonic() < until, plant.log("recorder") + far.log("recorder")
        away.do("ask", STOP, {"by": "zhao", "reason": "before the cut"}, 20.0)

        line.change(cut=True)
        went = time.monotonic()
        beside.do("ask", STOP, {"by": "li", "reason": "while the line was cut"}, 20.0)
        away.until(JOINTS, stale=True, within_s=20.0)
        time.sleep(max(went + CUT_S - time.monotonic(), 0.0))
        line.change(cut=False)
        away.until(JOINTS, stale=False, within_s=30.0)
        away.do("ask", STOP, {"by": "zhao", "reason": "after the cut"}, 20.0)

        audits = [probe.do("ask", AUDIT, {}, 20.0)["answer"]["entries"] for probe in (beside, away)]
        events = [probe.wait_for("last", EVENTS, 10.0)["events"] for probe in (beside, away)]
        for recorder in recorders:
            stop(recorder)
            assert recorder.poll() == 0

        assert audits[0] == audits[1]
        assert [int(each["number"]) for each in audits[1]] == list(range(1, len(audits[1]) + 1))
        assert [each.get("previous") for each in audits[1][1:]] == [each["hash"] for each in audits[1][:-1]]
        assert [each["operator"] for each in audits[1] if each["request"] == "STOP"] == ["zhao", "li", "zhao"]
        assert events[0] == events[1]
        path_near, path_far = recorded(plant), recorded(far)
        assert path_near is not None
        assert path_far is not None
        told, numbers = joints_of(path_near)
        assert (told.lost, len(numbers)) == (0, numbers[-1] - numbers[0] + 1)
        told, numbers = joints_of(path_far)
        assert told.lost == numbers[-1] - numbers[0] + 1 - len(numbers)
        assert told.lost > 100
