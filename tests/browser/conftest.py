"""A whole site in one thread (router, controller, gateway, kinematics, console) and a Chromium before it."""

import asyncio
import os
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import pytest
import zenoh

from controllers.simulated.fault_requests import Mesh
from controllers.unit.simulated import service as simulator
from protocol_gateway import gateway
from protocol_gateway.configuration.settings import RobotSettings
from robomesh.contract.endpoints import router_config
from robomesh.contract.keys import WHOLE_SITE
from robomesh.contract.messages import reason_message
from robomesh.schemas.robomesh_pb2 import Event
from robomesh.wire.session import Session, SessionSettings, open_session
from robots.descriptions.cells import Fixture
from services.console import app
from services.console.websocket import shared_subscriptions
from services.kinematics import kinematics
from services.watch import watch
from tests.cells import single_arm
from tests.patience import be_patient
from tests.ports import free_port
from web import build_page

CHROMIUM = Path("/usr/bin/chromium")
PATIENCE_MS = 60_000
LAUNCH_MS = 180_000  # a browser start next to four busy processes
# Address bar suggestions cost two more processes for each page, and a third waits for the next page.
# Chromium uses the last list only, so this one repeats Playwright's features that could matter here.
WITHOUT = (
    *("WebUIOmniboxPopup", "WebUIOmniboxAimPopup", "SpareRendererForSitePerProcess"),
    *("HttpsUpgrades", "PaintHolding", "OptimizationHints"),
)
ARGUMENTS = [
    "--no-sandbox",
    # Only 3-D is drawn as a graphics processor would: of the page itself that costs more than plain drawing.
    "--use-angle=swiftshader-webgl",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-rasterization",  # which Debian asks for
    f"--disable-features={','.join(WITHOUT)}",
]
STARTED_S = 60.0
NO_WEBGL = """
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return kind.startsWith("webgl") ? null : getContext.call(this, kind, ...rest);
};
"""


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    """Skip each test of a browser where there is none, before its site starts."""
    if item.get_closest_marker("browser") and not CHROMIUM.exists():
        pytest.skip(f"no {CHROMIUM}: the page is not driven here")


@dataclass
class Plant:
    """A running site.

    Attributes:
        fixtures: The obstacles around each arm.
        console: Settings of the console except its address.
        address: Address of the console.
        endpoint: Endpoint of the router.
        rate_hz: States a second of each arm: enough to see it move, and cheaper than the 100 of real ones.
        exact_leases: Leases last as long as the page asks; otherwise 10 s, for a busy machine.
        session: The tests' session on the mesh; use it in the plant's thread, by `call`.
    """

    audit: Path
    fixtures: tuple[Fixture, ...] = ()
    robots: tuple[str, ...] = ("arm", "pt600")
    console: dict = field(default_factory=dict)
    rate_hz: float = 10.0
    address: str = ""
    endpoint: str = field(default_factory=lambda: f"tcp/127.0.0.1:{free_port()}")
    exact_leases: bool = False
    loop: asyncio.AbstractEventLoop = field(init=False)
    session: Session | None = None
    controllers: dict = field(default_factory=dict)
    _end: asyncio.Event = field(default_factory=asyncio.Event)
    _started: threading.Event = field(default_factory=threading.Event)

    def call(self, work):
        """Run a coroutine in the plant's thread and return its result."""
        return asyncio.run_coroutine_threadsafe(work, self.loop).result(60)

    @contextmanager
    def standing_still(self):
        """Block the site's event loop during the block."""
        go_on = threading.Event()
        self.loop.call_soon_threadsafe(go_on.wait)
        try:
            yield
        finally:
            go_on.set()

    def start_controller(self, name, port=0, **settings):
        async def start():
            address = self.loop.create_future()
            settings_ = simulator.Settings(
                robot="pt600", listen=f"127.0.0.1:{port}", **{"rate_hz": self.rate_hz, **settings}
            )
            task = self.loop.create_task(simulator.serve(settings_, ready=address.set_result))
            await asyncio.wait([address, task], return_when=asyncio.FIRST_COMPLETED)
            self.controllers[name] = (task, int((await address).rpartition(":")[2]))

        return start()

    async def stop_controller(self, name):
        task, port = self.controllers.pop(name)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return port

    async def _run(self):
        mesh = SessionSettings(connect=(self.endpoint,), wait_s=5.0)
        with zenoh.open(router_config((self.endpoint,))):
            await self.start_controller("arm", mesh=Mesh(site="hall", robot="arm", session=mesh))
            if "pt600" in self.robots:
                await self.start_controller("pt600", demo=True)
            async with (
                open_session(mesh) as self.session,
                open_session(mesh) as for_gateway,
                open_session(mesh) as for_kinematics,
                open_session(mesh) as for_console,
            ):
                for robot in self.robots:
                    for_gateway.declare_presence("hall", robot, "gateway")
                    for_kinematics.declare_presence("hall", robot, "kinematics")
                ready = self.loop.create_future()
                tasks = [
                    self.loop.create_task(work)
                    for work in (
                        gateway.serve(
                            for_gateway,
                            gateway.Settings(
                                site="hall",
                                audit_folder=self.audit,
                                robots=tuple(
                                    RobotSettings(
                                        name=name,
                                        description="pt600",
                                        host="127.0.0.1",
                                        port=self.controllers[name][1],
                                        stop_proven=True,
                                        stale_after_s=5.0,  # a busy machine stands still for seconds
                                        reconnect_after_s=10.0,
                                    )
                                    for name in self.robots
                                ),
                            ),
                        ),
                        kinematics.serve(
                            for_kinematics,
                            kinematics.Settings(
                                site="hall",
                                robots=tuple(
                                    single_arm(name, simulated=True, fixtures=self.fixtures)
                                    for name in self.robots
                                ),
                            ),
                        ),
                        app.serve(
                            for_console,
                            app.Settings(site="hall", listen="127.0.0.1:0", **self.console),
                            on_ready=ready.set_result,
                        ),
                    )
                ]
                done, _ = await asyncio.wait([ready, *tasks], return_when=asyncio.FIRST_COMPLETED)
                for task in done - {ready}:
                    task.result()
                self.address = ready.result()
                self._started.set()
                await self._end.wait()
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
            for name in tuple(self.controllers):
                await self.stop_controller(name)

    def run(self):
        self.loop = asyncio.new_event_loop()
        try:
            self.loop.run_until_complete(self._run())
        finally:
            self._started.set()
            self.loop.run_until_complete(self.loop.shutdown_default_executor())
            self.loop.close()

    def wait_started(self):
        assert self._started.wait(STARTED_S), "the site did not start"
        assert self.address, "the site ended as it started: its traceback is above"

    def end(self):
        self.loop.call_soon_threadsafe(self._end.set)


@pytest.fixture(scope="module")
def plant(request, tmp_path_factory) -> Iterator[Plant]:
    """Yield a site `hall` of two arms among a module's FIXTURES: `arm` rests, `pt600` moves.

    If a module sets ROBOTS, the site has only those robots; with EXACT_LEASES, leases are as short as asked.
    """
    of_module = {
        name: getattr(request.module, name.upper())
        for name in ("fixtures", "robots", "exact_leases")
        if hasattr(request.module, name.upper())
    }
    yield from run_plant(Plant(audit=tmp_path_factory.mktemp("audit"), **of_module))


def run_plant(running: Plant) -> Iterator[Plant]:
    """Run a plant for as long as a fixture lasts."""
    # A page must not receive the messages of another test.
    shared_subscriptions._LINGER_S = 0.0
    build_page.build()
    thread = threading.Thread(target=running.run, name="plant")
    with pytest.MonkeyPatch.context() as patched:
        if not running.exact_leases:
            be_patient(patched.setattr)
        thread.start()
        try:
            running.wait_started()
            yield running
        finally:
            if running.address:
                running.end()
            thread.join(60)


@pytest.fixture(scope="session", autouse=True)
def patient():
    """Wait for a page as long as a busy machine needs: the default of 5 s is too short."""
    from playwright.sync_api import expect

    expect.set_options(timeout=PATIENCE_MS)


class SharedChromium:
    """One headless Chromium for all modules of a worker, since each start costs a second of the processor.

    It draws 3-D in software. Playwright's event loop is this thread's running loop only within `driven`, so
    that tests without a browser may run a loop of their own.
    """

    def __init__(self, playwright):
        self._launch = partial(
            playwright.chromium.launch,
            executable_path=str(CHROMIUM),
            args=ARGUMENTS,
            timeout=LAUNCH_MS,
            # In the locale C it opens no file if the path has letters beyond ASCII.
            env={**os.environ, "LC_ALL": "C.UTF-8"},
        )
        self._browser = self._launch()
        self._loop = asyncio.get_running_loop()
        asyncio._set_running_loop(None)

    @contextmanager
    def driven(self):
        """Yield the browser, started again if it crashed; close its contexts at the end."""
        asyncio._set_running_loop(self._loop)
        try:
            if not self._browser.is_connected():
                self._browser = self._launch()
            yield self._browser
            for context in self._browser.contexts:
                context.close()
        finally:
            asyncio._set_running_loop(None)


@pytest.fixture(scope="session")
def shared_chromium():
    """Yield the Chromium of this worker."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        shared = SharedChromium(playwright)
        yield shared
        with shared.driven() as browser:
            browser.close()
        asyncio._set_running_loop(shared._loop)  # Playwright ends in it


@pytest.fixture(scope="module")
def chromium(plant, shared_chromium):
    """Yield Chromium; its contexts end before the site does."""
    with shared_chromium.driven() as browser:
        yield browser


@pytest.fixture
def new_context(chromium):
    """Yield a function that makes a browser context, which ends with the test.

    To clear a context for the next test costs more than a new one.
    """
    made = []

    def new(**settings):
        context = chromium.new_context(**{"locale": "en-GB", "color_scheme": "dark", **settings})
        context.set_default_timeout(PATIENCE_MS)  # a click waits until nothing moves below it
        made.append(context)
        return context

    yield new
    for context in made:
        context.close()


@pytest.fixture
def open_page(new_context, plant):
    """Open the page at a robot (or the fleet), and check at the end that no error occurred in it.

    `drawn=False`: without 3-D, which the processor draws here, so that several pages at once have time
    to renew their leases. `refused=True`: the console refuses something, which a browser takes for an error.
    `script`: runs in the page before its own scripts do.
    """
    wrong = []

    def open_one(path="", width=1440, height=900, drawn=True, refused=False, script="", **settings):
        page = new_context(**settings).new_page()
        page.set_viewport_size({"width": width, "height": height})
        page.on("pageerror", lambda error: wrong.append(f"error: {error}"))
        page.on(
            "console",
            # 503, 504: a service that is starting or busy did not answer yet; the page asks it again.
            lambda line: (
                wrong.append(f"{line.type}: {line.text} {line.location.get('url', '')}")
                if line.type == "error" and not re.search("status of 50[34] ", line.text) and not refused
                else None
            ),
        )
        page.on(
            "request",
            lambda request: (
                None
                if request.url.startswith((plant.address, "blob:", plant.address.replace("http", "ws")))
                else wrong.append(f"asked elsewhere: {request.url}")
            ),
        )
        if not drawn:
            page.add_init_script(NO_WEBGL)
        page.add_init_script(script)
        page.goto(f"{plant.address}/{path}")
        return page

    yield open_one
    assert wrong == []


@pytest.fixture(scope="module")
def raised(plant, tmp_path_factory):
    """Publish an event of the arm that a watch of the plant receives."""
    folder = tmp_path_factory.mktemp("watch")

    async def start():
        task = plant.loop.create_task(watch.serve(plant.session, watch.Settings(site="hall", folder=folder)))
        assert await plant.session.last(f"robomesh/hall/{WHOLE_SITE}/alarms", timeout_s=40) is not None
        return task, plant.session.declare_publisher("hall", "arm", "events/recorder")

    async def end(task):
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    async def publish(publisher, code, text, severity, reason, values):
        event = Event(code=code, text=text, severity=severity, source="recorder", values=values)
        if reason is not None:
            event.reason.CopyFrom(reason_message(reason))
        event.timestamp.GetCurrentTime()
        publisher.put(event)

    task, publisher = plant.call(start())
    yield lambda code, text, severity=Event.WARNING, reason=None, **values: plant.call(
        publish(publisher, code, text, severity, reason, values)
    )
    plant.call(end(task))
