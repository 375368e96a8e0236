"""The page's build and its colours, without a browser."""

import re
import subprocess
import sys

import pytest

from web import build_page

PAIRS = [
    (text, ground)
    for text in ("text", "dim", "accent", "warning", "alarm", "mine", "simulated")
    for ground in ("ground", "surface")
] + [
    ("text", "raised"),
    ("dim", "raised"),
    ("accent", "raised"),
    ("accent-text", "accent-fill"),
    ("warning", "warning-fill"),
    ("alarm", "alarm-fill"),
    ("text", "alarm-fill"),
    ("dim", "scene"),
]


def themes():
    css = (build_page.PAGE / "src" / "ui" / "tokens.css").read_text()
    found = {}
    for name, start in (("dark", ":root {"), ("light", ':root[data-theme="light"] {')):
        block = css.split(start, 1)[1].split("}", 1)[0]
        found[name] = found.get("dark", {}) | dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", block))
    return found


def luminance(colour):
    linear = [
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
        for c in (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    ]
    return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


@pytest.mark.parametrize("theme", ["dark", "light"])
@pytest.mark.parametrize(("text", "ground"), PAIRS)
def test_every_text_can_be_read_on_its_ground(theme, text, ground):
    colours = themes()[theme]
    light, dark = sorted((luminance(colours[text]), luminance(colours[ground])), reverse=True)
    assert (light + 0.05) / (dark + 0.05) >= 4.5


def test_the_page_has_four_text_sizes():
    css = "".join(sheet.read_text() for sheet in (build_page.PAGE / "src").rglob("*.css"))
    assert set(re.findall(r"font-size: ([^;]+);", css)) <= {
        *(f"var(--{size})" for size in ("small", "body", "large", "huge")),
        "16px",  # fields on a phone: Safari zooms into smaller ones
    }


def test_the_lock_file_holds_no_address():
    assert "://" not in (build_page.PAGE / "package-lock.json").read_text()


@pytest.mark.slow
def test_a_current_page_is_not_built_again():
    build_page.build()
    done = subprocess.run([sys.executable, build_page.__file__], capture_output=True, text=True, check=True)
    assert done.stdout == ""


@pytest.mark.slow
def test_the_built_page_asks_nothing_of_anybody_else():
    build_page.build()
    for name in ("index.html", "view.html"):
        html = (build_page.DIST / name).read_text()
        assert "://" not in html
        assert "<style" not in html
        assert re.search(r"<script(?![^>]*src=)", html) is None
