"""Invalid names from a plain client: every service ignores them, and continues."""

import asyncio
import contextlib
import json
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
import zenoh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from websockets.asyncio.client import connect

import renderer.service
from protocol_gateway import gateway
from renderer.errors import RendererError
from robomesh.contract.endpoints import bundle, client_config, router_config
from robomesh.contract.header import Header, pack
from robomesh.contract.keys import parse_key
from robomesh.contract.topics import REQUESTS, TOPICS, Role
from robomesh.errors import KeyNameError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.service.health import Served, present
from robomesh.wire.session import SessionSettings, open_session
from services import kinematics, player
from services.command_line.watch.listing import _Clocks, _collect
from services.console import app
from services.foxglove import server as foxglove
from services.pki import Folder, site_keys
from services.recorder import recorder
from services.ros2 import service as ros2
from services.router.router import read_access
from services.watch import watch
from tests.cells import single_arm
from tests.ports import free_port
from tests.renderer.bodies import context_or_skip
from tests.renderer.renderer_site import shared_shapes

pytestmark = pytest.mark.slow

SITE = "hall"
WITHIN_S = 60.0


@dataclass(
    repr=False
)  # a session's settings fill pages, and Hypothesis warns of that in place of its finding
class Site:
    """All services of a site in one event loop, in a thread, and a plain client without checks."""

    loop: asyncio.AbstractEventLoop
    services: dict
    plain: zenoh.Session
    observer: object
    console: str = ""
    foxglove: asyncio.Task | None = None

    def call(self, coroutine):
        return asyncio.run_coroutine_threadsafe(coroutine, self.loop).result(WITHIN_S)

    async def everything_goes_on(self):
        """Check that every service answers, and that a new client sees the site unchanged."""
        assert not self.foxglove.done(), self.foxglove
        for name, (task, session) in self.services.items():
            assert not task.done(), (name, task)
            key = f"robomesh/{SITE}/-/clock/{session.identity}"
            answer = await self.observer.ask(key, schema.ClockRequest(), timeout_s=WITHIN_S)
            assert isinstance(answer, schema.ClockAnswer), name

    async def greeting(self):
        """Return the services whose presence a newly loaded page receives."""
        present = set()
        async with (
            asyncio.timeout(WITHIN_S),
            connect(f"ws://{self.console}/mesh", origin=f"http://{self.console}") as socket,
        ):
            while not present >= set(self.services):
                message = schema.ToPage.FromString(await socket.recv())
                if message.HasField("presence"):
                    present.add(message.presence.key.split("/")[4])
        return present

    async def listed(self):
        return await _collect(self.observer, _Clocks())


def site_settings(folder: Path) -> dict:
    """Return each service's coroutine and settings."""
    robot = gateway.RobotSettings(name="arm", description="pt600", host="127.0.0.1", port=free_port())
    return {
        "gateway": (
            gateway.serve,
            gateway.Settings(site=SITE, audit_folder=folder / "audit", robots=(robot,)),
        ),
        "kinematics": (
            kinematics.serve,
            kinematics.Settings(site=SITE, robots=(single_arm(simulated=True),)),
        ),
        "recorder": (
            recorder.serve,
            recorder.Settings(site=SITE, robots=("arm",), folder=folder / "mcap"),
        ),
        "player": (player.serve, player.Settings(site=SITE, folder=folder / "mcap")),
        "watch": (watch.serve, watch.Settings(site=SITE, folder=folder / "watch")),
        "renderer": (
            renderer.service.serve,
            renderer.service.Settings(site=SITE, size=(160, 90), folder=shared_shapes(folder)),
        ),
        "ros2": (ros2.serve, ros2.Settings(site=SITE, shapes=folder / "meshes")),
    }


@contextlib.asynccontextmanager
async def services_of(folder: Path, mesh_of, site: Site):
    """Yield all services, present on the mesh."""
    wanted = site_settings(folder)
    try:
        context_or_skip().release()
    except (RendererError, pytest.skip.Exception):
        del wanted["renderer"]
    async with contextlib.AsyncExitStack() as stack:

        async def begin(name, serve, *arguments, **more):
            session = await stack.enter_async_context(open_session(mesh_of(name)))
            served = Served(service=name, present_for=((SITE, "arm" if name == "gateway" else "-"),))
            await stack.enter_async_context(present(session, served))
            task = asyncio.create_task(serve(session, *arguments, **more))
            stack.push_async_callback(asyncio.gather, task, return_exceptions=True)
            stack.callback(task.cancel)
            site.services[name] = task, session

        for name, (serve, its_settings) in wanted.items():
            await begin(name, serve, its_settings)
        page = folder / "page"
        page.mkdir()
        (page / "index.html").write_text("<!doctype html><title>page</title>")
        listening = asyncio.get_running_loop().create_future()
        its_settings = app.Settings(site=SITE, listen="127.0.0.1:0", page=page)
        await begin("console", app.serve, its_settings, on_ready=listening.set_result)
        site.console = (await asyncio.wait_for(listening, WITHIN_S)).removeprefix("http://")
        # The bridge to Foxglove is a program of a person's: it has a monitor's certificate.
        session = await stack.enter_async_context(open_session(mesh_of("foxglove")))
        its_settings = foxglove.Settings(listen="127.0.0.1:0", site=SITE)
        task = asyncio.create_task(foxglove.serve(session, its_settings, on_ready=lambda _: None))
        stack.push_async_callback(asyncio.gather, task, return_exceptions=True)
        stack.callback(task.cancel)
        site.foxglove = task
        site.observer = await stack.enter_async_context(open_session(mesh_of("observer")))
        yield


@pytest.fixture(scope="module", params=["without keys", "with keys"])
def site(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    if request.param == "with keys":
        keys = Folder(folder / "keys")
        site_keys.prepare(keys, SITE, robots=["arm"], border="open", routers=[])
        site_keys.issue(keys, "li", Role.OPERATOR)
        site_keys.issue(keys, "mo", Role.MONITOR)
        endpoint = f"tls/127.0.0.1:{free_port()}"
        router = zenoh.open(router_config((endpoint,), (), keys.tls_of("router"), read_access(keys.access)))
        files = {"observer": keys.person("mo"), "foxglove": keys.person("mo"), "plain": keys.person("li")}

        def tls_of(name):
            return bundle(files.get(name) or keys.service(name))
    else:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        router = zenoh.open(router_config((endpoint,)))

        def tls_of(name):
            return None

    def mesh_of(name):
        return SessionSettings(connect=(endpoint,), tls=tls_of(name), wait_s=20.0)

    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    config = client_config((endpoint,), tls_of("plain"))
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    plain = zenoh.open(config)
    site = Site(loop, {}, plain, None)
    running = services_of(folder, mesh_of, site)
    try:
        site.call(running.__aenter__())
        try:
            yield site
        finally:
            site.call(running.__aexit__(None, None, None))
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
        plain.close()
        router.close()


# ------------------------------------------------------------------------ keys

# Zenoh's chunks exclude these characters; hostile chunks occur more often than Hypothesis finds them.
_ODD = [
    "EV IL",
    "\u202egnp.mra",
    "x" * 5000,
    "ARM",
    ".",
    "..",
    "-",
    "é",
    "a\nb",
    "a\x1b[2J",
    "@",
    "_",
    "*",
    "**",
    "$*a",
]
CHUNK = st.sampled_from([*_ODD, SITE, "arm"]) | st.text(min_size=1, max_size=12).filter(
    lambda text: not set(text) & set("/#?$*")
)
NAMES = sorted({*TOPICS, *REQUESTS, "alive/gateway/*", "alive/operator/*", "alive/*/*", "health/*"})


@st.composite
def odd_keys(draw):
    """Return a key of the mesh's form with an invalid chunk, or any other key."""
    name = "/".join(draw(CHUNK) if each == "*" else each for each in draw(st.sampled_from(NAMES)).split("/"))
    key = f"robomesh/{draw(CHUNK)}/{draw(CHUNK)}/{name}"
    try:
        zenoh.KeyExpr(key)
        parse_key(key)
    except KeyNameError:
        return key
    except zenoh.ZError:
        pass
    return f"robomesh/{SITE}/EV IL/alive/gateway/x"


def say(plain, key, payload):
    """Use a key in every way that a plain client can; declarations last for a moment."""
    header = pack(Header(7, 1, time.time_ns()))
    with contextlib.ExitStack() as held:

        def reply(query):
            with query, contextlib.suppress(zenoh.ZError):
                query.reply(str(query.key_expr) if "*" not in str(query.key_expr) else key, payload)

        held.callback(plain.liveliness().declare_token(key).undeclare)
        held.callback(plain.declare_queryable(key, reply).undeclare)
        plain.put(key, payload, attachment=header)
        plain.put(key, payload)
        list(plain.get(key, payload=payload, timeout=0.05))


# The services run in another thread and use `random` (a reconnect's delay, a WebSocket's ping). Hypothesis
# compares the module's state before and after each draw, and takes such a use for one by the strategy.
@pytest.mark.filterwarnings(
    "ignore:Do not use the `random` module:hypothesis.errors.HypothesisDeprecationWarning"
)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(odd_keys(), min_size=1, max_size=4), st.binary(max_size=20))
def test_every_service_goes_on_whatever_keys_come(site, keys, payload):
    for key in keys:
        say(site.plain, key, payload)
    site.call(site.everything_goes_on())


def test_an_odd_token_is_ignored_counted_and_made_one_event(site):
    before = {name: session.ignored.count for name, (_, session) in site.services.items()}
    key = f"robomesh/{SITE}/EV IL/alive/operator/li.{SITE}.x"  # with keys it may declare no other
    with contextlib.ExitStack() as held:

        def declare():
            held.callback(site.plain.liveliness().declare_token(key).undeclare)

        events = site.call(events_of_the_watch(site, declare, key))
        greeted, listed = site.call(site.greeting()), site.call(site.listed())
    assert len(events) == 1
    assert events[0].severity == schema.Event.WARNING
    assert key in events[0].text
    for name in ("console", "recorder", "player", "watch", "renderer"):
        if name in site.services:
            assert site.services[name][1].ignored.count > before[name], name
    assert greeted >= {"gateway", "recorder", "watch"}
    assert [(row["site"], row["robot"]) for row in listed["robots"]] == [(SITE, "arm")]
    assert {row["service"] for row in listed["services"]} >= set(site.services)


async def events_of_the_watch(site, do, key):
    """Return the watch's events for a key, until it has checked every process's health again."""
    events, checks = [], 0
    subscription = site.observer.subscribe(f"robomesh/{SITE}/-/events/watch", newest=1000, history=False)
    health_key = f"robomesh/{SITE}/-/health/watch.{site.services['watch'][1].identity}"
    health = site.observer.subscribe(health_key, newest=10, history=False)

    async def follow():
        async for sample in subscription:
            message = sample.message()
            if message.code == "mesh.key_ignored" and key in message.values["key"]:
                events.append(message)

    following = asyncio.create_task(follow())
    await asyncio.to_thread(do)
    try:
        async with asyncio.timeout(WITHIN_S):
            async for _ in health:
                checks += bool(events)
                if checks > 2:
                    break
    finally:
        subscription.close()
        health.close()
        await following
    return events
