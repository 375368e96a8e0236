"""A site of real processes: a router and the services that a measurement names, on ports of their own."""

import contextlib
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.harness.processes import program, until_connectable
from benchmarks.harness.program import ROOT
from tests.ports import free_port

ROBOMESH = (sys.executable, "-m", "services.command_line.main")


@dataclass
class Site:
    """A running site.

    Attributes:
        folder: Of the site file and all that the site writes.
        endpoint: Of the router.
        console: HOST:PORT of the page.
        processes: By the service's name.
    """

    folder: Path
    endpoint: str
    console: str
    processes: "dict[str, subprocess.Popen[bytes]]" = field(default_factory=dict)

    @property
    def file(self) -> Path:
        """Return the site file."""
        return self.folder / "site.toml"


@contextlib.contextmanager
def running_site(
    *services: str,
    tables: str = "",
    name: str = "bench",
    console: str = "",
    scheme: str = "tcp",
    prepare: Callable[[Site], None] = lambda site: None,
) -> Iterator[Site]:
    """Run a router and these services, each in a process, while the block runs.

    Args:
        tables: More of the site file.
        name: Name of the site.
        console: More keys of the console's table.
        scheme: Of the router's endpoint.
        prepare: Makes more files before the router starts.
    """
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        site = Site(Path(folder), f"{scheme}/127.0.0.1:{free_port()}", f"127.0.0.1:{free_port()}")
        site.file.write_text(
            f'site = "{name}"\n[router]\nlisten = ["{site.endpoint}"]\n[audit]\nfolder = "{folder}/audit"\n'
            f'[console]\nlisten = "{site.console}"\n{console}\n{tables}'
        )
        prepare(site)
        for service in ("router", *services):
            attach = () if service == "router" else ("--connect", site.endpoint)
            words = (*ROBOMESH, service, "--site", str(site.file), *attach)
            site.processes[service] = stack.enter_context(program(*words, cwd=ROOT))
            if service in ("router", "console"):
                until_connectable(site.endpoint if service == "router" else site.console)
        yield site


def robot(name: str, port: int, more: str = "stop_proven = true\n") -> str:
    """Return the table of a Pt600 with a controller of the unit protocol at a port of this machine."""
    return f'[[robot]]\nname = "{name}"\nmodel = "pt600"\ncontroller = "tcp://127.0.0.1:{port}"\n{more}'
