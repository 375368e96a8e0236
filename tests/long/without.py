"""The tests of the core without each kind of controllers in turn: `python -m tests.long.without`.

In a copy, because it deletes folders: a kind's, and that of its tests. Tests elsewhere that import
the kind are left out, and counted.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KINDS = ("fanuc", "opcua", "universal_robots", "yaskawa")
TESTS = ("protocol_gateway", "robomesh", "services", "test_kinds.py")


def importing(kind: str) -> list[Path]:
    """Return the test files that import a kind, directly or by one of these files."""
    files = {each: each.read_text("utf-8") for each in (ROOT / "tests").rglob("*.py")}
    words = {f"controllers.{kind}"}
    found: set[Path] = set()
    while more := {
        each
        for each, text in files.items()
        if each not in found and any(re.search(rf"\b{re.escape(word)}\b", text) for word in words)
    }:
        found |= more
        words = {".".join(each.relative_to(ROOT).with_suffix("").parts) for each in found}
    return sorted(found)


def main() -> None:
    """Run the tests without each kind; exit with status 1 if any failed."""
    failed = []
    for kind in KINDS:
        left_out = importing(kind)
        for folder in (ROOT / "controllers" / kind, ROOT / "tests" / "controllers" / kind):
            shutil.rmtree(folder)
        ignored = [f"--ignore={each}" for each in left_out]
        there = [f"tests/{each}" for each in TESTS]
        print(f"without {kind}, and without {len(left_out)} test files that import it", flush=True)
        pytest = [sys.executable, "-m", "pytest", "-q", "-n", "4", "-m", "not (browser or processes)"]
        done = subprocess.run([*pytest, *ignored, *there], cwd=ROOT, check=False)
        subprocess.run(["git", "checkout", "--quiet", "."], cwd=ROOT, check=True)
        if done.returncode:
            failed.append(kind)
    sys.exit(f"failed without {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    main()
