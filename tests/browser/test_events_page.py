"""Alarms and the journal on the page, from a real watch; all pages show a change of one page."""

import re

import pytest
from playwright.sync_api import expect

from robomesh import reason_codes as codes
from robomesh.contract.keys import WHOLE_SITE
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.texts import DIRECTION
from tests.browser.robot_page import alarms, button, journal_entry, journal_lines, region, tile

pytestmark = pytest.mark.browser

ROBOTS = ("arm",)

EVENTS = "#/events"
Event = schema.Event


def badge(page, words):
    """Return the link to the alarms in the bar, which says how many there are."""
    return page.get_by_role("banner").get_by_role("link", name=words)


def isolated(line):
    """Return the text of others in a line, which the browser orders by itself."""
    return line.locator("bdi")


def line(page, text):
    return alarms(page).filter(has_text=text)


@pytest.mark.long
def test_the_badge_of_a_silent_watch_does_not_say_that_there_are_no_alarms(open_page, plant):
    async def publish_once():
        publisher = plant.session.declare_publisher("yard", WHOLE_SITE, "alarms")
        publisher.put(schema.AlarmList(site="yard"))
        return publisher

    publisher = plant.call(publish_once())
    silent = badge(open_page(drawn=False), "The watch of yard is silent")
    expect(silent.get_by_text("alarms stale", exact=True)).to_be_visible()
    plant.loop.call_soon_threadsafe(publisher.close)


def test_who_acknowledges_an_alarm_on_one_page_has_done_so_on_every_page(open_page, raised):
    fleet, mine, other = (open_page(path, drawn=False) for path in ("", EVENTS, EVENTS))
    raised("joints.gone", "no positions come from it")
    for page in (mine, other):
        expect(line(page, "no positions come").get_by_text("not acknowledged", exact=True)).to_be_visible()
        expect(line(page, "no positions come").get_by_text("high", exact=True)).to_be_visible()
        # Two sites may each have one of that id.
        expect(line(page, "no positions come").get_by_role("code")).to_have_text("hall/arm:joints.gone")
    expect(badge(fleet, "Unacknowledged alarms: 1 high")).to_be_visible()
    expect(tile(fleet, "arm").get_by_text("high", exact=True)).to_be_visible()
    acknowledge = button(mine, "Acknowledge: no positions come from it")
    expect(acknowledge).to_be_disabled()
    mine.get_by_label("Your name").fill("li")
    acknowledge.click()
    expect(region(mine, "Alarms").get_by_label("Outcome", exact=True)).to_have_text("Acknowledged: 1")
    expect(line(other, "no positions come").get_by_text("acknowledged", exact=True)).to_be_visible()
    expect(line(other, "no positions come")).to_contain_text("acknowledged by li at")
    expect(badge(fleet, "No unacknowledged alarm")).to_be_visible()
    raised("joints.back", "positions come again", Event.INFO)
    for page in (mine, other):
        expect(line(page, "no positions come")).to_have_count(0)
    expect(tile(fleet, "arm").get_by_text("high", exact=True)).to_have_count(0)


def test_an_alarm_is_shelved_with_a_reason_and_comes_back_when_it_is_asked_for(open_page, raised):
    page = open_page(EVENTS, drawn=False)
    raised("status.gone", "no status comes from it")
    page.get_by_label("Your name").fill("li")
    page.get_by_label("Select: no status comes from it").check()
    button(page, "Shelve selected…").click()
    shelve = page.get_by_role("form", name="Shelve")
    expect(button(shelve, "Shelve")).to_be_disabled()
    button(shelve, "8 h").click()
    shelve.get_by_label("Reason").fill("the cell is being cleaned")
    button(shelve, "Shelve").click()
    expect(line(page, "no status comes")).to_have_count(0)
    page.get_by_role("button", name=re.compile("^Shelved 1")).click()
    expect(line(page, "no status comes")).to_contain_text("the cell is being cleaned")
    button(page, "Unshelve: no status comes from it").click()
    expect(line(page, "no status comes")).to_have_count(0)
    page.get_by_role("button", name=re.compile("^Active or unacknowledged 1")).click()
    expect(line(page, "no status comes")).to_have_count(1)
    raised("status.back", "status comes again", Event.INFO)


def test_the_journal_lists_every_robots_events_and_is_narrowed_by_what_one_looks_for(open_page, raised):
    page = open_page(EVENTS, drawn=False)
    raised("recorder.note", "a note of the arm's recorder", Event.INFO)
    journal = region(page, "Journal")
    note = journal_lines(page).filter(has_text="a note of the arm's recorder")
    expect(note).to_have_count(1)
    journal.get_by_label("Severity").select_option(label="Warnings and up")
    expect(note).to_have_count(0)
    journal.get_by_label("Severity").select_option(label="All severities")
    journal.get_by_label("Search text, code, robot").fill("recorder.note")
    expect(journal_lines(page)).to_have_count(1)
    button(journal, "Pause").click()
    raised("recorder.note", "another note", Event.INFO)
    expect(journal.get_by_role("button", name=re.compile(r"^Go on \([1-9]"))).to_be_visible()
    expect(journal_lines(page)).to_have_count(1)
    note.click()
    expect(journal_entry(page)).to_contain_text("recorder.note")


def test_the_audit_of_every_robot_is_there_and_its_logs_are_searched_when_asked(open_page, plant, raised):
    async def acquire_and_release():
        key = "robomesh/hall/arm/lease/request/wang"
        given = await plant.session.ask(key, schema.LeaseRequest(action=schema.LeaseRequest.ACQUIRE, ttl_s=2))
        await plant.session.ask(
            key, schema.LeaseRequest(action=schema.LeaseRequest.RELEASE, lease=given.lease)
        )
        with pytest.raises(RefusedError):
            await plant.session.ask(key, schema.LeaseRequest(action=schema.LeaseRequest.OFFER, to="zhao"))

    plant.call(acquire_and_release())
    page = open_page(EVENTS, drawn=False)
    journal = region(page, "Journal")
    button(journal, "Requests").click()
    asked = journal_lines(page).filter(has_text="wang: take control")
    expect(asked).not_to_have_count(0)
    journal.get_by_label("Robot", exact=True).select_option(label="arm")
    button(journal, "Search the audit logs").click()
    expect(journal.get_by_role("status")).to_have_text(re.compile("^Found in the logs: [1-9]"))
    refused = journal_lines(page).filter(has_text="zhao").first
    expect(refused).to_contain_text(
        "refused wang: offer control to zhao – no operator is in control, or the lease has ended"
    )
    button(page, "中文").click()
    expect(refused).to_contain_text(
        "已拒绝 wang：提出将控制权移交给 zhao——无人控制，或控制权已结束：请先取得控制（ACQUIRE）"
    )
    refused.click()
    original = journal_entry(page).get_by_text(re.compile("^no operator is in control, or the lease"))
    expect(original).to_have_attribute("lang", "en")


@pytest.mark.long
def test_alarms_and_events_have_their_reason_in_chinese(open_page, raised):
    page = open_page(EVENTS, drawn=False)
    button(page, "中文").click()
    raised("audit.failed", "the audit log's disk", Event.ERROR, codes.AUDIT_SLOW(seconds=3))
    alarm = alarms(page).filter(has_text="audit.failed")
    expect(alarm.get_by_role("strong")).to_have_text("审计日志无法写入：审计日志所在磁盘超过 3 秒无响应")
    happened = journal_lines(page).filter(has_text="审计日志")
    expect(happened.first).to_contain_text("审计日志无法写入：审计日志所在磁盘超过 3 秒无响应。")
    released = codes.ENDED_RELEASED(name="li")
    raised("lease.ended", "control ended: li", Event.INFO, released, holder="li")
    ended = journal_lines(page).filter(has_text="的控制权已结束")
    expect(ended.first).to_contain_text("li 的控制权已结束：li 释放了控制权。")
    number = codes.PROGRAM_UNREADABLE(codes.ONE_NUMBER(word="speed", unit="percent", given="nothing"))
    raised("program.ended", "program weld ended", reason=number)
    alarm = alarms(page).filter(has_text="program.ended")
    expect(alarm.get_by_role("strong")).to_have_text("程序提前结束：“speed”须有一个数（%），而不是 空")
    alarm = alarms(page).filter(has_text="audit.failed")
    # An older publisher sends no reason.
    raised("audit.failed", "the audit log's disk")
    expect(alarm.get_by_role("strong")).to_have_text("审计日志无法写入")
    raised("lease.ended", "control ended: zhao", Event.INFO, holder="zhao")
    expect(ended.first).to_contain_text("zhao 的控制权已结束。")


@pytest.mark.long
def test_texts_of_others_change_the_order_of_nothing_beside_them(open_page, raised):
    """Show texts of another program with "Trojan Source" characters (CVE-2021-42574) and Hebrew."""
    page = open_page(EVENTS, drawn=False)
    raised(
        "recorder.note", 'if access_level != "user\u202e \u2066// Check if admin\u2069 \u2066" {', Event.INFO
    )
    raised("recorder.note", "stopped by \u05d4\u05d6\u05e8\u05d5\u05e2 3 at 10:15", Event.INFO)
    trojan = journal_lines(page).filter(has_text="access_level").first
    expect(isolated(trojan)).to_have_text(
        'if access_level != "user<U+202E> <U+2066>// Check if admin<U+2069> <U+2066>" {'
    )
    assert not set(trojan.inner_text()) & set(DIRECTION)
    hebrew = journal_lines(page).filter(has_text="stopped by").first
    expect(isolated(hebrew)).to_have_text("stopped by \u05d4\u05d6\u05e8\u05d5\u05e2 3 at 10:15")


@pytest.mark.long
def test_settings_shows_a_service_that_is_gone(open_page, plant, raised):
    async def appear():
        token = plant.session.declare_presence_of("hall", WHOLE_SITE, "renderer", "r1")
        health = plant.session.declare_publisher("hall", WHOLE_SITE, "health/renderer.r1")
        message = schema.ServiceHealth(service="renderer", id="r1", host="cell-9", version="0.0.9")
        message.timestamp.GetCurrentTime()
        message.values["certificate_seconds"] = 3.5 * 86_400
        health.put(message)
        return token, health

    async def go(token, health):
        health.close()
        token.undeclare()

    there = plant.call(appear())
    page = open_page("#/settings", drawn=False)
    row = page.get_by_role("row", name=re.compile("^renderer"))
    expect(row).to_contain_text("cell-9")
    expect(row).to_contain_text("0.0.9")
    expect(region(page, "Certificates").get_by_role("listitem")).to_contain_text(re.compile(r"ends in 3\sd"))
    plant.call(go(*there))
    expect(row.get_by_role("cell").first).to_have_text(re.compile("^(gone since|silent) "))
