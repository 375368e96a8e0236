"""What the fuzz programs share: options, the run with its check of memory, changes of bytes, findings."""

import argparse
import random
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, NoReturn, Protocol

WARM_UP = 20_000


class Finding(NamedTuple):
    """Input that is handled wrongly."""

    data: bytes
    problem: str


class Wrong(Exception):
    """A driver did what a strict reading forbids."""


def options(doc: str, *, inputs: int, seconds: float) -> argparse.ArgumentParser:
    """Return the parser of the options that all programs have."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--inputs", type=int, default=inputs)
    parser.add_argument("--seconds", type=float, default=seconds)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "robomesh-fuzz")
    return parser


def keep(folder: Path, name: str, finding: Finding) -> NoReturn:
    """Write a finding's input into the folder, and end the program with exit status 1."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_bytes(finding.data)
    sys.exit(f"{path}: {finding.problem}")


def campaign(
    doc: str,
    fuzz: Callable[[int, int, Counter[str]], tuple[int, Finding | None]],
    *,
    name: str,
    verdict: str,
    inputs: int = 1_000_000,
    seconds: float = 3600.0,
    growth_mib: float = 16,
) -> None:
    """Fuzz in blocks until the options' end; exit with status 1 at a finding, or if the memory grows.

    Args:
        fuzz: Reads so many inputs with a seed, and counts what it did by name; returns how many it read, and
            the first wrong one.
        name: Of the files of findings: NAME-seed1-23.bin.
        verdict: Last line of a run without findings.
        growth_mib: Growth of the process after a warm-up that is allowed.
    """
    counts: Counter[str] = Counter()
    arguments = options(doc, inputs=inputs, seconds=seconds).parse_args()
    begun_s = time.monotonic()
    done, finding = fuzz(WARM_UP, arguments.seed, counts)
    begun_mib = rss_mib()
    while finding is None and done < arguments.inputs and time.monotonic() < begun_s + arguments.seconds:
        more, finding = fuzz(min(50_000, arguments.inputs - done), arguments.seed * 1_000_003 + done, counts)
        done += more
    took_s, mib = time.monotonic() - begun_s, rss_mib()
    print(f"{done:,} inputs in {took_s:.0f} s, {time.process_time():.0f} s of CPU")
    if counts:
        print(", ".join(f"{count:,} {what}" for what, count in counts.most_common()))
    print(f"memory {begun_mib:.1f} MiB after {WARM_UP:,} inputs, {mib:.1f} MiB at the end")
    if finding is not None:
        keep(arguments.keep, f"{name}-seed{arguments.seed}-{done}.bin", finding)
    if mib - begun_mib > growth_mib:
        sys.exit(f"memory grew by {mib - begun_mib:.1f} MiB, {growth_mib:g} are allowed")
    print(verdict)


class Bench(Protocol):
    """A driver with a controller that is the fuzzer's.

    Attributes:
        problem: Wrong command of the driver; empty: none.
    """

    problem: str

    def next_bytes(self, chance: random.Random) -> bytes:
        """Return what the controller sends next."""
        ...

    def receive(self, data: bytes) -> str:
        """Give bytes to the driver; return the problem with what it made of them, empty: none."""
        ...


def answers(
    inputs: int, seed: int, renewed: Callable[[], Bench], *, renew_each: int, cuts: bool = True
) -> tuple[int, Finding | None]:
    """Return how many answers a driver has read, and the first that was handled wrongly.

    Args:
        renewed: Returns the bench for the next answers.
        renew_each: Number of answers after which it is called again.
        cuts: The bytes are a stream, and arrive in pieces.
    """
    chance = random.Random(seed)
    bench = renewed()
    for done in range(inputs):
        if done and done % renew_each == 0:
            bench = renewed()
        data = bench.next_bytes(chance)
        try:
            pieces = cut(data, chance) if cuts and chance.random() < 0.1 else [data]
            problem = next(filter(None, map(bench.receive, pieces)), "")
        except Exception as error:
            problem = repr(error)
        if problem or bench.problem:
            return done, Finding(data, problem or bench.problem)
    return inputs, None


def step(
    bench: Callable[[random.Random], Any], inputs: int, seed: int, *, new_each: int
) -> tuple[int, Finding | None]:
    """Give inputs to benches; return how many were read, and the first that was handled wrongly.

    Args:
        bench: Creates a bench: `next_input` returns channel and bytes, `receive` raises `Wrong`.
        new_each: Inputs after which a new bench begins.
    """
    chance = random.Random(seed)
    for done in range(inputs):
        if done % new_each == 0:
            steps = bench(chance)
        data = b""
        try:
            channel, data = steps.next_input()
            steps.receive(channel, data)
        except Wrong as problem:
            return done, Finding(data, str(problem))
        except Exception as error:
            return done, Finding(data, repr(error))
    return inputs, None


def near(here: Sequence[float], there: Sequence[float], within: float) -> bool:
    """Return whether all numbers are near the others."""
    return all(abs(a - b) <= within for a, b in zip(here, there, strict=True))


def changed(message: bytes, others: Sequence[bytes], tokens: Sequence[bytes], chance: random.Random) -> bytes:
    """Return a binary message, changed in none to four places; a few become far too long.

    Args:
        others: Messages of which parts are inserted.
        tokens: Bytes that replace others, or are inserted.
    """
    data = bytearray(message)
    for _ in range(chance.choice((0, 0, 1, 1, 1, 2, 4))):
        at = int(chance.random() * (len(data) + 1))
        length = chance.choice((1, 1, 2, 4, 8, 32))
        match int(chance.random() * 8):
            case 0 if at < len(data):
                data[at] ^= 1 << int(chance.random() * 8)
            case 1:
                data[at : at + length] = chance.randbytes(length)
            case 2:
                del data[at : at + length]
            case 3:
                del data[at:]
            case 4:
                other = chance.choice(others)
                begin = int(chance.random() * len(other))
                data[at:at] = other[begin : begin + length]
            case 5:
                token = chance.choice(tokens)
                data[at : at + len(token)] = token
            case 6:
                data[at:at] = chance.choice(tokens)
            case 7 if len(data) > 5 and chance.random() < 0.01:
                data += bytes(70_000)
    return bytes(data)


def cut(data: bytes, chance: random.Random) -> list[bytes]:
    """Split the same bytes as TCP may deliver them."""
    places = sorted(int(chance.random() * len(data)) for _ in range(chance.choice((0, 0, 1, 3))))
    return [data[begin:end] for begin, end in zip([0, *places], [*places, len(data)], strict=True)]


def rss_mib() -> float:
    """Return the memory of this process now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 2**20


# ------------------------------------------------------------------ short runs, as tests


def assert_strict(program: ModuleType, least: Mapping[str, int]) -> None:
    """Run a program for a short time.

    Args:
        least: How often each of these must happen, at least, in 20,000 inputs.
    """
    counts: Counter[str] = Counter()
    done, finding = program.fuzz(5_000, 3, counts)
    assert finding is None, finding
    assert done >= 5_000
    assert not {each: counts[each] for each, number in least.items() if 4 * counts[each] < number}


def assert_found(program: ModuleType, problem: str) -> None:
    """Run a program with a driver that has a fault.

    Args:
        problem: Pattern of a part of what it must find.
    """
    _, finding = program.fuzz(20_000, 2, Counter())
    assert finding is not None
    assert re.search(problem, finding.problem)


def no_problem(*given: object) -> None:
    """Find no reason against a motion."""


def broken(*given: object) -> None:
    """Fail as a programming error does."""
    raise ZeroDivisionError
