"""The page has Chinese texts for all events without an alarm; test_catalogues.py has alarms."""

import json
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_every_event_without_an_alarm_has_a_chinese_text():
    codes = set()
    for folder in ("protocol_gateway", "renderer", "services"):
        for source in (ROOT / folder).rglob("*.py"):
            # A severity and the code behind it, as in: say(_S.INFO, "joints.back", ...)
            text = source.read_text(encoding="utf-8")
            codes |= set(re.findall(r'\bINFO\b[^"()]{0,40}"([a-z_]+\.[a-z_]+)"', text))
    assert len(codes) > 15
    chinese = json.loads((ROOT / "web/src/i18n/zh.json").read_text(encoding="utf-8"))
    # The page has its own texts for stops, in both languages.
    known = {code for code in codes if f"event.{code}" in chinese or f"alarm.{code}" in chinese}
    assert codes - known - {"stop.reset"} == set()
