"""`robomesh robot verify` at a person's pace: `./dev run python -m tests.soak.verify_joints`.

Five simulated controllers of Universal Robots, Yaskawa and FANUC go from pose to pose and rest in each, as
arms that a person moves from the panel. The site declares four of them wrongly, each in another way, and all
links are lost meanwhile. Each comparison must end and name its fault.
"""

import argparse
import asyncio
import itertools
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import numpy as np

from controllers.fanuc.simulated import service as fanuc
from controllers.simulated import demo
from controllers.universal_robots.simulated import service as universal_robots
from controllers.yaskawa.simulated import service as yaskawa
from robots.descriptions.description import LIBRARY, RobotDescription, load
from robots.kinematics.joints import FloatArray, joints_of
from tests.ports import free_port
from tests.site import lean, robomesh, running_file, site_file

MODEL = "puma560"
LOST_S, MOVE_S = 3.0, 1.0
ZERO = "theta = 0.0", "theta = 4.0"  # of the model's first row


class Fault(NamedTuple):
    """A wrong declaration of a robot, and the words that name it."""

    protocol: str
    words: str
    table: str = ""
    model: str = MODEL


FAULTS = {
    "none": Fault("rtde", "model and controller agree"),
    "zero": Fault("rtde", "the zero of waist is off by", model="wrong/robot.toml"),
    "sign": Fault(
        "hses", "elbow turns the other way", "yaskawa]\npulses_per_degree = [1e3, 1e3, -1e3, 1e3, 1e3, 1e3]"
    ),
    "unit": Fault(
        "hses",
        "elbow moves 1.25 times as far",
        "yaskawa]\npulses_per_degree = [1e3, 1e3, 1250.0, 1e3, 1e3, 1e3]",
    ),
    "coupling": Fault(
        "snpx", "elbow is its value plus that of shoulder", 'fanuc]\nassignments = "own"\nj23 = 0'
    ),
}


class Outcome(NamedTuple):
    """What a comparison said, on standard output and on the way, and how long it took."""

    said: str
    way: str
    minutes: float


class Controllers:
    """Simulated controllers of all FAULTS in a thread; ports by the fault's name.

    `lost` disconnects all of them for a while; then they go on.
    """

    def __init__(self, poses: int, rest_s: float) -> None:
        self.ports = {name: free_port() for name in FAULTS}
        self.lost = threading.Event()
        self._ended = threading.Event()
        self._poses, self._rest_s = poses, rest_s
        self._began_s = time.monotonic()

    def tour(self, _: RobotDescription) -> Iterator[FloatArray]:
        """Yield poses, endlessly; the last joint moves only in the last of them, so that all are needed."""
        joints = joints_of(load(MODEL))
        spread = np.random.default_rng(7).uniform(-0.2, 0.2, (self._poses, len(joints)))
        spread[:, -1] = 0.0
        spread[-1, -1] = 0.2
        # After a loss the arm is where it was: about there.
        begin = int((time.monotonic() - self._began_s) / (self._rest_s + MOVE_S))
        return itertools.cycle(joints.home + np.roll(spread, -begin, axis=0) * (joints.upper - joints.lower))

    @contextmanager
    def running(self) -> Iterator[None]:
        """Run them as long as the block lasts."""
        thread = threading.Thread(target=asyncio.run, args=(self._run(),))
        with ExitStack() as patches:
            patches.enter_context(mock.patch.object(demo, "_REST_S", self._rest_s))
            for module in (universal_robots, yaskawa, fanuc):
                patches.enter_context(mock.patch.object(module, "demo_tour", self.tour))
            thread.start()
            try:
                yield
            finally:
                self._ended.set()
                thread.join()

    async def _run(self) -> None:
        while not self._ended.is_set():
            tasks = [asyncio.create_task(self._serve(name)) for name in FAULTS]
            while not (self._ended.is_set() or self.lost.is_set()):
                await asyncio.sleep(0.1)
            for task in tasks:
                task.cancel()
            for outcome in await asyncio.gather(*tasks, return_exceptions=True):
                assert isinstance(outcome, asyncio.CancelledError), outcome
            if self.lost.is_set():
                await asyncio.sleep(LOST_S)
                self.lost.clear()

    async def _serve(self, name: str) -> None:
        listen = f"127.0.0.1:{self.ports[name]}"
        match FAULTS[name].protocol:
            case "rtde":
                await universal_robots.serve_rtde(universal_robots.UrSettings(listen=listen, demo=True))
            case "hses":
                await yaskawa.serve_hses(yaskawa.HsesSettings(listen=listen, demo=True))
            case _:
                await fanuc.serve_snpx(fanuc.SnpxSettings(listen=listen, demo=True))


def trial(folder: Path, *, poses: int, rest_s: float, losses: int) -> dict[str, Outcome]:
    """Compare every robot; return what each comparison said."""
    wrong = shutil.copytree(LIBRARY / MODEL, folder / "wrong") / "robot.toml"
    wrong.write_text(wrong.read_text().replace(*ZERO, 1))
    controllers = Controllers(poses, rest_s)
    robots = "".join(
        f'\n[[robot]]\nname = "{name}"\nmodel = "{each.model}"\nprotocol = "{each.protocol}"\n'
        f'controller = "{"udp" if each.protocol == "hses" else "tcp"}://127.0.0.1:{controllers.ports[name]}"\n'
        f"{each.table and '[robot.' + each.table}\n"
        for name, each in FAULTS.items()
    )
    router, page = f"tcp/127.0.0.1:{free_port()}", f"127.0.0.1:{free_port()}"
    path = site_file(folder, robots=robots, router=router, console=page)
    longest_s = 60.0 + 3 * poses * (rest_s + 5.0) + losses * 60.0

    def compare(name: str) -> Outcome:
        began_s = time.monotonic()
        out = str(folder / f"{name}.json")
        words = ("robot", "verify", f"test/{name}", "--connect", router, "--out", out)
        done = robomesh(*words, timeout_s=longest_s)
        return Outcome(done.stdout, done.stderr, (time.monotonic() - began_s) / 60.0)

    with (
        controllers.running(),
        running_file(path, router, page, **lean([])),
        ThreadPoolExecutor(len(FAULTS)) as pool,
    ):
        found = {name: pool.submit(compare, name) for name in FAULTS}
        for _ in range(losses):
            time.sleep(poses * (rest_s + 1.0) / (losses + 1))
            controllers.lost.set()
        return {name: each.result() for name, each in found.items()}


def main() -> None:
    """Print a line a robot; exit status 1 if a fault was not named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=20)
    parser.add_argument("--rest", type=float, default=90.0, metavar="S", help="in each pose")
    parser.add_argument("--losses", type=int, default=2, help="of all links")
    chosen = parser.parse_args()
    failed = False
    with tempfile.TemporaryDirectory() as folder:
        found = trial(Path(folder), poses=chosen.poses, rest_s=chosen.rest, losses=chosen.losses)
    for name, outcome in found.items():
        named = FAULTS[name].words in outcome.said
        failed |= not named
        taken = f"{outcome.way.count('taken') + 1} poses, {outcome.way.count('waiting')} losses"
        print(f"{name}: {'named' if named else 'NOT named'}; {taken}, {outcome.minutes:.1f} min")
        print(outcome.said if named else f"{outcome.said}{outcome.way}")
    sys.exit(failed)


if __name__ == "__main__":
    main()
