"""Runs that take longer than CI: `./dev test --long [PART ...]`. CONTRIBUTING.md has their table.

Each part clones this commit into a new folder, here or in a bare Debian, and sets it up as the README says.
Its log and its result stay in `.long`. A part that cannot run here stops no other.
"""

import contextlib
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / ".long"
LONGEST_S = 3600.0
_SUITE, _QUICK = "./dev test", "./dev test --quick"
_PYTHON = ".venv/bin/python"
_COMMANDS = f"{_PYTHON} -m tests.long.documented_commands"
_SET_UP = f"./dev test --version && {_PYTHON} -V"
_READY = "long: set up"
# What the page's tests and those of whole sites need.
_BUSY = "./dev test -n auto --maxprocesses 4 --dist loadfile"
_BARE = "python3,python3-pip,git,ca-certificates"
# What the README names, and a user without rights cannot install.
_PACKAGES = "chromium fonts-noto-cjk libatomic1 libegl1 libgl1 libgomp1"
# Of the machine's network, for installers.
_NETWORK = ("etc/resolv.conf", "etc/hosts", "etc/pip.conf", "etc/ssl/certs", "root/.npmrc")
_OF_INSTALLERS = re.compile(r"^(PIP|UV|SSL|NODE|npm|CURL|REQUESTS|GIT_SSL)_|_(PROXY|proxy)$")
# Of a run of pytest, of the documents' commands, and of a part's own lines.
_COUNTS = re.compile(
    r"\d+ (?:passed|failed).*?(?= in \d)|\d+ of the documents' commands.*|(?<=^long: )(?!set up).*", re.M
)
_SKIPS = re.compile(r"^SKIPPED \[(\d+)\] \S+ (.*)", re.M)

SEED = os.environ.get("ROBOMESH_SEED") or str(int(time.time()))
_FUZZERS = sorted(
    ".".join(each.relative_to(ROOT).with_suffix("").parts) for each in ROOT.glob("tests/**/fuzz_*.py")
)
_ENDLESS = f"--inputs 1000000000 --seconds {1800 // len(_FUZZERS)} --seed {SEED} --keep findings"


@dataclass(frozen=True)
class Part:
    """A run of the project's commands.

    Attributes:
        runs: Commands, typed in the clone.
        debian: The release that is installed bare; empty: this machine.
        python: Of this machine; empty: the oldest that it has.
        user: Who types them, in the Debian; `newcomer` is an ordinary user.
        folder: Where the clone is, in the Debian.
        environment: Variables.
        read_only_home: The user's home cannot be written.
        set_up: Command that is typed first, on this machine; where it fails, the part cannot run.
    """

    runs: tuple[str, ...]
    debian: str = ""
    python: str = ""
    user: str = "root"
    folder: str = "/srv/robomesh"
    environment: dict[str, str] = field(default_factory=dict)
    read_only_home: bool = False
    set_up: str = _SET_UP


# A mirror, as of Debian's testing, may be some weeks behind.
_ANY_AGE = "--aptopt='Acquire::Check-Valid-Until \"false\"'"

PARTS = {
    "debian-12": Part((_SUITE,), debian="bookworm"),
    "debian-13": Part(
        (_SUITE,),
        debian="trixie",
        user="newcomer",
        folder="/srv/my robots é 机器人/robomesh",
        environment={"TZ": "Asia/Shanghai", "LANG": "C", "LC_ALL": "C"},
    ),
    "python-3.12": Part((_QUICK,), python="3.12"),
    "python-3.13": Part((_QUICK,), python="3.13"),
    "python-3.14": Part((_QUICK, _COMMANDS), debian="testing"),
    "first-hour": Part(
        (f"./dev run true && {_COMMANDS}",), debian="bookworm", user="newcomer", read_only_home=True
    ),
    "page": Part((f'{_BUSY} -m "long and browser"',)),
    "rest": Part((f'{_BUSY} -m "long and not browser"',)),
    "compatibility": Part(("./dev test tests/compatibility",)),
    "elsewhere": Part((f"{_PYTHON} -m tests.long.elsewhere",)),
    "fuzzing": Part(
        (
            f"echo long: seed {SEED}",
            f"{_PYTHON} -m tests.fuzz.hulls_and_triangles --seed {SEED}",
            *(f"{_PYTHON} -m {each} {_ENDLESS}" for each in _FUZZERS),
        )
    ),
    "soak": Part(
        (
            f"echo long: seed {SEED}",
            f"{_PYTHON} -m tests.soak.audit_kills --seed {SEED}",
            f"{_PYTHON} -m tests.soak.latch_kills",
            # Other programs may take the machine's time; how much is lost without them is a benchmark.
            f"{_PYTHON} -m tests.soak.recorder_kills --most-lost 5 --seed {SEED}",
            f"{_PYTHON} -m tests.soak.recorder_disk",
            f"{_PYTHON} -m tests.soak.verify_joints --rest 20",
        )
    ),
    **{
        f"without-{kind.replace('_', '-')}": Part((f"{_PYTHON} -m tests.long.without {kind}",))
        for kind in ("fanuc", "opcua", "universal_robots", "yaskawa")
    },
}


def main(names: list[str]) -> None:
    """Run parts, each one that is named, or all, and print every result that is kept."""
    if unknown := [name for name in names if name not in PARTS]:
        sys.exit(f"dev: there is no part {unknown[0]!r}: {', '.join(PARTS)} are there")
    RESULTS.mkdir(exist_ok=True)
    # A shell's background ignores Ctrl-C, and so would every command of a part.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    wanted = names or list(PARTS)
    for name in wanted:
        result = run(name, PARTS[name])
        (RESULTS / f"{name}.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    kept = {name: RESULTS / f"{name}.json" for name in PARTS}
    results = {name: json.loads(file.read_text("utf-8")) for name, file in kept.items() if file.exists()}
    for name, each in results.items():
        said = each.get("reason") or "; ".join(each["counts"])
        print(f"{name:24} {each['outcome']:9} {each['python']:8} {each['minutes']:4.0f} min  {said}")
    sys.stdout.flush()
    idle = [f"dev: {name} not run: {results[name]['reason']}" for name in wanted if results[name]["reason"]]
    sys.exit("\n".join(idle) or any(results[name]["outcome"] != "passed" for name in wanted))


def run(name: str, part: Part) -> dict[str, object]:
    """Run a part, and return its result."""
    folder, log = RESULTS / name, RESULTS / f"{name}.log"
    remove(folder)
    folder.mkdir()
    commit = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    print(f"dev: {name}: its log is {log.relative_to(ROOT)}", file=sys.stderr, flush=True)
    began_s = time.monotonic()
    if missing := lacks(part):
        outcome = "not run"
        log.write_text(missing, encoding="utf-8")
    else:
        outcome = execute(folder, log, part)
    said = log.read_text(encoding="utf-8", errors="replace")
    if outcome in ("passed", "not run"):
        remove(folder)
    version = re.findall(r"^platform linux -- Python (\S+),|^[Pp]ython (\S+)$", said, re.M)
    skips: Counter[str] = Counter()
    for count, why in _SKIPS.findall(said):
        skips[why] += int(count)
    return {
        "outcome": outcome,
        "reason": problem(said) if outcome == "not run" else "",
        "commit": commit.stdout.strip(),
        "python": "".join(version[0]) if version else "",
        "minutes": (time.monotonic() - began_s) / 60,
        "counts": _COUNTS.findall(said),
        "skips": skips,
    }


def lacks(part: Part) -> str:
    """Return what a part needs and this machine does not have; empty: nothing."""
    if not part.debian:
        return ""
    if os.geteuid() != 0:
        return "a bare Debian needs root"
    return "" if shutil.which("mmdebstrap") else "mmdebstrap is not installed: apt-get install mmdebstrap"


def execute(folder: Path, log: Path, part: Part) -> str:
    """Execute a part's script, with its output in the log, and return the outcome."""
    script = in_debian(folder, part) if part.debian else on_this_machine(folder, part)
    separate = ("unshare", "--mount", "--pid", "--fork", "--kill-child") if part.debian else ()
    with (
        log.open("w", encoding="utf-8") as output,
        subprocess.Popen(
            [*separate, "sh", "-euc", script],
            stdout=output,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        ) as process,
    ):
        try:
            if process.wait(LONGEST_S) == 0:
                return "passed"
        except subprocess.TimeoutExpired:
            return "too long"
        finally:
            # What it started ends with it.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    return "failed" if _READY in log.read_text("utf-8", "replace").splitlines() else "not run"


def problem(said: str) -> str:
    """Return the first line that names an error, and its innermost cause; without one, the last line."""
    lines = [line.strip() for line in said.splitlines() if line.strip()] or ["it printed nothing"]
    errors = [line for line in lines if re.match(r"(?:npm )?error\b|e:|fatal:", line, re.I)]
    causes = [line for line in lines if line.startswith("cause: ")]
    return "; ".join((*(errors or lines[-1:])[:1], *causes[-1:]))


def remove(folder: Path) -> None:
    """Delete a part's folder; nothing is mounted there any more."""
    if folder.exists():
        subprocess.run(["rm", "-rf", "--one-file-system", folder], check=True)


def all_of(part: Part, typed: Callable[[str], str]) -> list[str]:
    """Return the end of a script: all of a part's commands, also after one that fails.

    Args:
        typed: Returns how a command is typed there.
    """
    lines = [f"echo {_READY}", "failed=0"]
    for each in part.runs:
        words = shlex.quote(each)
        lines.append(f"echo $ {words}; {typed(each)} || {{ failed=1; echo long: failed: {words}; }}")
    return [*lines, "exit $failed"]


def on_this_machine(folder: Path, part: Part) -> str:
    """Return the script of a part of this machine."""
    clone, place = (shlex.quote(str(each)) for each in (folder / "robomesh", folder))
    shared = shlex.quote(str(ROOT.parent / "shared"))
    return "\n".join(
        [
            f"git clone --quiet {shlex.quote(str(ROOT))} {clone}",
            # The tests' reference files.
            f"test ! -d {shared} || ln -s {shared} {place}",
            f"cd {clone}",
            f"export UV_PYTHON={part.python}",
            f"{part.set_up} || exit",
            *all_of(part, lambda each: f"sh -euc {shlex.quote(each)}"),
        ]
    )


def in_debian(folder: Path, part: Part) -> str:
    """Return the script of a part of a bare Debian: what the README asks for, and nothing else."""
    home = "/root" if part.user == "root" else f"/home/{part.user}"
    installers = {name: value for name, value in os.environ.items() if _OF_INSTALLERS.search(name)}
    variables = {"HOME": home, "PATH": "/usr/sbin:/usr/bin:/sbin:/bin", **installers, **part.environment}
    bare = "env -i " + " ".join(f"{name}={shlex.quote(value)}" for name, value in variables.items())
    inside = f"chroot {folder}"
    # Without this capability a user cannot make namespaces.
    typed_by = f"setpriv --bounding-set -sys_admin --reuid {part.user} --regid {part.user} --init-groups"
    lines = [
        f"mmdebstrap --quiet {_ANY_AGE} --variant=minbase --include={_BARE} {part.debian} {folder}",
        "mount --make-rprivate /",
        f"mount -t proc proc {folder}/proc",
        f"mount --rbind /dev {folder}/dev",
        *(f"test ! -e /{each} || cp -rT /{each} {folder}/{each}" for each in _NETWORK),
        f"mkdir -p {shlex.quote(f'{folder}{Path(part.folder).parent}')}",
        f"git clone --quiet --no-hardlinks {shlex.quote(str(ROOT))} {shlex.quote(f'{folder}{part.folder}')}",
    ]
    if part.user != "root":
        lines += [
            f"{inside} {bare} useradd --create-home {part.user}",
            f"test ! -e /root/.npmrc || {inside} install -o {part.user} /root/.npmrc {home}/.npmrc",
            f"{inside} {bare} apt-get -qq update",
            f"{inside} {bare} apt-get -qq install --no-install-recommends -y {_PACKAGES}",
            f"{inside} chown -R {part.user}:{part.user} {shlex.quote(part.folder)}",
        ]
    if part.read_only_home:
        lines += [f"mount --bind {folder}{home} {folder}{home}", f"mount -o remount,ro,bind {folder}{home}"]

    def typed(command: str) -> str:
        words = f"cd {shlex.quote(part.folder)} && python3 -V && {command}"
        return f"{inside} {bare} {typed_by} sh -euc {shlex.quote(words)}"

    return "\n".join([*lines, *all_of(part, typed)])
