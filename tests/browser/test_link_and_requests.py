"""A robot's link, its legacy clients and floods of refusals on its page."""

import asyncio
import re
import socket

import pytest
from playwright.sync_api import expect

from robomesh.errors import RefusedError
from robomesh.schemas.robomesh_pb2 import LeaseRequest, Signals
from tests.browser.robot_page import (
    ARM,
    button,
    region,
    requests,
    serious,
    state_word,
)

pytestmark = pytest.mark.browser

PT600 = "#/hall/pt600"


CAN = (
    "reads · moves joints · jogs · holds · sets the speed · homes · stops any motion · "
    "without the gateway: unknown"
)


@pytest.mark.long
def test_how_the_link_does_is_told_in_figures_and_what_its_driver_can_do_in_words(open_page):
    page = open_page(ARM, drawn=False)
    button(page, "Link").click()
    facts = region(page, "Link")
    expect(facts).to_contain_text(re.compile(r"Units\s*\d+\.\d\s*/s"))
    for name in ("Units received", "Malformed", "Lost"):
        expect(facts).to_contain_text(name)
    expect(facts).not_to_contain_text("Old clients")  # none may attach here
    expect(facts).to_contain_text(CAN)
    assert serious(page) == []


@pytest.mark.long
def test_old_clients_are_counted_where_they_may_attach(open_page, plant):
    page = open_page(PT600, drawn=False)
    button(page, "Link").click()
    expect(region(page, "Link")).to_contain_text(re.compile(r"Old clients attached\s*0"))
    with socket.create_connection(("127.0.0.1", plant.legacy_port)):
        expect(region(page, "Link")).to_contain_text(re.compile(r"Old clients attached\s*1"))
        expect(page.get_by_text("old clients: 1")).to_be_visible()


def test_signals_are_shown_in_groups_and_never_look_live_when_they_are_stale(open_page, plant):
    page = open_page(ARM, drawn=False)
    expect(button(page, "Link")).to_be_visible()
    expect(button(page, "Signals")).to_have_count(0)  # its controller reports none

    async def publish():
        message = Signals()
        message.signals.add(name="io.digital_in.3", on=True)
        message.signals.add(name="payload.mass", unit="kg", number=1.25)
        message.signals.add(name="safety.mode", text="protective_stop")
        plant.session.declare_publisher("hall", "arm", "signals").put(message)

    plant.call(publish())
    button(page, "Signals").click()
    shown = page.get_by_role("group", name="Signals")
    for text in ("protective stop", "1.250kg", "digital input 3"):
        expect(shown).to_contain_text(text)
    button(page, "Payload (1)").click()
    expect(button(page, "Payload (1)")).to_have_attribute("aria-expanded", "false")
    expect(shown).not_to_contain_text("1.250")
    expect(shown.get_by_role("definition")).to_have_class([re.compile("stale")] * 2)
    expect(shown).to_contain_text("stale")
    assert serious(page) == []


@pytest.mark.long
def test_a_flooding_controller_is_told_in_words(open_page, plant):
    page = open_page(PT600, drawn=False)
    expect(state_word(page)).to_have_text(re.compile("Idle|Moving"))
    port = plant.call(plant.stop_controller("pt600"))
    try:
        plant.call(plant.start_controller("pt600", port, demo=True, rate_hz=100.0, faults=("flood",)))
        expect(page.get_by_role("main").get_by_text("flooded")).to_be_visible()
        plant.call(plant.stop_controller("pt600"))
    finally:
        plant.call(plant.start_controller("pt600", port, demo=True))
    expect(page.get_by_role("main").get_by_text("flooded")).to_have_count(0)


@pytest.mark.long
def test_a_flood_of_refusals_is_shown_with_its_count(open_page, plant):
    page = open_page(ARM, drawn=False)
    button(page, "Requests").click()

    async def flood():
        for _ in range(200):
            with pytest.raises(RefusedError):
                await plant.session.ask(
                    "robomesh/hall/arm/lease/request/mallory",
                    LeaseRequest(action=LeaseRequest.OFFER, to="eve"),
                )

    plant.call(asyncio.wait_for(flood(), 15.0))
    counted = requests(page).filter(has=page.get_by_role("strong")).first
    expect(counted).to_contain_text("refused")
    expect(counted).to_contain_text("mallory: offer control to eve")
    expect(counted.get_by_role("strong")).to_have_text(re.compile(r"× \d+"))
