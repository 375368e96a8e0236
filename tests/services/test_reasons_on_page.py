"""The page has a sentence in each language for every reason of the table."""

import re
import runpy
from ast import literal_eval
from pathlib import Path

import pytest

from robomesh import reason_codes
from robomesh.reasons import Code

SENTENCES = Path(__file__).resolve().parents[2] / "web/src/i18n/reasons.ts"
TEXT = r"""("(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*')"""
ROW = re.compile(rf"^  \[\s*{TEXT},\s*\[\s*{TEXT},\s*{TEXT},?\s*\],?\s*\],$", re.MULTILINE)
ROWS = {
    literal_eval(code): (literal_eval(english), literal_eval(chinese))
    for code, english, chinese in ROW.findall(SENTENCES.read_text("utf-8"))
}
TABLE = {each.name: each for each in vars(reason_codes).values() if isinstance(each, Code)}


KINDS = sorted((SENTENCES.parents[3] / "controllers").glob("*/codes.py"))


def parameters(sentence):
    return set(re.findall(r"\{(\w+)\}", sentence))


def test_the_page_has_the_codes_of_the_table():
    assert ROWS.keys() == TABLE.keys()


def test_its_english_is_the_table_s():
    wrong = {
        name: english
        for name, (english, _) in ROWS.items()
        if english != re.sub(r"\{(\w+):[^}]*\}", r"{\1}", TABLE[name].sentence)
    }
    assert wrong == {}


def test_its_chinese_has_the_same_parameters():
    for name, (english, chinese) in ROWS.items():
        assert parameters(chinese) == parameters(english), name
        assert re.search("[\u4e00-\u9fff]", chinese) or re.fullmatch(r"(\{\w+\}|[：，])+", chinese), name


@pytest.mark.parametrize("file", KINDS, ids=lambda file: file.parent.name)
def test_a_kind_s_own_reasons_have_chinese_with_the_same_parameters(file):
    codes = [each for each in runpy.run_path(str(file)).values() if isinstance(each, Code)]
    assert codes
    for each in codes:
        assert each.name not in TABLE, each.name
        assert parameters(each.chinese) == each.parameters, each.name
        assert re.search("[\u4e00-\u9fff]", each.chinese), each.name
