"""Define, as a user uses it: from files to a robot that moves, on the page of a real site."""

import math
import re
import shutil
import tomllib

import numpy as np
import pytest
from playwright.sync_api import expect

from robots.descriptions.description import load
from robots.descriptions.glb import link_glbs
from robots.descriptions.urdf.write import to_urdf
from tests.browser.define.page import (
    SHAPES,
    chain_row,
    chain_rows,
    choose,
    drawing,
    drop,
    field,
    missing_files,
    opened,
    problems,
    robots,
    save_state,
    settled,
    shape,
    tab,
    table,
    table_rows,
    tools,
)
from tests.browser.robot_page import button, joint_value, tool_values, who_controls
from tests.site import wait_until

pytestmark = pytest.mark.browser

# Name, a, alpha, d, theta, limits of the library's Pt500, the owner of these shapes.
ROWS = [
    ("waist", 0, 90, 300, 0, (-150, 150)),
    ("shoulder", 250, 0, 0, 0, (-30, 130)),
    ("elbow", 250, 0, 0, 0, (-110, 110)),
    ("wrist_pitch", 0, 90, 0, 90, (-100, 100)),
    ("roll", 0, 0, 0, 0, (-180, 180)),
]


def test_an_arm_of_dropped_files_gets_rows_and_limits_is_saved_started_and_moves(open_page, plant):
    page = open_page("#/define")
    for name, title in (("pt500", "Pt500"), ("pt600", "Pt600"), ("puma560", "Puma 560")):
        expect(robots(page).filter(has_text=title)).to_have_attribute("href", f"#/define/{name}")
    drop(page, *map(shape, ("base.wrl", "column.3ds", "forearm.3ds", "upper_arm.wrl", "wrist.wrl")))
    expect(drawing(page)).to_have_attribute("data-shapes", "5")
    expect(page.get_by_role("list", name="What was found in the files")).to_contain_text(
        "Order guessed from the names: base → column → upper_arm → forearm → wrist."
    )
    # A button gives the flange its own joint.
    button(page, "+ Add joint").click()
    page.get_by_label("Choose a file…", exact=True).set_input_files(SHAPES / "flange.3ds")
    expect(drawing(page)).to_have_attribute("data-shapes", "6")
    shapes = (
        "column · column.3ds",
        "upper_arm · upper_arm.wrl",
        "forearm · forearm.3ds",
        "wrist · wrist.wrl",
        "flange.3ds",
    )
    for number, words in enumerate(shapes):
        expect(
            chain_row(page, number).get_by_role("button", name=f"joint{number + 1} {words} ")
        ).to_be_visible()
    for number, (name, a, alpha, d, theta, limits) in enumerate(ROWS):
        choose(page, number)
        field(page, f"joint/{number}/name").fill(name)
        for column, value in (("a", a), ("alpha", alpha), ("d", d), ("theta", theta)):
            field(page, f"joint/{number}/{column}").fill(str(value))
        for which, value in enumerate(limits):
            field(page, f"joint/{number}/limits/{which}").fill(str(value))
    choose(page, "tool")
    field(page, "tool/xyz/2").fill("100")
    tab(page, "Robot")
    field(page, "name").fill("five")
    field(page, "title").fill("Five joints")
    button(page, "Save and start simulated").click()
    page.get_by_role("link", name="Watch it").click()

    saved = load(plant.robots / "five")
    assert [joint.name for joint in saved.joints] == [row[0] for row in ROWS]
    assert [(joint.a, joint.alpha, joint.d, joint.theta, joint.limits) for joint in saved.joints] == [
        row[1:] for row in ROWS
    ]
    assert sorted(path.name for path in (plant.robots / "five" / "meshes").iterdir()) == sorted(
        path.name for path in SHAPES.iterdir()
    )

    expect(page.get_by_role("heading", level=1)).to_have_text("five")
    path = page.url.partition("/#")[2]
    page.close()
    page = open_page(f"#{path}", drawn=False)  # drawn by the processor here, it would leave a lease no time
    # The robot is starting: no gateway can grant control yet.
    expect(page.get_by_text("remote · not homed")).to_be_visible()
    expect(who_controls(page)).to_have_text("Nobody is in control")
    page.get_by_label("Your name").fill("li")
    button(page, "Take control").click()
    expect(who_controls(page)).to_have_text("You are in control")
    button(page, "Home").click()
    expect(page.get_by_text("remote · homed")).to_be_visible()
    handle = page.get_by_role("slider", name="Target of elbow")
    handle.focus()
    handle.press("PageUp")
    handle.press("Enter")
    expect(joint_value(page, "elbow")).to_have_text("10.00°")
    # Rows of the table: tool 0.1 m on from an elbow at 10°, base 0.3 m up, two links of 0.25 m.
    reach = 250 + 350 * math.cos(math.radians(10))
    expect(tool_values(page).first).to_have_text(f"{reach:.1f}mm")
    button(page, "Release").click()
    page.goto(f"{plant.address}/#/define/five")
    button(page, "End simulation").click()
    expect(button(page, "Start simulated")).to_be_enabled()


@pytest.mark.long
def test_the_arm_is_drawn_where_the_server_says_that_it_is(open_page):
    page = opened(open_page, "puma560")
    drawn, reported = tools(page)
    assert np.allclose(drawn, reported, atol=1e-9)
    page.get_by_label("Position of shoulder").last.fill("-37.5")
    page.get_by_label("Position of wrist_bend").last.fill("61")
    choose(page, 2)
    button(page, "Prismatic").click()
    page.get_by_label("Position of elbow").last.fill("123")
    choose(page, "base")
    field(page, "base/pose/rpy/0").fill("180")
    field(page, "base/pose/xyz/2").fill("100")
    choose(page, "tool")
    field(page, "tool/rpy/0").fill("20")
    field(page, "tool/rpy/1").fill("-30")
    field(page, "tool/rpy/2").fill("40")
    # The server may have answered before the last edit.
    wait_until(lambda: np.allclose(*tools(page), atol=1e-9))
    moved, _ = tools(page)
    assert np.linalg.norm(moved[:3, 3] - drawn[:3, 3]) > 0.05


@pytest.mark.long
def test_joints_are_reordered_by_dragging_and_a_problem_leads_to_its_field(open_page):
    page = opened(open_page, "pt500", drawn=False)
    names = chain_rows(page).get_by_role("strong")
    chain_row(page, 3).drag_to(chain_row(page, 0))
    expect(names).to_have_text(["Base", "wrist", "waist", "shoulder", "elbow", "roll", "Tool"])
    expect(chain_row(page, 0).get_by_role("button")).to_have_attribute("aria-current", "true")
    page.keyboard.press("Control+z")
    expect(names).to_have_text(["Base", "waist", "shoulder", "elbow", "wrist", "roll", "Tool"])
    # A link on the base becomes the base.
    chain_row(page, 2).drag_to(chain_row(page, "base"))
    expect(chain_rows(page)).to_contain_text(
        ["forearm.3ds", "base.wrl", "column.3ds", "upper_arm.wrl", "wrist.wrl", "flange.3ds", "Tool"]
    )
    field(page, "joint/1/limits/0").fill("999")
    tab(page, "Robot")
    problems(page).click()
    expect(field(page, "joint/1/limits/0")).to_be_focused()


def test_a_shape_is_dragged_to_its_place_in_one_step(open_page):
    page = opened(open_page, "pt500")
    canvas = drawing(page)
    expect(canvas).to_have_attribute("data-shapes", "6")
    choose(page, "base")
    button(page, "Top").click()
    button(page, "Move").click()
    expect(canvas).to_have_attribute("data-gizmo", "translate")
    box = canvas.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y, steps=4)
    page.mouse.move(x + 60, y, steps=4)
    page.mouse.up()
    # The view's eye is three reaches away (0.9 m), and its height that of a lens of 32° there.
    metre_px = box["height"] / (2 * 3 * 0.9 * math.tan(math.radians(16)))
    moved = float(field(page, "base/mesh_pose/xyz/0").input_value().replace("−", "-"))
    assert moved == pytest.approx(60 / metre_px * 1000, rel=0.05)
    button(page, "Undo").click()
    expect(field(page, "base/mesh_pose/xyz/0")).to_have_value("0")
    expect(button(page, "Undo")).to_be_disabled()


def test_a_reload_keeps_unsaved_work_and_says_so_until_it_is_discarded(open_page):
    page = open_page("#/define")
    drop(page, shape("base.wrl"), shape("column.3ds"))
    canvas = drawing(page)
    expect(canvas).to_have_attribute("data-shapes", "2")
    field(page, "joint/0/d").fill("312.5")
    page.reload()
    expect(
        page.get_by_text(re.compile(r"Unsaved draft from \d\d:\d\d:\d\d[+-]\d\d:\d\d brought back"))
    ).to_be_visible()
    expect(field(page, "joint/0/d")).to_have_value("312.5")
    expect(canvas).to_have_attribute("data-shapes", "2")
    button(page, "Discard it").click()
    button(page, "Discard it").click()
    expect(page.get_by_text("From link files")).to_be_visible()
    page.reload()
    expect(page.get_by_text("From link files")).to_be_visible()


def test_a_urdf_and_its_shapes_become_rows(open_page, tmp_path):
    description = load("pt500")
    shapes = link_glbs(description, cache=tmp_path)
    page = open_page("#/define")
    drop(page, ("pt500.urdf", to_urdf(description).encode()))
    expect(missing_files(page)).to_contain_text("meshes/column.glb")
    drop(page, *((f"{link}.glb", glb) for link, glb in shapes.items()))
    expect(table_rows(page)).to_have_count(5)
    expect(drawing(page)).to_have_attribute("data-shapes", "6")
    drawn, reported = tools(page)
    # The home of a URDF is zero: the arm stretched out.
    assert np.allclose(drawn[:3, 3], [0.6, 0.0, 0.3], atol=1e-6)
    assert np.allclose(drawn, reported, atol=1e-9)


@pytest.mark.long
def test_a_zip_holds_the_description_and_its_shapes(open_page, tmp_path):
    page = opened(open_page, "pt500")
    with page.expect_download() as download:
        button(page, "Download zip").click()
    assert download.value.suggested_filename == "pt500-copy.zip"
    shutil.unpack_archive(download.value.path(), tmp_path, "zip")
    [text] = tmp_path.rglob("robot.toml")
    assert [joint["name"] for joint in tomllib.loads(text.read_text())["joint"]] == [
        joint.name for joint in load("pt500").joints
    ]
    assert len(list(text.parent.glob("meshes/*"))) == 6
    again = open_page("#/define")
    drop(again, ("pt500-copy.zip", download.value.path().read_bytes()))
    expect(table(again)).to_contain_text("shoulder")
    expect(drawing(again)).to_have_attribute("data-shapes", "6")
    drawn, reported = tools(again)
    assert np.allclose(drawn, reported, atol=1e-9)


@pytest.mark.long
def test_a_view_is_kept_as_the_camera_shows_it(open_page, plant):
    page = opened(open_page, "pt500")
    tab(page, "Views")
    button(page, "Top").click()
    page.get_by_label("Name of a new view").fill("above")
    button(page, "Add from the camera").click()
    tab(page, "Robot")
    field(page, "name").fill("kept")
    settled(page)
    button(page, "Save").click()
    expect(save_state(page)).to_have_text("Saved")
    view = load(plant.robots / "kept").views["above"]
    # The automatic view from above: three reaches (2.7 m) over 0.45 of one.
    assert (view.target, view.projection) == ((0.0, 0.0, 405.0), "orthographic")
    assert view.eye == pytest.approx((0.0, 0.0, 3105.0), abs=0.2)
