"""`robomesh fault` with a real simulator, and the link's text in `monitor`."""

import asyncio
import json
from pathlib import Path

import pytest

from controllers.simulated.fault_requests import Mesh
from controllers.simulated.fault_table import FAULTS, UNIT_FAULTS
from controllers.unit.simulated.service import Settings, serve
from controllers.universal_robots.simulated.server import UR_FAULTS
from controllers.universal_robots.simulated.service import UrSettings, serve_rtde
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line.watch.monitor import link_words
from tests.site import robomesh

STATE = schema.ControllerState


async def ask(*arguments):
    return await asyncio.to_thread(robomesh, *arguments)


async def test_fault_begins_ends_and_lists_faults(mesh, router):
    own = Mesh(site="hall", robot="arm", session=mesh)
    ready = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(serve(Settings(robot="pt600", mesh=own), ready=ready.set_result))
    await ready
    try:
        to = ("--connect", router)
        begun = await ask("fault", "arm", "garbage", *to)
        assert (begun.returncode, begun.stdout) == (0, "faults now: garbage\n"), begun.stderr
        listed = await ask("fault", "arm", *to)
        assert [line[2:].split()[0] for line in listed.stdout.splitlines()] == list(UNIT_FAULTS)
        assert "* garbage" in listed.stdout
        printed = json.loads((await ask("fault", "hall/arm", "garbage", "--off", "--json", *to)).stdout)
        assert printed == {"active": [], "known": list(UNIT_FAULTS)}
        unknown = await ask("fault", "arm", "melt", *to)
        assert unknown.returncode == 2
        assert "'melt' is unknown; there are freeze, garbage" in unknown.stderr
        assert unknown.stderr.count("\n") == 1
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@pytest.mark.slow
async def test_fault_that_a_controller_cannot_show_is_refused(mesh, router):
    own = Mesh(site="hall", robot="ur", session=mesh)
    ready = asyncio.get_running_loop().create_future()
    settings = UrSettings(mesh=own)
    task = asyncio.create_task(serve_rtde(settings, ready=ready.set_result))
    await ready
    try:
        to = ("--connect", router)
        begun = await ask("fault", "ur", "freeze", "--json", *to)
        assert json.loads(begun.stdout) == {"active": ["freeze"], "known": list(UR_FAULTS)}
        mute = await ask("fault", "ur", "mute", *to)
        assert mute.returncode == 2
        assert "fault 'mute' is unknown; there are freeze, garbage" in mute.stderr
    finally:
        task.cancel()
        await asyncio.wait([task])


@pytest.mark.slow
def test_a_simulator_for_a_robot_without_a_site_is_refused_in_one_line():
    done = robomesh("simulate", "--for", "arm", "--listen", "127.0.0.1:0")
    assert (done.returncode, done.stderr) == (
        2,
        "robomesh: --for arm: must be SITE/ROBOT, as in demo/pt600\n",
    )


def test_monitor_prints_known_values_and_problems_of_a_link():
    state = STATE(link=STATE.UP, rate_hz=99.7, last_unit_age_s=0.01)
    assert link_words(state) == "100 units/s"
    state.health.jitter_s, state.health.answer_s = 0.0004, 0.012
    state.counters.units_lost, state.health.flooding = 3, True
    assert link_words(state) == "100 units/s, jitter 0.4 ms, answer 12.0 ms, 3 lost, FLOODING"
    silent = STATE(link=STATE.SILENT, rate_hz=0.0, last_unit_age_s=2.3)
    assert link_words(silent) == "0 units/s, 2.3 s old"


def test_the_document_of_faults_has_the_simulators_descriptions():
    text = (Path(__file__).parents[2] / "docs" / "faults.md").read_text(encoding="utf-8")
    rows = [line.split(" | ")[:2] for line in text.splitlines() if line.startswith("| `")]
    assert rows == [[f"| `{name}`", fault.effect] for name, fault in FAULTS.items()]
