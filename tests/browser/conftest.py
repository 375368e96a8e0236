"""A whole site in one thread (router, controller, gateway, kinematics, console) and a Chromium before it."""

import asyncio
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import zenoh

from bus.endpoints import router_config
from bus.session import Session, SessionSettings, open_session
from protocol_gateway import gateway
from protocol_gateway.robot import RobotSettings
from services.console import build_page, console
from services.kinematics import kinematics
from services.simulator import simulator
from tests.conftest import free_port

CHROMIUM = Path("/usr/bin/chromium")
ARGUMENTS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
STARTED_S = 60.0


@dataclass
class Plant:
    """A running site.

    Attributes:
        address: Of the console.
        session: A session of the tests' own on the mesh; use it in the plant's thread, by `call`.
    """

    audit: Path
    robots: tuple[str, ...] = ("arm", "pt600")
    address: str = ""
    loop: asyncio.AbstractEventLoop = field(default_factory=asyncio.new_event_loop)
    session: Session | None = None
    controllers: dict = field(default_factory=dict)
    _end: asyncio.Event = field(default_factory=asyncio.Event)
    _started: threading.Event = field(default_factory=threading.Event)

    def call(self, work):
        """What a coroutine returns, run in the plant's thread."""
        return asyncio.run_coroutine_threadsafe(work, self.loop).result(20)

    def start_controller(self, name, port=0, **settings):
        async def start():
            said = self.loop.create_future()
            settings_ = simulator.Settings(robot="pt600", listen=f"127.0.0.1:{port}", **settings)
            task = self.loop.create_task(simulator.serve(settings_, ready=said.set_result))
            await asyncio.wait([said, task], return_when=asyncio.FIRST_COMPLETED)
            self.controllers[name] = (task, int((await said).rpartition(":")[2]))

        return start()

    async def stop_controller(self, name):
        task, port = self.controllers.pop(name)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return port

    async def _run(self):
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        mesh = SessionSettings(connect=(endpoint,), wait_s=5.0)
        with zenoh.open(router_config((endpoint,))):
            await self.start_controller("arm")
            await self.start_controller("pt600", demo=True)
            async with (
                open_session(mesh) as self.session,
                open_session(mesh) as for_gateway,
                open_session(mesh) as for_kinematics,
                open_session(mesh) as for_console,
            ):
                for robot in self.robots:
                    for_gateway.declare_presence("hall", robot, "gateway")
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
                                    kinematics.RobotSettings(name=name, model="pt600", simulated=True)
                                    for name in self.robots
                                ),
                            ),
                        ),
                        console.serve(
                            for_console,
                            console.Settings(site="hall", listen="127.0.0.1:0"),
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
def plant(tmp_path_factory) -> Iterator[Plant]:
    """A site `hall` with two arms: `arm` rests, `pt600` moves by itself."""
    if not CHROMIUM.exists():
        pytest.skip(f"no {CHROMIUM}: the page is not driven here")
    build_page.build()
    running = Plant(audit=tmp_path_factory.mktemp("audit"))
    thread = threading.Thread(target=running.run, name="plant")
    thread.start()
    try:
        running.wait_started()
        yield running
    finally:
        if running.address:
            running.end()
        thread.join(20)


@pytest.fixture(scope="module")
def chromium(plant):
    """A headless Chromium that draws 3-D in software."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture
def open_page(chromium, plant):
    """Opens the page at a robot (or the fleet), and at the end checks that nothing went wrong in it."""
    contexts, wrong = [], []

    def open_one(path="", width=1440, height=900, **settings):
        context = chromium.new_context(
            viewport={"width": width, "height": height}, locale="en-GB", color_scheme="dark", **settings
        )
        context.set_default_timeout(20_000)
        page = context.new_page()
        page.on("pageerror", lambda error: wrong.append(f"error: {error}"))
        page.on(
            "console",
            lambda line: wrong.append(f"{line.type}: {line.text}") if line.type == "error" else None,
        )
        page.on(
            "request",
            lambda request: (
                None
                if request.url.startswith((plant.address, "blob:", plant.address.replace("http", "ws")))
                else wrong.append(f"asked elsewhere: {request.url}")
            ),
        )
        page.goto(f"{plant.address}/{path}")
        contexts.append(context)
        return page

    yield open_one
    for context in contexts:
        context.close()
    assert wrong == []
