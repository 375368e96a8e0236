"""TOML from untrusted sources: text that would need gigabytes to parse is refused before parsing."""

import resource
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.descriptions.description import from_values, load, parse
from robots.schema.bounded_toml import MOST_CHARACTERS, MOST_DEPTH, parse_toml, read_toml
from robots.schema.errors import DescriptionError
from services.errors import SiteFileError
from services.site_file.site import load as load_site

DEEP = {
    "a dotted key": ".".join(["a"] * 20_000) + " = 1\n",
    "a dotted key with blanks": " . ".join(["a"] * 20_000) + " = 1\n",
    "a dotted key of quoted parts": ".".join(['"a b"', "'c.d'"] * 10_000) + " = 1\n",
    "a dotted key in a table": "x = {" + ".".join(["a"] * 20_000) + " = 1}\n",
    "a dotted key behind a text that ends with a quote": 'x = {t = """a"""", '
    + ".".join(["a"] * 20_000)
    + ' = 1, u = ""}\n',
    "a table's name": "[" + ".".join(["a"] * 20_000) + "]\nb = 1\n",
    "lists": "a = " + "[" * 20_000 + "]" * 20_000 + "\n",
    "tables": "a = " + "{b = " * 20_000 + "1" + "}" * 20_000 + "\n",
}


@contextmanager
def little_memory() -> Iterator[None]:
    """Limit this process to 300 MB more memory than it uses."""
    before = resource.getrlimit(resource.RLIMIT_DATA)
    status = Path("/proc/self/status").read_text()
    taken = int(status.split("VmData:")[1].split()[0]) * 1024
    resource.setrlimit(resource.RLIMIT_DATA, (taken + 300_000_000, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)


@pytest.mark.parametrize("text", DEEP.values(), ids=DEEP)
def test_deep_toml_is_refused_in_one_line_before_parsing(text: str, tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(text)
    with little_memory():
        with pytest.raises(DescriptionError, match=r"is not TOML: .*(parts|deeper)") as refused:
            load(file)
        with pytest.raises(SiteFileError, match=r"not TOML: .*(parts|deeper)"):
            load_site(file)
    assert len(str(refused.value).splitlines()) == 1


def test_too_long_toml_is_refused_without_parsing(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    with file.open("wb") as sparse:
        sparse.truncate(2_000_000_000)
    with little_memory():
        with pytest.raises(DescriptionError, match="longer than 4,000,000 characters"):
            load(file)
        with pytest.raises(tomllib.TOMLDecodeError, match="longer"):
            read_toml(file)


def test_dots_and_brackets_in_texts_and_comments_do_not_count_as_depth() -> None:
    dots, brackets = ".".join(["a"] * 99), "[{" * 99
    text = (
        f'a = "{dots} {brackets} \\" {dots}" # {dots} {brackets} "\n'
        f"b = '{dots} {brackets}'\nc = '''\n{dots} ' {brackets}'''\n"
        f'd = """{dots} "" {brackets} \\""" {dots}"""""\n'
    )
    assert parse_toml(text) == tomllib.loads(text)


def test_toml_of_the_greatest_depth_is_read() -> None:
    key = ".".join(["a"] * MOST_DEPTH) + " = 1"
    lists = "b = " + "[" * MOST_DEPTH + "]" * MOST_DEPTH
    for text in (key, lists):
        assert parse_toml(text) == tomllib.loads(text)


@given(st.text(alphabet="ab.\"'\\\n#[]{}= ,", max_size=60))
def test_any_text_is_parsed_like_tomllib_or_refused(text: str) -> None:
    try:
        expected = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        with pytest.raises(tomllib.TOMLDecodeError):
            parse_toml(text)
    else:
        assert parse_toml(text) == expected


def test_number_with_too_many_digits_is_a_toml_error() -> None:
    with pytest.raises(tomllib.TOMLDecodeError, match="digits"):
        parse_toml("a = " + "9" * 5000)


@pytest.mark.slow
def test_thousands_of_wrong_values_are_one_problem(tmp_path: Path) -> None:
    text = 'name = "x"\n' + "[[joint]]\na = 1\n" * 30_000
    assert len(text) < MOST_CHARACTERS
    with pytest.raises(DescriptionError) as refused:
        parse(text, tmp_path / "robot.toml")
    assert refused.value.problems == ("has more than 20000 values",)
    _, problems = from_values({"name": "x", "joint": [{}] * 30_000}, folder=tmp_path)
    assert len(problems) == 1


def test_site_file_with_thousands_of_problems_names_the_first_hundred(tmp_path: Path) -> None:
    file = tmp_path / "site.toml"
    file.write_text("".join(f"k{number} = 1\n" for number in range(5000)))
    with pytest.raises(SiteFileError) as refused:
        load_site(file)
    lines = str(refused.value).splitlines()
    assert len(lines) == 101
    assert lines[-1].endswith("and 4901 more problems")
