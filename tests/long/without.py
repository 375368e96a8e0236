"""The tests of the core without a kind of controllers: `python -m tests.long.without fanuc`.

In a copy, because it deletes the kind's folder, and that of its tests. Tests elsewhere that import the kind
are left out, and counted.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
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
    """Run the tests without the kind of the command line, and exit with pytest's status."""
    (kind,) = sys.argv[1:]
    left_out = importing(kind)
    for folder in (ROOT / "controllers" / kind, ROOT / "tests" / "controllers" / kind):
        shutil.rmtree(folder)
    print(f"long: without {len(left_out)} test files that import {kind}", flush=True)
    pytest = [sys.executable, "-m", "pytest", "-q", "-n", "4", "-m", "not (browser or processes)"]
    tests = [*(f"--ignore={each}" for each in left_out), *(f"tests/{each}" for each in TESTS)]
    sys.exit(subprocess.run([*pytest, *tests], cwd=ROOT, check=False).returncode)


if __name__ == "__main__":
    main()
