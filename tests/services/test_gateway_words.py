"""The page's Chinese words for what a gateway says of a request keep up with the gateway's own."""

import ast
import json
import re
from pathlib import Path

import pytest

HOUSE = Path(__file__).resolve().parents[2]
WORDS = HOUSE / "services/console/page/src/gateway-words.ts"
ROW = re.compile(r'^  \[("(?:[^"\\]|\\.)*"), ("(?:[^"\\]|\\.)*")\],$', re.MULTILINE)
ROWS = [
    (json.loads(english), json.loads(chinese)) for english, chinese in ROW.findall(WORDS.read_text("utf-8"))
]
# What stands before a sentence: "Not sent: ".
BEFORE = [english for english, _ in ROWS if english.endswith(": ")]
ENGLISH = [english for english, _ in ROWS if english not in BEFORE]
# In a gateway's sentence, whatever is filled in.
ANY = "x"
TELL = HOUSE / "protocol_gateway"
REFUSE = ["authority/rules.py", "authority/admission.py", "authority/obstacles.py"] + [
    f"control/{name}.py" for name in ("control", "leases")
]


def texts(node):
    """The texts that an expression may be, with ANY in the places of values."""
    match node:
        case ast.Constant(value=str(text)):
            return [text]
        case ast.JoinedStr(values=parts):
            return ["".join(str(each.value) if isinstance(each, ast.Constant) else ANY for each in parts)]
        case ast.IfExp(body=one, orelse=other):
            return texts(one) + texts(other)
    return []


def refusals(path):
    """What a module refuses with, and why it ends a lease."""
    found = []
    for node in ast.walk(ast.parse((TELL / path).read_text("utf-8"))):
        match node:
            case ast.Call(func=ast.Name(id="Answer"), args=[ast.Constant(value=False), text, *_]):
                found += texts(text)
            case ast.Call(func=ast.Name(id="_refused" | "end_lease"), args=[_, text]):
                found += texts(text)
            case ast.Call(func=ast.Name(id="RefusedError"), args=[text]):
                found += texts(text)
            case ast.Return(value=ast.Tuple(elts=[ast.Attribute(value=ast.Name(id="Why")), text])):
                found += texts(text)
            case ast.FunctionDef(name="_stopped" | "why_not_holder", body=body):
                for each in ast.walk(ast.Module(body=body, type_ignores=[])):
                    if isinstance(each, ast.Return) and each.value is not None:
                        found += texts(each.value)
    # A reason may stand behind it, or nothing.
    return [
        text.removesuffix(f"back{ANY}") + "back" if text.endswith(f"back{ANY}") else text
        for text in found
        if text
    ]


def pattern(english):
    parts = re.split(r"\{(\w+)\}", english)
    return re.compile("".join(f"(?P<{p}>.+?)" if i % 2 else re.escape(p) for i, p in enumerate(parts)))


PATTERNS = [pattern(english) for english in ENGLISH]


def is_known(text):
    """Whether the page has words for a text; as it looks for them."""
    if text == ANY:
        return True
    parts = text.split("; ")
    if len(parts) > 1 and all(map(is_known, parts)):
        return True
    for each in PATTERNS:
        found = each.fullmatch(text)
        if found and is_known(found.groupdict().get("text", ANY)):
            return True
    rest = next((text.removeprefix(each) for each in BEFORE if text.startswith(each)), text).removesuffix(".")
    return rest != text and is_known(rest)


@pytest.mark.parametrize("path", REFUSE)
def test_every_refusal_of_a_gateways_has_chinese_words_on_the_page(path):
    told = refusals(path)
    assert told
    assert [text for text in told if not is_known(text)] == []


def test_every_sentence_that_the_page_knows_is_one_that_a_gateway_says():
    sources = [*TELL.rglob("*.py"), *(HOUSE / "bus").glob("*.py"), *(HOUSE / "robots").rglob("*.py")]
    said = "\n".join(
        text
        for source in sources
        for node in ast.walk(ast.parse(source.read_text("utf-8")))
        for text in texts(node)
    )
    longest = {max(re.split(r"\{\w+\}", english), key=len) for english in ENGLISH}
    assert len(longest) > 50
    assert {part for part in longest if part.strip(" ():.") not in said} == set()


def test_chinese_fills_in_what_the_english_sentence_holds():
    for english, chinese in ROWS:
        values = [set(re.findall(r"\{(\w+)\}", text)) for text in (english, chinese)]
        assert values[0] == values[1], english
        assert re.search("[\u4e00-\u9fff]", chinese), english
