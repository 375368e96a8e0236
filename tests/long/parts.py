"""Runs on other Pythons and systems: `./dev test --long [PART ...]`. CONTRIBUTING.md has their table.

Each part clones this commit into a new folder, here or in a bare Debian, and sets it up as the README says.
Its log and its result stay in `.long`. It needs root and mmdebstrap, for the Debians.
"""

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / ".long"
LONGEST_S = 3600.0
_SUITE, _QUICK = "./dev test", "./dev test --quick"
_COMMANDS = ".venv/bin/python -m tests.long.documented_commands"
_WITHOUT = ".venv/bin/python -m tests.long.without"
_BARE = "python3,python3-pip,git,ca-certificates"
# What the README names, and a user without rights cannot install.
_PACKAGES = "chromium fonts-noto-cjk libatomic1 libegl1 libgl1 libgomp1"
# Of the machine's network, for installers.
_NETWORK = ("etc/resolv.conf", "etc/hosts", "etc/pip.conf", "etc/ssl/certs", "root/.npmrc")
_OF_INSTALLERS = re.compile(r"^(PIP|UV|SSL|NODE|npm|CURL|REQUESTS|GIT_SSL)_|_(PROXY|proxy)$")


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
    """

    runs: tuple[str, ...]
    debian: str = ""
    python: str = ""
    user: str = "root"
    folder: str = "/srv/robomesh"
    environment: dict[str, str] = field(default_factory=dict)
    read_only_home: bool = False


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
    "without-kinds": Part((f"./dev run pytest --version && {_WITHOUT}",)),
    "python-3.14": Part((_QUICK, _COMMANDS), debian="testing"),
    "first-hour": Part(
        (f"./dev run true && {_COMMANDS}",), debian="bookworm", user="newcomer", read_only_home=True
    ),
}


def main(names: list[str]) -> None:
    """Run parts, each one that is named, or all, and print every result that is kept."""
    if unknown := [name for name in names if name not in PARTS]:
        sys.exit(f"dev: there is no part {unknown[0]!r}: {', '.join(PARTS)} are there")
    wanted = names or list(PARTS)
    debians = [name for name in wanted if PARTS[name].debian]
    if debians and (os.geteuid() != 0 or shutil.which("mmdebstrap") is None):
        sys.exit(f"dev: {debians[0]} needs root and mmdebstrap: apt-get install mmdebstrap")
    RESULTS.mkdir(exist_ok=True)
    # A shell's background ignores Ctrl-C, and so would every command of a part.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for name in wanted:
        result = run(name, PARTS[name])
        (RESULTS / f"{name}.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    kept = {name: RESULTS / f"{name}.json" for name in PARTS}
    results = {name: json.loads(file.read_text()) for name, file in kept.items() if file.exists()}
    for name, each in results.items():
        counts = "; ".join(each["counts"])
        print(f"{name:12} {each['outcome']:9} {each['python']:8} {each['minutes']:4.0f} min  {counts}")
    sys.exit(any(results[name]["outcome"] != "passed" for name in wanted))


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
    with log.open("w", encoding="utf-8") as output:
        command = in_debian(folder, part) if part.debian else on_this_machine(folder, part)
        try:
            # What it starts ends with it, and its mounts too.
            separate = ("unshare", "--mount", "--pid", "--fork", "--kill-child") if part.debian else ()
            done = subprocess.run(
                [*separate, "sh", "-euc", command],
                stdout=output,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                timeout=LONGEST_S,
                check=False,
            )
            outcome = "passed" if done.returncode == 0 else "failed"
        except subprocess.TimeoutExpired:
            outcome = "too long"
    said = log.read_text(encoding="utf-8", errors="replace")
    if outcome == "passed":
        remove(folder)
    version = re.findall(r"^platform linux -- Python (\S+),|^python (\S+)$", said, re.M)
    return {
        "outcome": outcome,
        "commit": commit.stdout.strip(),
        "python": "".join(version[0]) if version else "",
        "minutes": (time.monotonic() - began_s) / 60,
        # Of each run of pytest, and of the documents' commands.
        "counts": re.findall(r"\d+ (?:passed|failed).*?(?= in \d)|\d+ of the documents' commands.*", said),
    }


def remove(folder: Path) -> None:
    """Delete a part's folder; nothing is mounted there any more."""
    if folder.exists():
        subprocess.run(["rm", "-rf", "--one-file-system", folder], check=True)


def on_this_machine(folder: Path, part: Part) -> str:
    """Return the script of a part of this machine."""
    clone = folder / "robomesh"
    return "\n".join(
        [
            f"git clone --quiet {shlex.quote(str(ROOT))} {shlex.quote(str(clone))}",
            f"cd {shlex.quote(str(clone))}",
            f"export UV_PYTHON={part.python}",
            *part.runs,
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
        f"mmdebstrap --quiet --variant=minbase --include={_BARE} {part.debian} {folder}",
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
    for command in part.runs:
        words = f"cd {shlex.quote(part.folder)} && python3 -V && {command}"
        lines.append(f"{inside} {bare} {typed_by} sh -euc {shlex.quote(words)}")
    return "\n".join(lines)
