"""The commands of README.md and CONTRIBUTING.md, typed one after the other as a newcomer does.

    .venv/bin/python -m tests.long.documented_commands

`./dev up` runs at the same time. Exit status 1: one of them does not do what the documents say.
"""

import os
import re
import shlex
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = ("README.md", "CONTRIBUTING.md")
PAGE = "http://127.0.0.1:8080/"
_READY_S = 600.0
_LONGEST_S = 1500.0
_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.M | re.S)
_SPAN = re.compile(r"`([^`\n]+)`")
_BEGINS = ("./dev ", "robomesh ", ".tools/bin/uv ", "git clone ")


@dataclass(frozen=True)
class How:
    """How a documented command is tried.

    Attributes:
        typed: What is typed instead, in order; empty: the command itself.
        says: Text of the last one's output.
        ctrl_c_s: It runs until Ctrl-C, which comes after this time [s].
        statuses: Exit statuses that are right.
        not_here: Where else it is tried, or why it cannot be; empty: it is typed.
    """

    typed: tuple[str, ...] = ()
    says: str = ""
    ctrl_c_s: float | None = None
    statuses: tuple[int, ...] = (0,)
    not_here: str = ""


# In the order in which they are typed.
_BUILD = ".tools/bin/uv build --wheel --build-constraint requirements.lock --out-dir dist"
COMMANDS = {
    "git clone ADDRESS robomesh": How(not_here="the checkout in which this runs"),
    "./dev up": How(not_here="runs during all others"),
    "robomesh --help": How(says="monitor"),
    "robomesh doctor": How(says="OpenGL", statuses=(0, 1)),
    "robomesh list": How(says="pt600"),
    "robomesh monitor pt600": How(says="waist", ctrl_c_s=5.0),
    "robomesh send pt600 stop": How(says="stop request"),
    "robomesh send pt600 move 10 40 -60 20 0": How(
        typed=(
            "robomesh send pt600 reset",
            "robomesh send pt600 home",
            "robomesh send pt600 move 10 40 -60 20 0",
        )
    ),
    "robomesh record pt600 --name trial": How(says="nothing lost", ctrl_c_s=8.0),
    "robomesh recordings export trial trial.mp4": How(),
    "robomesh audit list pt600 --since 1h": How(says="MOVE_ABSOLUTE"),
    "robomesh robot check examples/scara.urdf": How(statuses=(0, 1)),
    "robomesh program check examples/square.program --robot pt600": How(statuses=(0, 1)),
    "./dev run python examples/...": How(
        typed=(
            "./dev run python examples/home.py",
            "./dev run python examples/check.py examples/square.program",
            "./dev run python examples/inverse.py 300 0 500",
            "robomesh recordings fetch trial",
        ),
        statuses=(0, 1),
    ),
    "robomesh fault pt600 freeze": How(
        typed=("robomesh fault pt600 freeze", "robomesh fault pt600 freeze --off")
    ),
    "robomesh --install-completion": How(statuses=(0, 1)),
    "robomesh keys init site.toml": How(
        typed=(
            "mkdir -p dist",
            'sh -c "printf \'site = \\"hall\\"\\n[keys]\\nfolder = \\"keys\\"\\n\' > dist/site.toml"',
            "robomesh keys init dist/site.toml",
        )
    ),
    "robomesh accounts add": How(typed=("robomesh accounts add --help",)),
    # The figures take 20 minutes; these are a tenth of them.
    "./dev run python -m benchmarks command": How(
        typed=("./dev run python -m benchmarks command --dead-man 10 --race 1000 --stops 30 --beside 12",)
    ),
    "./dev run python -m benchmarks latency": How(),
    "./dev run python -m tests.soak.recorder_kills --times 50": How(
        typed=("./dev run python -m tests.soak.recorder_kills --times 5",)
    ),
    "./dev run true": How(),
    # The home cannot be written, and uv itself has its cache there.
    _BUILD: How(
        typed=(f"env UV_CACHE_DIR=dist/cache {_BUILD}",),
    ),
    "./dev run python web/build_page.py --format": How(),
    "./dev test tests/robots/test_dh.py -k base": How(says="passed"),
    "./dev test tests/robots": How(says="passed"),
    "./dev test tests/controllers/test_conformance_of_motion.py -v -rs": How(says="passed"),
    "./dev test tests/services/test_zenohd.py": How(says="skipped"),
    "./dev test tests/services/test_catalogues.py": How(says="passed"),
    "./dev test --page tests/mesh": How(says="passed"),
    "./dev test --quick": How(says="passed"),
    "./dev run python tests/check_prose.py --list 40": How(),
    "./dev run robomesh robot check <name>": How(typed=("./dev run robomesh robot check pt600",)),
    "./dev run robomesh robot show <name>": How(typed=("./dev run robomesh robot show pt600",)),
    "./dev run python -m grpc_tools.protoc -Irobomesh/schemas --python_out=robomesh/schemas "
    "--pyi_out=robomesh/schemas robomesh.proto": How(),
    "./dev run python tests/make_topics.py": How(),
    "./dev run python tests/make_python_reference.py": How(),
    "./dev run python tests/make_site_file.py": How(),
    "./dev test": How(not_here="CI, and the parts debian-12 and debian-13"),
    "./dev test --keep-durations": How(not_here="as long as ./dev test"),
    "./dev test --long": How(not_here="it runs this"),
    "./dev check": How(not_here="CI"),
    "./dev run": How(not_here="with commands, above"),
    "./dev add": How(not_here="tests/test_dev.py"),
}


def documented(text: str) -> list[str]:
    """Return the commands in a document, without their explanations."""
    found = []
    for language, block in _BLOCK.findall(text):
        for line in block.splitlines() if not language else ():
            command = re.split(r"\s{2,}|\s+#", line.strip(), maxsplit=1)[0]
            found += [each for each in command.split(" && ") if each.startswith(_BEGINS)]
    spans = _SPAN.findall(_BLOCK.sub("", text))
    return list(dict.fromkeys(found + [each for each in spans if each.startswith(_BEGINS)]))


def main() -> None:
    """Type them all, and list those that are not right."""
    wrong = []
    with site():
        for command, how in COMMANDS.items():
            if how.not_here:
                continue
            began_s = time.monotonic()
            if problem := tried(command, how):
                wrong.append(command)
                print(f"NOT RIGHT  {command}: {problem}", flush=True)
            else:
                print(f"right      {command} ({time.monotonic() - began_s:.0f} s)", flush=True)
    print(f"{len(wrong)} of the documents' commands are not right")
    sys.exit(bool(wrong))


@contextmanager
def site() -> Iterator[None]:
    """Run `./dev up` during the block, from the moment when its page answers."""
    with subprocess.Popen(["./dev", "up"], cwd=ROOT, stdout=sys.stderr) as process:
        try:
            deadline = time.monotonic() + _READY_S
            while not _answers():
                if process.poll() is not None or time.monotonic() > deadline:
                    sys.exit("./dev up does not serve the page")
                time.sleep(0.5)
            yield
        finally:
            process.send_signal(signal.SIGINT)


def _answers() -> bool:
    try:
        with urllib.request.urlopen(PAGE, timeout=2.0) as answer:
            return b"robomesh" in answer.read()
    except OSError:
        return False


def tried(command: str, how: How) -> str:
    """Type a command; return what is wrong, or an empty text."""
    for each in how.typed or (command,):
        status, output = typed(each, how.ctrl_c_s)
        if status not in how.statuses or "Traceback" in output:
            return f"{each}: exit status {status}: {output[-2000:]}"
    return "" if how.says in output else f"does not say {how.says!r}: {output[-2000:]}"


def typed(command: str, ctrl_c_s: float | None) -> tuple[int, str]:
    """Run a command in an activated environment; return its exit status and all that it printed."""
    environment = {
        **os.environ,
        "PATH": f"{ROOT / '.venv' / 'bin'}:{os.environ['PATH']}",
        "SHELL": "/bin/bash",
    }
    with subprocess.Popen(
        shlex.split(command),
        cwd=ROOT,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        try:
            output, _ = process.communicate(timeout=ctrl_c_s or _LONGEST_S)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
            output, _ = process.communicate(timeout=60.0)
            if ctrl_c_s is None:
                return 124, output
        return process.returncode, output


if __name__ == "__main__":
    main()
