"""Shared fixtures of all tests: a router for each test, sessions, reference files, `--quick`."""

import asyncio
import gc
import importlib.util
import inspect
import logging
import sys
import time
from collections import Counter
from collections.abc import Coroutine, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest
import zenoh
from google.protobuf.message import Message
from hypothesis import HealthCheck, settings

from robomesh.contract.endpoints import router_config
from robomesh.contract.header import Header
from robomesh.publications.publisher import Publisher
from robomesh.wire.session import Session, SessionSettings
from tests import distribution
from tests.ports import free_port

T = TypeVar("T")

# A test must not depend on the machine's speed.
settings.register_profile("robomesh", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("robomesh")

SHARED = Path(__file__).resolve().parents[2] / "shared"


def run(main: Coroutine[Any, Any, T], *, timeout_s: float = 120.0) -> T:
    """Run a test's coroutine, with a deadline."""

    async def with_deadline() -> T:
        async with asyncio.timeout(timeout_s):
            return await main

    return asyncio.run(with_deadline())


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Run a test that is a coroutine function, with a deadline."""
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    arguments = inspect.signature(pyfuncitem.obj).parameters
    run(pyfuncitem.obj(**{name: pyfuncitem.funcargs[name] for name in arguments}), timeout_s=240.0)
    return True


def rest_is_long(count: int, values: Iterable[Any]) -> list[Any]:
    """Return a test's parameters; those after the first `count` belong to `./dev test --long`."""
    marks = ([], [pytest.mark.long])
    return [pytest.param(each, marks=marks[at >= count]) for at, each in enumerate(values)]


async def last_value(session: Session, key: str) -> Any:
    """Return the last value of a key; ask again where a busy machine did not answer in time."""
    while (value := await session.last(key)) is None:
        pass
    return value


def put_unheard(publisher: Publisher, message: Message) -> None:
    """Publish a message without a subscriber, as in an outage; only the publisher's history has it."""
    publisher._sequence += 1
    header = Header(publisher._identity, publisher._sequence, time.time_ns())
    publisher._history.append((header, message.SerializeToString()))


@pytest.fixture(autouse=True)
def _log_levels() -> Iterator[None]:
    """Restore the log levels and handlers that a command in the test's process changed."""
    levels = [(logger, logger.level) for logger in (logging.root, logging.getLogger("robomesh"))]
    handlers = [*logging.root.handlers]
    yield
    for handler in {*logging.root.handlers} - {*handlers}:
        logging.root.removeHandler(handler)
    for logger, level in levels:
        logger.setLevel(level)


@pytest.fixture
def router() -> Iterator[str]:
    """Yield the endpoint of a running router for this test."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with zenoh.open(router_config((endpoint,))):
        yield endpoint


@pytest.fixture
def mesh(router: str) -> SessionSettings:
    """Return session settings for this test's router."""
    return SessionSettings(connect=(router,), wait_s=5.0)


@pytest.fixture(scope="session")
def shared() -> Path:
    """Return the folder of reference files next to the checkout."""
    if not SHARED.is_dir():
        pytest.skip("the reference files (../shared) are not beside this checkout")
    return SHARED


def pytest_collection_finish() -> None:
    """Keep everything that is loaded out of garbage collections from here on.

    Services collect, freeze and thaw all objects of their process. In a process with all test modules a
    gateway's start would take 0.3 s for that.
    """
    gc.collect()
    gc.freeze()
    gc.freeze = gc.unfreeze = lambda: None
    gc.enable()


# ---------------------------------------------------- distribution to workers


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    if config.getoption("dist") != "loadfile":
        return None
    config.option.loadscopereorder = False  # by the number of tests
    return distribution.GroupScheduling(config, log)


_took_s: Counter[str] = Counter()


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    _took_s[distribution.group(report.nodeid)] += report.duration


def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.config.getoption("--keep-durations") and not hasattr(session.config, "workerinput"):
        distribution.keep(_took_s)


needs_eaik = pytest.mark.skipif(
    importlib.util.find_spec("eaik") is None, reason="eaik is not installed: it has no wheel for this Python"
)

# ------------------------------------------------------------------------ --quick

# Tests that `--quick` omits, in words, by marker or fixture; the first match counts.
LEFT_OUT = {
    "long": "belong to ./dev test --long",
    "browser": "drive the page in a browser",
    "processes": "start a whole site of processes",
    "slow": "start processes, or take more than 0.4 s",
    "router": "exchange messages over a router",
}
_left_out: Counter[str] = Counter()
_in_quick_test = False


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--quick", action="store_true", help="run only what needs no browser and no process")
    parser.addoption("--keep-durations", action="store_true", help="write tests/durations.json")


def pytest_configure(config: pytest.Config) -> None:
    gc.disable()  # modules and items are no garbage; `pytest_collection_finish` enables it
    sys.addaudithook(_no_process)
    if config.getoption("--quick"):
        settings.register_profile("quick", settings.get_profile("robomesh"), max_examples=20)
        settings.load_profile("quick")


def _no_process(event: str, arguments: object) -> None:
    """Refuse a process that a quick test starts."""
    if not _in_quick_test or event not in ("subprocess.Popen", "os.fork", "os.posix_spawn"):
        return
    # Outcomes of a pair study, places of libraries and fonts are cached: only the first test needs a process.
    if not any(each in str(arguments) for each in ("robots.bodies.pair_study", "ldconfig", "fc-list")):
        raise AssertionError("this test starts a process: mark it `slow`")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    global _in_quick_test
    _in_quick_test = why_left_out(item) is None
    try:
        return (yield)
    finally:
        _in_quick_test = False


def why_left_out(item: pytest.Item) -> str | None:
    """Return the row of LEFT_OUT that a test has; None: it is quick."""
    has = {mark.name for mark in item.iter_markers()} | set(getattr(item, "fixturenames", ()))
    return next((why for why in LEFT_OUT if why in has), None)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    items.sort(key=distribution.place)
    if not config.getoption("--quick"):
        return
    kept, dropped = [], []
    for item in items:
        if why := why_left_out(item):
            _left_out[why] += 1
            dropped.append(item)
        else:
            kept.append(item)
    items[:] = kept
    config.hook.pytest_deselected(items=dropped)
    if hasattr(config, "workeroutput"):
        config.workeroutput["left_out"] = dict(_left_out)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    # Every worker has collected the same.
    _left_out.update(Counter(getattr(node, "workeroutput", {}).get("left_out", {})) - _left_out)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    reasons = Counter(
        report.longrepr[2].removeprefix("Skipped: ") for report in terminalreporter.getreports("skipped")
    )
    if (cache := getattr(config, "cache", None)) is not None:  # `-p no:cacheprovider` removes it
        cache.set("robomesh/skipped", reasons)
    if config.getoption("--quick"):
        words = ", ".join(f"{count} that {LEFT_OUT[why]}" for why, count in _left_out.items())
        terminalreporter.write_line(f"--quick left out {_left_out.total()} tests: {words or 'none'}")
