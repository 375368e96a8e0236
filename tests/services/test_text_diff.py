"""Unified diffs, compared with GNU diff and applied with patch."""

import random
import shutil
import subprocess
import time

import pytest

from services.command_line.program.text_diff import unified_diff

WORDS = ("home", "wait 1", "move_joints a", "move_line b", "end", "repeat 2", "")


def random_text(rng, lines):
    return "\n".join(lines) + ("\n" if lines and rng.random() < 0.7 else "")


def random_pair(rng):
    """Return a text, and a text with some of its lines inserted, deleted and replaced."""
    old = [
        rng.choice(WORDS) + rng.choice(("", str(rng.randrange(50)))) for _ in range(rng.choice((0, 1, 9, 90)))
    ]
    new = list(old)
    for _ in range(rng.randrange(12)):
        at = rng.randrange(len(new) + 1)
        new[at : at + rng.randrange(2)] = [rng.choice(WORDS)] * rng.randrange(3)
    return random_text(rng, old), random_text(rng, new)


def changed_lines(diff):
    return sum(line[:1] in ("+", "-") for line in diff.splitlines()[2:])


@pytest.mark.slow
@pytest.mark.skipif(not (shutil.which("diff") and shutil.which("patch")), reason="no diff and patch here")
def test_a_diff_is_as_short_as_gnu_diff_s_and_patch_makes_the_new_text(tmp_path):
    rng = random.Random(17)
    old_file, new_file, made = (tmp_path / name for name in ("old", "new", "made"))
    for _ in range(60):
        old, new = random_pair(rng)
        old_file.write_text(old)
        new_file.write_text(new)
        diff = unified_diff(old, new, "old", "new")
        gnu = subprocess.run(["diff", "-u", "--minimal", old_file, new_file], capture_output=True, text=True)
        assert changed_lines(diff) == changed_lines(gnu.stdout)
        assert bool(diff) == (old != new)
        if diff:
            subprocess.run(["patch", "-s", "-o", made, old_file], input=diff, text=True, check=True)
            assert made.read_text() == new


@pytest.mark.parametrize(
    ("old", "new", "diff"),
    [
        ("", "a\n", "@@ -0,0 +1 @@\n+a\n"),
        ("a\n", "", "@@ -1 +0,0 @@\n-a\n"),
        ("a", "a\n", "@@ -1 +1 @@\n-a\n\\ No newline at end of file\n+a\n"),
        (
            "".join(f"{n}\n" for n in range(20)),
            "".join(f"{n}\n" for n in range(20) if n not in (1, 18)),
            "@@ -1,5 +1,4 @@\n 0\n-1\n 2\n 3\n 4\n@@ -16,5 +15,4 @@\n 15\n 16\n 17\n-18\n 19\n",
        ),
    ],
)
def test_hunks_are_written_as_posix_says(old, new, diff):
    assert unified_diff(old, new, "a", "b") == f"--- a\n+++ b\n{diff}"


def test_texts_without_a_common_line_do_not_take_long():
    begin_s = time.process_time()
    old, new = ("\n".join(map(str, range(first, first + 9000))) for first in (0, 10_000))
    assert changed_lines(unified_diff(old, new, "a", "b")) >= 18_000
    assert time.process_time() - begin_s < 30.0
