"""Layouts that a site keeps: rules, the file, rights, a restart."""

import asyncio
import json

import pytest

from robomesh import reason_codes as codes
from robomesh.contract.quotas import Quotas
from robomesh.schemas import robomesh_pb2 as schema
from services.console.accounts.file import AccountRole
from services.console.accounts.rights import check_right, parse_request
from services.store import layouts as layouts_module
from services.store.layouts import LONGEST_TEXT, MOST_LAYOUTS, Layouts
from tests.refusals import refused
from tests.services.test_notes import signed_in
from tests.services.test_store import stored

Request = schema.LayoutRequest
TEXT = "plot=60,joints&video=top"


def save(layouts, name, text=TEXT, *, by="li", **values):
    layouts.change(Request(action=Request.SAVE, name=name, text=text, **values), by, 1)


def names(layouts):
    return [each.name for each in layouts.message.layouts]


def test_layouts_are_saved_replaced_renamed_and_deleted_and_survive_a_restart(tmp_path):
    layouts = Layouts(tmp_path)
    assert layouts.open() is None
    save(layouts, "night")
    save(layouts, "Leitstand Süd", "")
    assert names(layouts) == ["Leitstand Süd", "night"]
    save(layouts, "night")  # a repeated request, whose answer was lost
    with refused(codes.LAYOUTS_NAME_TAKEN, name="night", author="li"):
        save(layouts, "NIGHT", "hide=video", by="wang")
    save(layouts, "Night", "hide=video", by="wang", replace=True)
    with refused(codes.LAYOUTS_NAME_TAKEN):
        layouts.change(Request(action=Request.RENAME, name="night", new_name="leitstand süd"), "li", 2)
    layouts.change(Request(action=Request.RENAME, name="night", new_name="NIGHT"), "mo", 2)
    again = Layouts(tmp_path)
    assert again.open() is None
    assert again.message == layouts.message
    night = again.message.layouts[1]
    assert (night.name, night.text, night.author, night.timestamp.nanos) == ("NIGHT", "hide=video", "mo", 2)
    again.change(Request(action=Request.DELETE, name="night"), "li", 3)
    assert names(again) == ["Leitstand Süd"]
    for action in (Request.RENAME, Request.DELETE):
        with refused(codes.LAYOUTS_UNKNOWN, name="night"):
            again.change(Request(action=action, name="night", new_name="day"), "li", 4)


@pytest.mark.parametrize(
    ("values", "code"),
    [
        ({"action": Request.SAVE, "name": "../x", "text": TEXT}, codes.PROGRAMS_NAME),
        ({"action": Request.SAVE, "name": "", "text": TEXT}, codes.PROGRAMS_NAME),
        ({"action": Request.SAVE, "name": "a", "text": "plot 60"}, codes.LAYOUTS_TEXT),
        ({"action": Request.SAVE, "name": "a", "text": "plot=\n60"}, codes.LAYOUTS_TEXT),
        ({"action": Request.SAVE, "name": "a", "text": "x" * (LONGEST_TEXT + 1)}, codes.LAYOUTS_TEXT),
        ({"action": Request.RENAME, "name": "there", "new_name": "a/b"}, codes.PROGRAMS_NAME),
        ({"name": "a", "text": TEXT}, codes.INVALID),
    ],
)
def test_an_invalid_request_changes_nothing(tmp_path, values, code):
    layouts = Layouts(tmp_path)
    save(layouts, "there")
    with refused(code):
        layouts.change(Request(**values), "li", 1)
    assert names(layouts) == ["there"]


def test_a_site_keeps_a_limited_number_and_size_of_layouts(tmp_path):
    layouts = Layouts(tmp_path)
    for number in range(MOST_LAYOUTS):
        save(layouts, f"l{number}", "")
    with refused(codes.LAYOUTS_FULL):
        save(layouts, "one more")
    (tmp_path / "other").mkdir()
    many = Layouts(tmp_path / "other")
    with refused(codes.LAYOUTS_FULL):
        for number in range(MOST_LAYOUTS):
            save(many, f"l{number}", "x" * LONGEST_TEXT)
    assert len(many.message.layouts) < 40


@pytest.mark.parametrize("data", [b"{", b'{"layouts": 1}', b"[" * 100_000, b'{"layouts": [{"name": 3}]}'])
def test_a_damaged_file_is_kept_beside(tmp_path, data):
    (tmp_path / "layouts.json").write_bytes(data)
    layouts = Layouts(tmp_path)
    assert layouts.open().code == codes.LAYOUTS_DAMAGED.name
    assert (tmp_path / "layouts.damaged").read_bytes() == data
    save(layouts, "new")
    assert json.loads((tmp_path / "layouts.json").read_text())["layouts"][0]["name"] == "new"


def test_a_full_disk_changes_nothing(tmp_path, monkeypatch):
    layouts = Layouts(tmp_path)
    save(layouts, "there")

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(layouts_module, "write_atomically", full)
    with refused(codes.PROGRAMS_DISK):
        save(layouts, "new")
    assert names(layouts) == ["there"]


async def test_a_saved_layout_is_on_every_page_at_once(mesh, tmp_path):
    async with stored(mesh, tmp_path, quotas=Quotas(program_saves_a_minute=2)) as page:
        lists = page.subscribe("robomesh/s/-/layouts", newest=100)
        assert not (await anext(lists)).message().layouts
        key, request = "robomesh/s/-/layouts/request/li.s", Request(action=Request.SAVE, name="night")
        answer = await page.ask(key, request, timeout_s=20.0)
        async with asyncio.timeout(20.0):
            # A list that is published during the query arrives twice.
            while (message := (await anext(lists)).message()) != answer:
                assert not message.layouts
        assert answer.layouts[0].author == "li.s"
        request.action = Request.DELETE
        await page.ask(key, request, timeout_s=20.0)
        with refused(codes.OVER_QUOTA, quota="program_saves_a_minute"):
            await page.ask(key, request, timeout_s=20.0)


def test_a_monitor_may_not_save_layouts():
    key, row = parse_request("robomesh/s/-/layouts/request/li.s")
    check_right(row, key, signed_in(AccountRole.OPERATOR), "s")
    with refused(codes.NEEDS_OPERATOR, account="li"):
        check_right(row, key, signed_in(AccountRole.MONITOR), "s")
