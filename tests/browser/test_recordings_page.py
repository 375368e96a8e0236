"""Recordings on the page: started at a robot, listed, played; a replay is marked and accepts no command."""

import asyncio
import re

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.schema import build_file_descriptor_set
from playwright.sync_api import expect

from robomesh.contract.keys import WHOLE_SITE
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from services import player
from services.recorder import recorder
from services.store import service as store
from tests.browser.robot_page import (
    button,
    events,
    journal_entry,
    journal_lines,
    keep_picture,
    region,
    scene,
    scene_stale,
    serious,
    stop_button,
    tiles,
    until,
)

pytestmark = pytest.mark.browser

ROBOT = "robomesh/hall/pt600"
NAME = "swing"
QUARTER = "quarter.mcap"
RUNS = "runs.mcap"
LONG_S = 3.0  # of motion
_Ask = schema.RecorderRequest


@pytest.fixture(scope="module")
def recorded(plant, tmp_path_factory):
    """Yield a recorder and a player of the plant, and the file of a recording of its moving arm."""
    folder = tmp_path_factory.mktemp("recordings")

    async def start():
        own = plant.session
        for name in ("recorder", "player"):
            own.declare_presence("hall", WHOLE_SITE, name)
        serving = (
            recorder.serve(
                own,
                recorder.Settings(site="hall", robots=("pt600",), folder=folder, views=()),
            ),
            player.serve(own, player.Settings(site="hall", folder=folder)),
        )
        tasks = [plant.loop.create_task(each) for each in serving]
        await ask_recorder(plant, _Ask.TRACE_ON, name=NAME)
        acquire = schema.LeaseRequest(action=schema.LeaseRequest.ACQUIRE, ttl_s=0.5)
        await own.ask(f"{ROBOT}/lease/request/li", acquire, timeout_s=40.0)
        async with asyncio.timeout(40):
            async for sample in own.subscribe(f"{ROBOT}/recording"):
                recording = sample.message()
                if joints_in(recording) and recording.duration.ToTimedelta().total_seconds() >= LONG_S:
                    break
        closed = await ask_recorder(plant, _Ask.TRACE_OFF)
        path = next(folder.rglob(closed.file))
        of_quarter(path)
        with_runs(path)
        path.with_name("empty.mcap").touch()
        return tasks, closed.file

    async def end(tasks):
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    tasks, file = plant.call(start())
    yield file
    plant.call(end(tasks))


def of_quarter(path):
    """Write a copy whose frames and joints end after a quarter of it."""
    with path.open("rb") as file, path.with_name(QUARTER).open("wb") as to:
        reader, writer = make_reader(file), Writer(to)
        whole = reader.get_summary().statistics
        quarter = (3 * whole.message_start_time + whole.message_end_time) // 4
        writer.start()
        channels = {}
        for schema_, channel, message in reader.iter_messages():
            if message.log_time > quarter and channel.topic.endswith(("/frames", "/joints")):
                continue
            if channel.id not in channels:
                known = writer.register_schema(schema_.name, schema_.encoding, schema_.data)
                channels[channel.id] = writer.register_channel(channel.topic, "protobuf", known)
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
            )
        writer.finish()


def with_runs(path):
    """Write a recording's robot, and two runs of a program: 12 steps each, and one that is refused."""
    with path.open("rb") as file, path.with_name(RUNS).open("wb") as to:
        reader, writer = make_reader(file), Writer(to)
        began = reader.get_summary().statistics.message_start_time
        writer.start()
        topics = {}
        for topic, kind in (("events", schema.Event), ("audit", schema.AuditEntry)):
            data = build_file_descriptor_set(kind).SerializeToString()
            known = writer.register_schema(kind.DESCRIPTOR.full_name, "protobuf", data)
            topics[kind] = writer.register_channel(f"{ROBOT}/{topic}", "protobuf", known)
        described = {}
        for schema_, channel, message in reader.iter_messages():
            if not channel.topic.endswith("/description") or channel.id in described:
                continue
            known = writer.register_schema(schema_.name, schema_.encoding, schema_.data)
            described[channel.id] = writer.register_channel(channel.topic, "protobuf", known)
            writer.add_message(described[channel.id], began, message.data, began)

        def add(at_s, message):
            at = began + int(at_s * 1e9)
            message.timestamp.FromNanoseconds(at)
            writer.add_message(topics[type(message)], at, message.SerializeToString(), at)

        for start in (0.1, 5.1):
            started = schema.Event(code="program.started", text="li runs square", severity=schema.Event.INFO)
            add(start, started)
            for number in range(13):
                outcome = schema.AuditEntry.REFUSED if number == 12 else schema.AuditEntry.ACCEPTED
                step = schema.AuditEntry(
                    operator="li", source="program", request="MOVE_ABSOLUTE", outcome=outcome
                )
                add(start + 0.3 * (number + 1), step)
        writer.finish()


async def ask_recorder(plant, action, **values):
    return await plant.session.ask(f"{ROBOT}/recorder/request", _Ask(action=action, **values), timeout_s=40.0)


def joints_in(recording):
    return sum(each.messages for each in recording.topics if each.topic.endswith("/joints"))


def play(page):
    """Open the recording from the list, and pause it."""
    page.get_by_role("link", name=f"Play {NAME}").click()
    expect(scene(page)).to_have_attribute("data-loaded", "true")
    expect(player_of(page)).to_have_attribute("data-replay", re.compile("^replay-"))


def player_of(page):
    """Return the player, which names its replay in `data-replay`."""
    return page.get_by_role("group", name="Player", exact=True)


def transport(page):
    return region(page, "Transport")


def play_button(page):
    return transport(page).get_by_role("button", name=re.compile("^(Play|Pause)$"))


def recordings(page):
    return page.get_by_role("list", name="Recordings", exact=True).get_by_role("listitem")


def curves(page):
    """Return the first chart; the line at the moment and the place of the curves have no role."""
    return page.get_by_role("figure").first


def curves_area(page):
    return curves(page).locator(".u-over")


def note_range(page):
    """Return the mark of a note's range on the time line, which only the eye needs."""
    return transport(page).locator(".note-range")


def position(page):
    minutes, seconds = (
        transport(page).get_by_text(re.compile(r"^[\d:.]+ / ")).inner_text().split(" /")[0].split(":")
    )
    return 60 * int(minutes) + float(seconds)


def arm(page):
    return scene(page).screenshot()


def moment_line(page):
    return curves(page).locator(".moment-line").evaluate("line => line.getBoundingClientRect().left")


def test_a_recording_is_listed_and_played_and_a_seek_moves_arm_curves_and_clock(open_page, recorded):
    page = open_page("#/recordings", width=1280, height=800)
    card = recordings(page).filter(has=page.get_by_title(recorded, exact=True))
    expect(card).to_contain_text("pt600")
    expect(card).to_contain_text("messages")
    empty = recordings(page).filter(has=page.get_by_title("empty.mcap", exact=True))
    expect(empty.get_by_text("empty.mcap is empty: the disk was full")).to_be_visible()
    expect(empty.get_by_role("link", name="Play")).to_have_count(0)
    button(card, "Compare").click()
    expect(page.get_by_role("link", name=f"Compare with {NAME}").first).to_be_visible()
    button(page, "Cancel").click()
    play(page)
    expect(page.get_by_text("replay of pt600").first).to_be_visible()
    expect(events(page).filter(has_text="li asked acquire").first).to_be_visible()
    expect(page.get_by_role("group", name="Events").get_by_role("button").first).to_be_visible()

    # It plays to its end without input.
    expect(button(transport(page), "Play")).to_be_visible()
    page.keyboard.press("Home")
    until(page, lambda: position(page) < 0.5)
    expect(curves(page)).to_be_visible()
    left, at_start = moment_line(page), arm(page)
    page.get_by_label("Moment").fill("1.5")
    until(page, lambda: abs(position(page) - 1.5) < 0.02)
    until(page, lambda: moment_line(page) > left + 10 and arm(page) != at_start)

    # A click into the curves goes there.
    box = curves_area(page).bounding_box()
    page.mouse.click(box["x"] + 0.2 * box["width"], box["y"] + box["height"] / 2)
    until(page, lambda: position(page) < 1.4)

    # The picture follows the joints, slowly enough for a busy machine.
    transport(page).get_by_label("Speed").select_option("0.1")
    begun, before = position(page), arm(page)
    page.keyboard.press("Space")
    until(page, lambda: position(page) > begun + 0.1 and arm(page) != before)
    button(page, "Pause").click()
    expect(button(transport(page), "Play")).to_be_visible()


@pytest.mark.long
def test_a_moment_without_joints_is_told_and_no_other_is_shown_as_this_one(open_page, recorded):
    page = open_page(f"#/recordings/hall/{QUARTER}", drawn=False)
    expect(play_button(page)).to_be_visible()
    page.keyboard.press("End")
    expect(scene_stale(page)).to_have_text("No joints were recorded of this moment.")
    page.keyboard.press("Home")
    expect(region(page, "3-D view")).to_have_attribute("data-moment", "here")
    expect(scene_stale(page)).to_have_count(0)


def test_a_replay_cannot_be_commanded_and_stop_stays_that_of_the_robots(open_page, plant, recorded):
    page = open_page("#/recordings", drawn=False)
    page.get_by_role("link", name=f"Play {NAME}").click()
    expect(player_of(page)).to_have_attribute("data-replay", re.compile("^replay-"))
    robot = player_of(page).get_attribute("data-replay")

    with pytest.raises(RefusedError, match="replay"):
        plant.call(
            plant.session.ask(
                f"robomesh/hall/{robot}/lease/request/li",
                schema.LeaseRequest(action=schema.LeaseRequest.ACQUIRE, ttl_s=2.0),
            )
        )

    other = open_page(f"#/hall/{robot}", drawn=False)
    expect(other.get_by_text("replay of pt600").first).to_be_visible()
    expect(transport(other)).to_be_visible()
    expect(button(other, "Take control")).to_have_count(0)
    expect(stop_button(other)).to_contain_text("Stop request: all")
    other.goto(f"{plant.address}/#/")
    expect(region(other, "Replays")).to_contain_text("replay of pt600")
    expect(tiles(other).filter(has_text=robot)).to_have_count(0)

    # It ends with the page that opened it.
    page.goto(f"{plant.address}/#/recordings")
    expect(region(other, "Replays")).to_have_count(0)


def test_a_recording_is_begun_and_ended_on_the_robots_page(open_page, recorded):
    page = open_page("#/hall/pt600", drawn=False)
    page.get_by_role("button", name=re.compile("^(Record…|recording now)")).click()
    page.get_by_label("Name of the recording").fill("from/here")
    button(page, "Record").click()
    expect(region(page, "Record…").get_by_role("alert")).to_contain_text("from/here")
    page.get_by_label("Name of the recording").fill("from the page")
    button(page, "Record").click()
    expect(region(page, "Record…")).to_contain_text("nothing lost")
    expect(page.get_by_role("button", name=re.compile("^(Record…|recording now)"))).to_contain_text(
        "recording now"
    )
    button(page, "Stop recording").click()
    region(page, "Record…").get_by_role("link").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("from-the-page")


@pytest.mark.long
def test_what_cannot_be_played_is_said(open_page, recorded):
    page = open_page("#/recordings/hall/gone.mcap", drawn=False)
    expect(page.get_by_role("main").get_by_role("alert")).to_contain_text("no recording 'gone.mcap' here")
    page.goto(page.url.replace("hall/gone.mcap", "nowhere/x.mcap"))
    expect(page.get_by_role("main").get_by_role("alert")).to_contain_text("No player answers at nowhere")


@pytest.mark.long
def test_the_list_and_the_player_fit_a_phone_and_axe_finds_nothing_serious(open_page, recorded):
    page = open_page("#/recordings", width=360, height=740, drawn=False)
    expect(recordings(page).first).to_be_visible()
    fits = "document.documentElement.scrollWidth <= innerWidth"
    assert page.evaluate(fits)
    assert serious(page) == []
    keep_picture(page, "recordings")
    page.get_by_role("link", name=f"Play {NAME}").click()
    expect(play_button(page)).to_be_in_viewport()
    expect(stop_button(page)).to_be_in_viewport()
    assert page.evaluate(fits)
    assert play_button(page).bounding_box()["height"] >= 44
    expect(curves(page)).to_be_visible()
    assert serious(page) == []
    keep_picture(page, "player")


@pytest.mark.long
def test_the_steps_of_a_run_are_folded_under_it(open_page, recorded):
    page = open_page(f"#/recordings/hall/{RUNS}", drawn=False)
    rows = events(page)
    expect(rows).to_have_count(4)  # two runs, and the refused step of each
    run = rows.first.get_by_role("button", name="12 steps")
    expect(run).to_have_attribute("aria-expanded", "false")
    run.click()
    expect(rows).to_have_count(16)
    expect(rows.nth(1)).to_contain_text("li asked move absolute")
    run.click()
    expect(rows).to_have_count(4)


@pytest.fixture(scope="module")
def noted(plant, tmp_path_factory):
    """Run a store of the plant: notes can be written."""
    folder = tmp_path_factory.mktemp("programs")

    async def start():
        settings = store.Settings(site="hall", robots=("pt600",), folder=folder)
        task = plant.loop.create_task(store.serve(plant.session, settings))
        async with asyncio.timeout(40):
            while await plant.session.last(f"{ROBOT}/programs") is None:
                await asyncio.sleep(0.05)
        return task

    async def end(task):
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    task = plant.call(start())
    yield
    plant.call(end(task))


def test_a_note_of_one_page_is_seen_and_withdrawn_on_another(noted, plant, open_page):
    mine, other = open_page("#/hall/pt600", drawn=False), open_page("#/events", drawn=False)
    button(other, "Notes").click()
    controls = (
        region(mine, "Control").or_(region(mine, "Joints")).get_by_role("button").or_(stop_button(mine))
    )
    before = controls.evaluate_all("all => all.map((each) => each.getBoundingClientRect().toJSON())")
    button(mine, "Note…").click()
    form = mine.get_by_role("form", name="Note")
    assert controls.evaluate_all("all => all.map((each) => each.getBoundingClientRect().toJSON())") == before
    form.get_by_label("Your name").fill("li")
    form.get_by_label("Text").fill("gripper slips")
    button(form, "Last minute").click()
    button(form, "Save note").click()
    line = journal_lines(other).filter(has_text="gripper slips")
    expect(line).to_contain_text(re.compile(r"li noted on [\d:+-]+ – [\d:+-]+: gripper slips"))
    expect(form).to_have_count(0)
    line.click()
    expect(journal_entry(other)).to_contain_text("gripper slips")
    expect(button(other, "Withdraw this note")).to_have_count(0)  # another author's
    mine.goto(f"{plant.address}/#/events")
    button(mine, "Notes").click()
    journal_lines(mine).filter(has_text="gripper slips").click()
    button(mine, "Withdraw this note").click()
    for page in (mine, other):
        expect(journal_lines(page).get_by_role("deletion")).to_contain_text("gripper slips")
    button(other, "Day").click()
    other.get_by_label("Robot", exact=True).select_option("pt600")
    expect(region(other, "Journal").get_by_role("deletion")).to_contain_text("gripper slips")
    expect(other.get_by_text("This day is not complete")).to_be_visible()
    keep_picture(other, "day")


@pytest.mark.long
def test_a_note_on_a_recording_is_beside_it_and_its_file_is_unchanged(noted, recorded, plant, open_page):
    before = plant.call(ask_info(plant, recorded))
    page = open_page(f"#/recordings/hall/{recorded}")
    panel = region(page, "Events")
    button(panel, "Note").click()
    form = page.get_by_role("form", name="Note")
    form.get_by_label("Your name").fill("wang")
    form.get_by_label("Text").fill("starts late")
    button(form, "From here to the player's position").click()
    page.get_by_label("Moment", exact=True).fill("1.5")  # it plays, so the range grows
    button(form, "Save note").click()
    expect(panel).to_contain_text("starts late")
    expect(panel).to_contain_text("Not in the file")
    expect(note_range(page)).to_have_count(1)
    again = open_page(f"#/recordings/hall/{recorded}", drawn=False)
    expect(again.get_by_role("region", name="Events")).to_contain_text("starts late")
    assert plant.call(ask_info(plant, recorded)) == before


async def ask_info(plant, file):
    """Return the size of a recording and its number of messages of each topic."""
    query = schema.RecordingQuery(file=file)
    info = await plant.session.ask(f"robomesh/hall/{WHOLE_SITE}/recordings/info", query, timeout_s=40.0)
    return info.bytes, [(each.topic, each.messages) for each in info.topics]
