"""The page's Chinese words for alarms keep up with the watch's table."""

import re
from pathlib import Path

from services.watch.rules import RULES

WORDS = Path(__file__).resolve().parents[2] / "services/console/page/src/events/alarm-words.ts"


def test_every_alarm_that_the_watch_can_raise_has_chinese_words_on_the_page():
    known = set(re.findall(r'^  "([a-z_.]+)": \[', WORDS.read_text(encoding="utf-8"), re.MULTILINE))
    assert {code for code, rule in RULES.items() if rule.priority is not None} - known == set()
