"""The page has Chinese texts for all alarms and events."""

import re
from pathlib import Path

from services.watch.rules import RULES

HOUSE = Path(__file__).resolve().parents[2]
PAGE = HOUSE / "web/src"


def table(name: str) -> set[str]:
    """Return the keys of a table of texts."""
    return set(re.findall(r'^  "([a-z_.]+)":', (PAGE / name).read_text(encoding="utf-8"), re.MULTILINE))


def test_every_alarm_that_the_watch_can_raise_has_chinese_words_on_the_page():
    wanted = {code for code, rule in RULES.items() if rule.priority is not None}
    assert wanted - table("i18n/alarm-text.ts") == set()


def test_every_event_without_an_alarm_has_a_chinese_text():
    warnings = set()
    for folder in ("protocol_gateway", "renderer", "services"):
        for source in (HOUSE / folder).rglob("*.py"):
            # A severity and the code behind it, as in: say(_S.INFO, "joints.back", ...)
            text = source.read_text(encoding="utf-8")
            warnings |= set(re.findall(r'\bINFO\b[^"()]{0,40}"([a-z_]+\.[a-z_]+)"', text))
    assert len(warnings) > 15
    # The page has its own texts for stops, in both languages.
    known = table("i18n/event-text.ts") | table("i18n/alarm-text.ts") | {"stop.reset"}
    assert warnings - known == set()
