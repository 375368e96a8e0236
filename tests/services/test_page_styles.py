"""A style sheet that is loaded with one page does not change another page."""

import re
from collections.abc import Iterator
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "web" / "src"
FIRST_PAGE = (SOURCE / "app" / "styles.ts").read_text(encoding="utf-8")
# Features with components in the frame of every page.
LOADED_FIRST = ("account", "fleet")


def classes_of_page() -> dict[Path, set[str]]:
    """Return the classes in the markup of each component."""
    return {path: set(_classes(path.read_text(encoding="utf-8"))) for path in SOURCE.rglob("*.tsx")}


def _classes(markup: str) -> Iterator[str]:
    for plain, expression in re.findall(r"\bclass=(?:\"([^\"]*)\"|\{((?:[^{}]|\{[^{}]*\})*)\})", markup):
        # In an expression a class is a part of a template, or a string.
        outside = re.sub(r"\$\{[^{}]*\}", " ", expression) if "`" in expression else ""
        strings = re.findall(r'"([^"]*)"', expression)
        yield from re.findall(r"[a-z][\w-]*", " ".join((plain, outside, *strings)))


def selectors(sheet: Path) -> Iterator[str]:
    """Yield each selector of a style sheet."""
    text = re.sub(r"/\*.*?\*/", "", sheet.read_text(encoding="utf-8"), flags=re.DOTALL)
    for rule in re.findall(r"([^{}]+)\{", text):
        if not rule.strip().startswith("@"):
            yield from (one.strip() for one in re.split(r",(?![^()]*\))", rule))


def test_sheets_that_are_loaded_on_demand_style_only_their_own_page():
    """Check pages after navigation: a sheet stays loaded when the operator opens another page."""
    pages: dict[str, set[str]] = {}
    shared: set[str] = set()
    for path, names in classes_of_page().items():
        folder, name, *_ = path.relative_to(SOURCE).parts
        (pages.setdefault(name, set()) if folder == "features" else shared).update(names)
    found = []
    for sheet in (SOURCE / "features").rglob("*.css"):
        own = sheet.relative_to(SOURCE).parts[1]
        if sheet.relative_to(SOURCE).as_posix() in FIRST_PAGE or own in LOADED_FIRST:
            continue
        others = [names | shared for name, names in pages.items() if name != own]
        for selector in selectors(sheet):
            if "[data-" in selector:  # a state that only this page's elements have
                continue
            wanted = set(re.findall(r"\.([a-z][\w-]*)", selector))
            if wanted and any(wanted <= names for names in others):
                found.append(f"{sheet.relative_to(SOURCE)}: {selector}")
    assert found == []
