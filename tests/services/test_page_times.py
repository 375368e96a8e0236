"""Times on the page: one form, with the zone of the browser's machine."""

import pytest

from tests import page_modules

pytestmark = pytest.mark.slow

SUMMER, WINTER = 1_785_340_931_000, 1_795_932_131_000
SCRIPT = "answer(asked.map(([name, ...given]) => page[name](...given)));"


@pytest.fixture(scope="module")
def module(tmp_path_factory):
    return page_modules.bundle(tmp_path_factory.mktemp("times"), format="i18n/format.ts")


@pytest.mark.parametrize(
    ("zone", "summer", "winter"),
    [
        ("Asia/Shanghai", "2026-07-30 00:02:11+08:00", "2026-11-29 14:02:11+08:00"),
        ("America/St_Johns", "2026-07-29 13:32:11-02:30", "2026-11-29 02:32:11-03:30"),
        ("UTC", "2026-07-29 16:02:11+00:00", "2026-11-29 06:02:11+00:00"),
    ],
)
def test_time_has_its_date_and_the_zone_of_that_date(module, zone, summer, winter):
    asked = [
        ["timeText", SUMMER],
        ["timeText", WINTER],
        ["whenText", SUMMER, SUMMER],
        ["whenText", SUMMER, WINTER],
    ]
    assert page_modules.ask(module, SCRIPT, asked, TZ=zone) == [summer, winter, summer[11:], summer]


def test_unknown_time_is_a_dash(module):
    asked = [["timeText", 0], ["timeText", 1e300], ["whenText", 0]]
    assert page_modules.ask(module, SCRIPT, asked, TZ="UTC") == ["–"] * 3


def test_what_was_seen_has_milliseconds(module):
    asked = [["timeText", WINTER + 7, True]]
    assert page_modules.ask(module, SCRIPT, asked, TZ="Asia/Shanghai") == ["2026-11-29 14:02:11.007+08:00"]
