"""Reasons on the page: in English the mesh's own sentence, in Chinese the catalogue's."""

import pytest
from google.protobuf.json_format import MessageToDict

from robomesh import reason_codes as codes
from robomesh.contract.messages import reason_message
from robomesh.reasons import Reason
from tests import page_modules

pytestmark = pytest.mark.slow

SCRIPT = """
const shown = [];
for (const [language, reason, seconds] of asked) {
  await page.showFirstLanguage(language);
  const given = { values: {}, causes: [], text: "", ...reason };
  given.causes = given.causes.map((cause) => ({ values: {}, causes: [], text: "", ...cause }));
  shown.push(page.reasonText(seconds ? page.withValue(given, "seconds", seconds) : given));
}
answer(shown);
"""
LIMIT = codes.JOINT_LIMIT(name="elbow", value="-131.0°", limit="-120.0°")
HELD = codes.LEASE_HELD(holder="עלי")


@pytest.fixture(scope="module")
def module(tmp_path_factory):
    return page_modules.bundle(
        tmp_path_factory.mktemp("reasons"),
        reasons="i18n/reasons.ts",
        events="i18n/event-text.ts",
        state="mesh/state/robot-state.ts",
        texts="i18n/texts.ts",
    )


def shown(module, reason, *seconds):
    """Return a reason's sentence on the page, in English and Chinese."""
    row = MessageToDict(reason_message(reason))
    return page_modules.ask(module, SCRIPT, [[language, row, *seconds] for language in ("en", "zh")])


def test_numbers_have_the_page_s_minus_sign(module):
    english, chinese = shown(module, LIMIT)
    assert english == str(LIMIT).replace("-", "−")
    assert chinese == "关节 elbow 的 −131.0° 超出限位 −120.0°"


def test_a_hyphen_of_the_sentence_stays(module):
    reason = codes.NUMBER_TOO_LARGE(word="speed", name="x", given="-7", most=5)
    assert shown(module, reason)[0] == "'speed': x is −7; must be between -5 and 5"


def test_a_number_in_a_line_to_be_typed_stays_plain(module):
    for text in shown(module, codes.FLOOR_ADVICE(height_mm=-20, below_mm=-20)):
        assert "−20 mm" in text
        assert "floor = -20.0" in text


def test_a_name_from_right_to_left_is_isolated_also_in_a_cause(module):
    for text in shown(module, codes.PROGRAM_CONTROL_ENDED(HELD)):
        assert "\u2068עלי\u2069" in text
        assert "U+2068" not in text


def test_a_cause_is_in_the_page_s_language(module):
    assert shown(module, codes.PROGRAM_LINE(LIMIT, line=3))[1] == f"第 3 行：{shown(module, LIMIT)[1]}"


def test_a_controller_s_work_is_in_the_page_s_language(module):
    reason = codes.GATEWAY_OCCUPIED(work="the controller of pt600", seconds=0.2)
    assert shown(module, reason)[1].startswith("pt600 的控制器 ")


def test_an_unknown_code_shows_its_english(module):
    for code in ("future.code", "constructor"):
        assert shown(module, Reason(code, {}, (), "something new")) == ["something new"] * 2


def test_a_stop_without_a_reason_names_only_its_sender(module):
    assert shown(module, codes.PROGRAM_STOPPED(by="li", reason="console")) == ["stopped by li", "由 li 停止"]


def test_seconds_are_counted_down(module):
    assert shown(module, codes.ACCOUNT_WAIT(seconds=30), "29") == [
        "too many attempts: try again in 29 s",
        "尝试次数过多：请在 29 秒后重试",
    ]


def test_an_unnamed_sender_has_a_capital_letter_only_at_the_start_of_a_sentence(module):
    script = """
    const since = { seconds: 0n, nanos: 0 };
    const latched = { code: "stop.latched", severity: 0, values: { by: "", sent: "True" }, timestamp: since };
    answer([page.stopText({ stop: { by: "", sent: true, since }, activity: 0 }), page.eventText(latched)]);
    """
    state, event = page_modules.ask(module, script, None)
    assert " by an operator without a name" in state
    assert event.startswith("An operator without a name")
