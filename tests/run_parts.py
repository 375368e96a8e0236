"""Runs of the tests in parts beside each other, and of what failed once more; `./dev test` uses it."""

import json
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from contextlib import ExitStack
from pathlib import Path

# So many tests may pass only when they are run again; with so many failures the second run ends.
MOST_UNSTEADY = 2
MOST_FAILURES = 3
FAILED = "cache/lastfailed"


def run_parts(pytest: tuple[str, ...], parts: tuple[tuple[str, ...], ...], folder: Path) -> str | None:
    """Run the parts of the tests beside each other, and what failed once more, alone.

    Other programs may take the machine's time from a test once, but hardly twice. A test that passes only
    when it is run again is a fault all the same, so it is named. Skipped tests are listed by reason.

    Returns:
        Why the tests failed, for `sys.exit`; None: they passed.
    """
    shutil.rmtree(folder / ".pytest_cache", ignore_errors=True)  # it lists the failures of earlier runs too
    caches = [folder / ".pytest_cache" / str(number) for number in range(len(parts))]
    kept_in = {cache: (*pytest, "-o", f"cache_dir={cache}") for cache in caches}
    ended = run_beside([(*kept_in[cache], *part) for cache, part in zip(caches, parts, strict=True)], folder)
    skipped = sum((Counter(kept(cache, "robomesh/skipped")) for cache in caches), Counter[str]())
    for reason, count in skipped.most_common():
        say(f"{count} skipped: {reason}")
    if ended == {0}:
        return None
    failed = {cache: {*kept(cache, FAILED)} for cache in caches if kept(cache, FAILED)}
    first = set().union(*failed.values())
    if ended - {0, 1} or not first:
        return "dev: the tests could not be run; see above"
    say(f"{len(first)} failed, and are run once more, alone")
    left = set()
    for cache in failed:
        again = (*kept_in[cache], "--last-failed", f"--maxfail={MOST_FAILURES}")
        if subprocess.run(again, cwd=folder, check=False).returncode:
            # What was not run again, because enough had failed, counts as failed.
            left |= {*kept(cache, FAILED)}
    unsteady = sorted(first - left)
    if unsteady:
        say(f"{len(unsteady)} unsteady, passed only when run again; each is a fault, find it:")
        for name in unsteady:
            say(f"    {name}")
    if left:
        return "dev: tests failed; see above"
    if len(unsteady) > MOST_UNSTEADY:
        return f"dev: tests failed: more than {MOST_UNSTEADY} are unsteady"
    return None


def run_beside(commands: list[tuple[str, ...]], folder: Path) -> set[int]:
    """Run commands beside each other; print what each says when it has ended, the first's at once.

    Returns:
        Their exit statuses.
    """
    with ExitStack() as stack:
        said = [stack.enter_context(tempfile.TemporaryFile()) for _ in commands[1:]]
        started = [
            stack.enter_context(subprocess.Popen(command, cwd=folder, stdout=output, stderr=output))
            for command, output in zip(commands, (None, *said), strict=True)
        ]
        ended = {process.wait() for process in started}
        for output in said:
            output.seek(0)
            sys.stdout.buffer.write(output.read())
        sys.stdout.flush()
    return ended


def kept(cache: Path, name: str) -> dict[str, int]:
    """Return what pytest keeps under a name in its cache, by test or reason."""
    file = cache / "v" / name
    return json.loads(file.read_text()) if file.exists() else {}


def say(text: str) -> None:
    """Print a line for the person who waits."""
    print(f"dev: {text}", file=sys.stderr, flush=True)
