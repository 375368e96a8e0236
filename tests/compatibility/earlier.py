"""Fixtures of an earlier version: the folder of a site, and its services as processes."""

import os
import subprocess
import sys
import tarfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.site import wait_until

HERE = Path(__file__).parent
PASSWORD = "three arms in a hall"


def unpack(archive: str | Path, folder: Path) -> Path:
    """Unpack a fixture, or the archive with a path, into a new folder."""
    folder.mkdir(parents=True)
    with tarfile.open(HERE / archive) as files:  # a bare Debian's `tar` reads no xz
        # Python 3.11.2 has no filters, and 3.12 warns without one.
        files.extractall(folder, **({"filter": "data"} if hasattr(tarfile, "data_filter") else {}))
    return folder


@dataclass(frozen=True)
class EarlierVersion:
    """The packages of an earlier version, unpacked."""

    folder: Path

    def robomesh(self, *arguments: str, timeout_s: float = 60.0) -> subprocess.CompletedProcess[str]:
        """Run one of its commands to the end."""
        return subprocess.run(
            self._command(arguments),
            cwd=self.folder,
            env=self._environment(),
            capture_output=True,
            text=True,
            timeout=timeout_s,
        )

    @contextmanager
    def service(self, log: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
        """Run one of its services; end it when the block ends."""
        with log.open("wb") as output:
            process = subprocess.Popen(
                self._command(arguments),
                cwd=self.folder,
                env=self._environment(),
                stdout=output,
                stderr=subprocess.STDOUT,
            )
            try:
                yield process
            finally:
                end(process)

    def _command(self, arguments: Sequence[str]) -> list[str]:
        return [sys.executable, "-m", "services.command_line.main", *arguments]

    def _environment(self) -> dict[str, str]:
        return os.environ | {"PYTHONPATH": str(self.folder)}


def end(process: subprocess.Popen[bytes]) -> None:
    """End a process, by force if it does not exit after a signal."""
    process.terminate()
    try:
        process.wait(20.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def in_log(log: Path, words: str) -> None:
    """Wait until a log contains these words."""
    wait_until(lambda: words in log.read_text(), what=f"{log.name} does not say {words!r}")
