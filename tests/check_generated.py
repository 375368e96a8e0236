"""Check that generated files are current and lock files hold no address: `./dev check` runs it.

Usage: check_generated.py UV LOCK_ARGUMENT...
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SCHEMAS = ROOT / "robomesh" / "schemas"
PACKAGE_LOCK = ROOT / "web" / "package-lock.json"
LOCK = ROOT / "requirements.lock"
EXAMPLE_ROBOTS_LOCK = ROOT / "example-robots.lock"


def generated_modules() -> list[str]:
    """Return problems with the modules that protoc writes."""
    with tempfile.TemporaryDirectory() as folder:
        protoc = [sys.executable, "-m", "grpc_tools.protoc", f"-I{SCHEMAS}"]
        outputs = [f"--python_out={folder}", f"--pyi_out={folder}"]
        if subprocess.run([*protoc, *outputs, "robomesh.proto"]).returncode:
            return ["robomesh.proto: protoc refuses it"]
        return [
            f"robomesh/schemas/{new.name} is not what robomesh.proto makes: run "
            "./dev run python -m grpc_tools.protoc -Irobomesh/schemas --python_out=robomesh/schemas "
            "--pyi_out=robomesh/schemas robomesh.proto"
            for new in Path(folder).iterdir()
            if new.read_bytes() != (SCHEMAS / new.name).read_bytes()
        ]


def requirements_lock(uv: str, arguments: list[str]) -> list[str]:
    """Return problems with requirements.lock: its sources require something else."""
    with tempfile.TemporaryDirectory() as folder:
        # With the old file as output, versions are kept where they still fit.
        again = Path(folder) / LOCK.name
        again.write_bytes(LOCK.read_bytes())
        subprocess.run([uv, *arguments, "--output-file", str(again)], cwd=ROOT, check=True)
        if _pins(again) != _pins(LOCK):
            return ["requirements.lock is not what pyproject.toml asks for: run ./dev lock"]
    return []


def addresses() -> list[str]:
    """Return problems with lock files that would work behind one mirror only."""
    return [
        f"{path.relative_to(ROOT)}:{number}: an address: {line.strip()}"
        for path in (LOCK, EXAMPLE_ROBOTS_LOCK, PACKAGE_LOCK)
        for number, line in enumerate(path.read_text().splitlines(), 1)
        if re.search(r'"resolved"|index-url|find-links|registry\.|https?://[^"\s]*\.(whl|tgz|gz)', line)
    ]


def _pins(path: Path) -> list[str]:
    return [line for line in path.read_text().splitlines() if line and not line.lstrip().startswith("#")]


if __name__ == "__main__":
    problems = [*generated_modules(), *requirements_lock(sys.argv[1], sys.argv[2:]), *addresses()]
    print("\n".join(problems) if problems else "generated code and lock files are current")
    sys.exit(1 if problems else 0)
