"""Transcripts of drivers: calls and what they returned. A changed driver gets the same calls again.

    python -m tests.fuzz.transcripts record FOLDER [--inputs N]
    python -m tests.fuzz.transcripts replay FOLDER

`record` runs the fuzz programs and the tests of conformance, `replay` prints what differs.
Record with the version before a change (`git worktree add`), and replay with the changed one. Of timers, only
the time at which the next one ends is compared, because a driver may keep them in another way.
"""

import argparse
import gzip
import itertools
import os
import pickle
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from protocol_gateway.link.timers import Timers
from protocol_gateway.seam import Channel, Close, FateUnknown, Open, Report, Send, SetTimer

ROOT = Path(__file__).parents[2]
DRIVERS = {
    "RtdeDriver": "controllers.universal_robots.driver",
    "RtdeMotionDriver": "controllers.universal_robots.motion_driver",
    "HsesDriver": "controllers.yaskawa.driver",
    "HsesMotionDriver": "controllers.yaskawa.motion_driver",
    "SnpxDriver": "controllers.fanuc.driver",
    "FanucMotionDriver": "controllers.fanuc.rmi.motion_driver",
    "FtpDriver": "controllers.fanuc.ftp.driver",
    "OpcUaDriver": "controllers.opcua.driver",
    "UnitDriver": "controllers.unit.driver",
}
FUZZERS = (
    "universal_robots.fuzz_ur_motion",
    "yaskawa.fuzz_hses",
    "yaskawa.fuzz_hses_motion",
    "fanuc.fuzz_snpx",
    "fanuc.fuzz_rmi",
    "fanuc.fuzz_ftp",
    "opcua.fuzz_opcua",
)
SUITES = ("test_conformance.py", "test_conformance_of_motion.py")
TOLD = ("started", "opened", "received", "skipped", "closed", "timer_ended", "controlled", "stop_ends_now")
COMMANDS = ("prepare", "command")
_NEW_NAMES = {"encode": "prepare"}
# The fuzz program of RMI gives its driver a state in this way.
BESIDE = ("_noted",)


class Call(NamedTuple):
    """A call of a driver and its result.

    Attributes:
        given: Arguments; a channel is its name.
        came: Effects but those of timers, or the name and text of an error.
        timer_s: When the next timer ends.
    """

    name: str
    given: tuple[Any, ...]
    came: Any
    timer_s: float | None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("do", choices=("record", "replay"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--inputs", type=int, default=100_000)
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    if arguments.do == "replay":
        sys.exit(not replay(folder))
    environment = {**os.environ, "ROBOMESH_TRANSCRIPTS": str(folder), "PYTHONPATH": str(ROOT)}
    for name in FUZZERS:
        code = (
            "import collections; from tests.fuzz import transcripts; transcripts.record_here(); "
            f"from tests.controllers.{name} import fuzz; "
            f"print({name!r}, fuzz({arguments.inputs}, 1, collections.Counter()))"
        )
        subprocess.run([sys.executable, "-c", code], env=environment, cwd=ROOT, check=True)
    tests = [f"tests/controllers/{each}" for each in SUITES]
    plugin = ("-p", "tests.fuzz.transcripts", "-n", "4", "-q", "-W", "default")
    subprocess.run([sys.executable, "-m", "pytest", *plugin, *tests], env=environment, cwd=ROOT, check=False)


def pytest_configure() -> None:
    """Record in pytest, as its plugin."""
    record_here()


# ------------------------------------------------------------------------------ record

_numbers = itertools.count()
_CONSTANTS: dict[tuple[str, str], float | str] = {}


def record_here() -> None:
    """Write a transcript of each driver of this process from now on."""
    folder = Path(os.environ["ROBOMESH_TRANSCRIPTS"])
    folder.mkdir(parents=True, exist_ok=True)
    load()
    _CONSTANTS.update(constants())
    for name, module in DRIVERS.items():
        driver = getattr(import_module(module), name)
        for method in (*TOLD, *COMMANDS, *BESIDE):
            if method in vars(driver):
                setattr(driver, method, _recorded(method, getattr(driver, method)))
        driver.__init__ = _created(name, driver.__init__, folder)


def _created(name: str, create: Callable[..., None], folder: Path) -> Callable[..., None]:
    @wraps(create)
    def created(self: Any, joint_types: Any, codes: Any, **named: Any) -> None:
        create(self, joint_types, codes, **named)
        if type(self).__name__ != name:
            return
        path = folder / f"{name}-{os.getpid()}-{next(_numbers)}.gz"
        self.transcript = gzip.open(path, "wb", compresslevel=1)  # noqa: SIM115
        self.told, self.timers = 0, Timers()
        given = (name, tuple(joint_types), dict(codes), named.get("options"))
        changed = {each: value for each, value in constants().items() if value != _CONSTANTS.get(each, value)}
        pickle.dump((*given, changed, os.environ.get("PYTEST_CURRENT_TEST", "")), self.transcript)
        pickle.dump(facts(self), self.transcript)

    return created


def _recorded(name: str, method: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(method)
    def recorded(self: Any, *given: Any) -> Any:
        file = vars(self).get("transcript")
        if file is None or self.told:
            return method(self, *given)
        if name == "started" and hasattr(self, "_number"):
            # A number that is chosen by chance.
            pickle.dump(Call("number", (self._number,), None, None), file)
        if name == "started":
            self.timers.clear()
        self.told = 1
        error: Exception | None = None
        answer: Any = None
        try:
            answer = method(self, *given)
        except Exception as raised:
            error = raised
        self.told = 0
        if name == "timer_ended":
            take_ended(self.timers, given)
        perform(self.timers, answer)
        came = came_of(answer if name != "prepare" else prepared_as(answer), error)
        pickle.dump(Call(name, tuple(map(plain, given)), came, self.timers.next_s), file)
        if error is not None:
            raise error
        return answer

    return recorded


# ------------------------------------------------------------------------- in plain words


def load() -> None:
    """Import the modules of all drivers."""
    for module in DRIVERS.values():
        import_module(module)


def modules() -> list[Any]:
    """Return all modules of the gateway and its drivers."""
    roots = ("protocol_gateway", "controllers")
    return [each for name, each in sys.modules.items() if name.partition(".")[0] in roots]


def constants() -> dict[tuple[str, str], float | str]:
    """Return the numbers and texts that tests may change, by the names of their module and their own."""
    return {
        (each.__name__, name): value
        for each in modules()
        for name, value in vars(each).items()
        if name.isupper() and type(value) in (int, float, str)
    }


def set_constants(values: Mapping[tuple[str, str], float | str]) -> None:
    """Give modules these numbers and texts; a module may be in another folder, or have another name, now."""
    for (module, name), value in values.items():
        found = [each for each in modules() if each.__name__ == module and hasattr(each, name)] or [
            each
            for each in modules()
            if each.__name__.split(".")[-2:-1] == module.split(".")[-2:-1] and hasattr(each, name)
        ]
        for each in found:
            setattr(each, name, value)


def channel(name: str) -> Any:
    """Return the channel of a name."""
    channels = [value for each in modules() for value in vars(each).values() if isinstance(value, Channel)]
    return next(each for each in channels if each.name == name)


def facts(driver: Any) -> str:
    """Return what a driver says of itself."""
    return ordered(repr((driver.capabilities, driver.requests_a_second)))


def ordered(text: str) -> str:
    """Return a text with its sets in one order, and its classes without modules."""
    text = re.sub(r"<class '[\w.]*\.(\w+)'>", r"\1", text)
    return re.sub(r"\{([^{}]*)\}", lambda each: "{" + ", ".join(sorted(each[1].split(", "))) + "}", text)


def plain(given: Any) -> Any:
    """Return an argument, a channel as its name."""
    return ("channel", given.name) if hasattr(given, "carries") else given


def perform(timers: Timers, effects: Any) -> None:
    """Set and clear timers by effects."""
    for each in effects if isinstance(effects, list | tuple) else ():
        if isinstance(each, SetTimer):
            timers.set(each)


def take_ended(timers: Timers, given: Sequence[Any]) -> dict[str, float]:
    """Take the timers that a call of `timer_ended` is given; once they had no names."""
    if len(given) == 1:
        return timers.take(given[0])
    return {name: timers.pop(name) for name in given[0] if name in timers}


def prepared_as(answer: Any) -> Any:
    """Return what a driver has prepared, in plain words unless it is bytes."""
    return answer if isinstance(answer, bytes | None) else repr(answer)


def came_of(answer: Any, error: Exception | None) -> Any:
    """Return effects, a value or an error in plain words."""
    if error is not None:
        return (type(error).__name__, str(error))
    if not isinstance(answer, list | tuple):
        return answer if isinstance(answer, bytes | str | None) else repr(answer)
    return [_effect(each) for each in answer if not isinstance(each, SetTimer)]


def _effect(effect: Any) -> Any:
    match effect:
        case Open(channel, port, settings):
            # A program may be in another folder now.
            shown = re.sub(r"program='[\w.]*\.(\w+\.\w+)'", r"program='\1'", repr(channel))
            return ("open", shown, port, settings)
        case Close(channel, why):
            return ("close", channel.name, why)
        case Send(channel, data, alternative):
            return ("send", channel.name, data, alternative)
        case Report(events, units, refusals, asked_s, lost):
            return ("report", [repr(each) for each in events], units, refusals, asked_s, lost)
        case FateUnknown(why):
            return ("fate unknown", repr(why))
    raise TypeError(effect)


# ------------------------------------------------------------------------------ replay


class _Unpickler(pickle.Unpickler):
    """Finds classes by their names, in whatever module they are now."""

    def find_class(self, module: str, name: str) -> Any:
        with suppress(ImportError, AttributeError):
            return super().find_class(module, name)
        for each in modules():
            if hasattr(each, name):
                return getattr(each, name)
        raise LookupError(f"{module}.{name}")


def entries(path: Path) -> Iterator[Any]:
    """Yield what a transcript has; one of a process that was killed ends early."""
    with gzip.open(path, "rb") as file, suppress(EOFError):
        while True:
            yield _Unpickler(file).load()


def replay(folder: Path) -> bool:
    """Repeat the calls of each driver; print what differs, and return whether nothing does."""
    equal: Counter[str] = Counter()
    calls: Counter[str] = Counter()
    different: Counter[str] = Counter()
    load()
    normal = constants()
    for path in sorted(folder.glob("*.gz")):
        name = path.name.partition("-")[0]
        problem, count = difference(entries(path))
        set_constants(normal)
        calls[name] += count
        (different if problem else equal)[name] += 1
        if problem:
            print(f"{path.name}: {problem}")
    for name in DRIVERS:
        print(
            f"{name:17} {calls[name]:9,} calls, {equal[name]} transcripts equal, {different[name]} different"
        )
    return not different


def difference(recorded: Iterator[Any]) -> tuple[str, int]:
    """Return the first difference of a driver from its transcript, or an empty text, and the calls."""
    name, joint_types, codes, options, changed, test = next(recorded)
    set_constants(changed)
    driver = getattr(import_module(DRIVERS[name]), name)(joint_types, codes, options=options)
    if (says := facts(driver)) != (was := next(recorded)):
        return f"{test}\n  was {was}\n  is  {says}", 0
    channels: dict[str, Any] = {}
    prepared: dict[Any, Any] = {}
    timers, forgotten_s = Timers(), None
    place = 0
    for place, call in enumerate(recorded):
        if call.name == "number":
            driver._number = call.given[0]
            continue
        for each in filter(_is_channel, call.given):
            channels[each[1]] = channels.get(each[1]) or channel(each[1])
        given = [channels[each[1]] if _is_channel(each) else each for each in call.given]
        if call.name == "timer_ended":
            given = [take_ended(timers, given), given[-1]]
        if call.name == "started":
            timers.clear()
        if call.name == "command":
            given[0] = prepared.get(given[0], given[0])
        error: Exception | None = None
        answer: Any = None
        try:
            answer = getattr(driver, _NEW_NAMES.get(call.name, call.name))(*given)
        except Exception as raised:
            error = raised
        effects = answer
        if call.name == "prepare" and error is None:
            answer = prepared_as(answer)
        elif call.name == "encode" and error is None and isinstance(call.came, bytes):
            # It was bytes of any form then, and is what the driver prepares now.
            prepared[call.came], answer = answer, call.came
        for each in answer if isinstance(answer, list | tuple) else ():
            if isinstance(each, Open):
                # OPC UA's is new for each driver.
                channels[each.channel.name] = each.channel
        perform(timers, effects)
        if call.name == "started" and timers.next_s is None:
            # Of the version before named timers, it was recorded as if it went on.
            forgotten_s = call.timer_s
        went_on = timers.next_s is None and call.timer_s == forgotten_s
        timer_s = call.timer_s if went_on else timers.next_s
        is_now = Call(call.name, call.given, came_of(answer, error), timer_s)
        if is_now != call:
            return f"{test} call {place}: {call.name}{call.given}\n  was {call}\n  is  {is_now}", place
    return "", place + 1


def _is_channel(given: Any) -> bool:
    return isinstance(given, tuple) and len(given) == 2 and given[0] == "channel"


if __name__ == "__main__":
    main()
