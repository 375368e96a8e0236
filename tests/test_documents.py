"""Documents that agree with the code."""

import inspect
import re
from pathlib import Path

import pytest

import robomesh
from tests import make_python_reference, make_site_file, make_topics
from tests.long import documented_commands

ROOT = Path(__file__).resolve().parents[1]


def test_the_reference_of_topics_is_the_topic_table():
    assert make_topics.FILE.read_text(encoding="utf-8") == make_topics.document()


def test_the_reference_of_the_site_file_is_its_models():
    assert make_site_file.FILE.read_text(encoding="utf-8") == make_site_file.document()


def test_the_reference_of_the_python_package_is_the_package():
    written = make_python_reference.FILE.read_text(encoding="utf-8")
    assert written == make_python_reference.document(), (
        "the public part of `import robomesh` changed: if programs still run, write the reference anew"
    )
    assert make_python_reference.missing() == set()


@pytest.mark.parametrize("name", ["Arm", "Mesh", "Recording", "Robot"])
def test_the_synchronous_and_asynchronous_forms_have_the_same_calls(name):
    forms = getattr(robomesh, name), getattr(robomesh, f"Async{name}")
    calls = [
        {
            call: [(each.name, each.default) for each in inspect.signature(function).parameters.values()]
            for call, function in inspect.getmembers(form, inspect.isfunction)
            if not call.startswith("_") and call not in make_python_reference.INTERNAL | {"open"}
        }
        for form in forms
    ]
    assert calls[0] == calls[1]


def test_architecture_is_short_and_names_folders_and_files_that_exist():
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 150
    assert named_paths("ARCHITECTURE.md", text) == []


def test_decisions_are_listed_and_name_files_that_exist():
    folder = ROOT / "docs" / "adr"
    index = (folder / "README.md").read_text(encoding="utf-8")
    records = sorted(folder.glob("[0-9]*.md"))
    assert len(records) >= 20
    for number, record in enumerate(records, 1):
        text = record.read_text(encoding="utf-8")
        assert text.startswith(f"# {number:04d}: ")
        assert [line for line in text.splitlines() if line.startswith("## ")] == [
            "## Context",
            "## Decision",
            "## Consequences",
        ]
        assert f"({record.name})" in index
        assert named_paths(record.name, text) == []


def named_paths(where: str, text: str) -> list[str]:
    """Return the paths of this repository that a document names and that do not exist."""
    named = re.findall(r"`((?:[a-z0-9_]+/)+(?:[A-Za-z0-9_.-]+\.(?:py|ts|tsx|proto|toml|md))?)`", text)
    linked = re.findall(r"\]\((docs/[^)#]+)\)", text)
    # A site that ran here has left folders, too: `recordings` is also the name of a package.
    ours = (ROOT / ".gitignore").read_text(encoding="utf-8").split()
    known = {path.name for path in ROOT.iterdir()} - {line.strip("/") for line in ours}
    return [
        f"{where}: {name}"
        for name in named + linked
        if name.split("/")[0] in known and not (ROOT / name).exists()
    ]


def test_every_example_stands_in_the_readme():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for example in (ROOT / "examples").glob("*.py"):
        assert example.name in readme
    # `tests/robomesh/test_client.py` runs it.
    first = (ROOT / "docs" / "python.md").read_text(encoding="utf-8").partition("```\n")[0]
    assert first.partition("```python\n")[2] in readme


def test_the_chinese_readme_has_the_content_of_the_english_one():
    english, chinese = ((ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "README.zh.md"))
    assert len(english.splitlines()) <= 150
    assert len(english.splitlines()) == len(chinese.splitlines())
    for pattern in (
        r"^#+ ",
        r"^\| ",
        r"\]\(([^)]+)\)",
        r"^robomesh (?!puts|works|has)([a-z]+)",
        r"\d+(?:[.,]\d+)*",
    ):
        of_each = [re.findall(pattern, text, re.MULTILINE) for text in (english, chinese)]
        if pattern.startswith(r"\]"):
            of_each = [sorted(set(found) - {"README.md", "README.zh.md"}) for found in of_each]
        elif pattern.startswith(r"\d"):
            of_each = [sorted(set(found)) for found in of_each]
        assert of_each[0] == of_each[1], pattern


def test_every_command_of_the_documents_is_tried_by_the_long_tests():
    found = {
        command
        for name in documented_commands.DOCUMENTS
        for command in documented_commands.documented((ROOT / name).read_text(encoding="utf-8"))
    }
    assert found == documented_commands.COMMANDS.keys()
