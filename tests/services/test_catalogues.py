"""The page's catalogues: every message of a language, one a line, with the placeholders of its English."""

import json
import re
import runpy
from itertools import chain
from pathlib import Path

import pytest

from robomesh import reason_codes
from robomesh.reasons import Code
from services.watch.rules import RULES

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "web/src"
ENGLISH, *TRANSLATIONS = sorted((PAGE / "i18n").glob("*.json"), key=lambda file: (file.stem != "en", file))
KINDS = sorted((ROOT / "controllers").glob("*/codes.py"))


def reasons(names):
    return {f"reason.{each.name}": each for each in names.values() if isinstance(each, Code)}


REASONS = reasons(vars(reason_codes))
OF_KINDS = {file.parent.name: reasons(runpy.run_path(str(file))) for file in KINDS}
# What arrives in English from the mesh, and names whose English is the name itself.
ARRIVES = {"reason_value", "alarm", "advice", "event", "event_value"}
ARRIVES |= {"signal_value", "signal_word", "plot_part"}


def rows(file):
    return json.loads(file.read_text("utf-8"), object_pairs_hook=list)


def messages(file):
    return dict(rows(file))


def placeholders(sentence):
    return {*re.findall(r"\{(\w+)\}", sentence)}


def section(key):
    return key.partition(".")[0]


@pytest.fixture(params=TRANSLATIONS, ids=lambda file: file.stem)
def translations(request):
    return messages(request.param)


@pytest.mark.parametrize("file", [ENGLISH, *TRANSLATIONS], ids=lambda file: file.stem)
def test_a_catalogue_has_each_key_once_and_a_message_on_each_line(file):
    keys = [key for key, _ in rows(file)]
    assert sorted(set(keys)) == sorted(keys)
    assert len(file.read_text("utf-8").splitlines()) == len(keys) + 2


def test_every_text_has_a_translation(translations):
    assert messages(ENGLISH).keys() - translations.keys() == set()


def test_every_translation_has_a_text(translations):
    known = {*messages(ENGLISH), *REASONS, *chain(*OF_KINDS.values())}
    assert {key for key in translations.keys() - known if section(key) not in ARRIVES} == set()
    alarms = {key.partition(".")[2] for key in translations if section(key) in ("alarm", "advice")}
    assert alarms - RULES.keys() == set()


def test_every_reason_and_alarm_has_a_translation(translations):
    alarms = [code for code, rule in RULES.items() if rule.priority is not None]
    wanted = chain(REASONS, *((f"alarm.{code}", f"advice.{code}") for code in alarms))
    assert set(wanted) - translations.keys() == set()


def test_translations_have_the_placeholders_of_their_english(translations):
    wanted = {key: placeholders(text) for key, text in messages(ENGLISH).items()}
    wanted |= {key: each.parameters for key, each in REASONS.items()}
    found = {key: placeholders(text) for key, text in translations.items()}
    assert {key: found[key] for key in found.keys() & wanted.keys() if found[key] != wanted[key]} == {}


def test_every_chinese_message_is_chinese():
    """Texts without words, such as `{cause}`, are the same in both languages."""
    english = messages(ENGLISH)
    words = re.compile(r"[A-Za-z]{3,} [a-z]{3,}")
    wrong = {
        key: text
        for key, text in messages(PAGE / "i18n/zh.json").items()
        if not re.search("[\u4e00-\u9fff]", text)
        and (
            words.search(re.sub(r"\{\w+\}", "", english[key]))
            if key in english
            else not re.fullmatch(r"(\{\w+\}|[：，%])+", text)
        )
    }
    assert wrong == {}


def test_every_text_is_used():
    """A text's name is in the page's source, or begins like a name that the page composes."""
    source = "\n".join(path.read_text("utf-8") for path in PAGE.rglob("*.ts*") if "gen" not in path.parts)
    composed = tuple(re.findall(r"`([a-z]\w*[_.])\$\{", source))
    ends = tuple(re.findall(r"\$\{\w+\}(_[a-z]+)`", source))
    words = {*re.findall(r"\w+", source)}
    unused = {
        key
        for key in messages(ENGLISH)
        if not (name := key.rpartition(".")[2]).startswith(composed)
        and not key.startswith(composed)
        and not name.endswith(ends)
        and name not in words
    }
    assert unused == set()


@pytest.mark.parametrize("kind", OF_KINDS)
def test_a_kind_s_own_reasons_have_chinese_with_the_same_parameters(kind):
    assert OF_KINDS[kind]
    assert OF_KINDS[kind].keys() & REASONS.keys() == set()
    for each in OF_KINDS[kind].values():
        assert placeholders(each.chinese) == each.parameters, each.name
        assert re.search("[\u4e00-\u9fff]", each.chinese), each.name
