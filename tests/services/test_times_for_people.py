"""Times for people have one form everywhere, with the zone of the machine that prints them."""

import time

import pytest

from renderer.pictures.robot_state import _time
from services.command_line.terminal.local_time import time_text
from services.command_line.watch.listing_text import since

AT_S = 1_795_912_378.083


@pytest.mark.parametrize(
    ("zone", "date", "clock", "offset"),
    [
        ("UTC", "2026-11-29", "00:32:58", "+00:00"),
        ("Asia/Shanghai", "2026-11-29", "08:32:58", "+08:00"),
        ("America/St_Johns", "2026-11-28", "21:02:58", "-03:30"),
    ],
)
def test_a_time_has_its_zone(zone, date, clock, offset, monkeypatch):
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    try:
        assert time_text(AT_S) == f"{date} {clock}{offset}"
        assert time_text(AT_S, "milliseconds") == f"{date} {clock}.083{offset}"
        assert _time(round(AT_S * 1e9), dated=True) == f"{date} {clock}.0{offset}"
        assert _time(round(AT_S * 1e9), dated=False) == f"{clock}.0{offset}"
        assert since(AT_S - 2e5).endswith(offset)
        assert since(time.time()).endswith(offset)
    finally:
        monkeypatch.undo()
        time.tzset()
