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
    checks,
    choose,
    done,
    drawing,
    drop,
    field,
    missing_files,
    opened,
    paste,
    problems,
    refusal,
    robots,
    save_state,
    settled,
    shape,
    tab,
    table,
    table_rows,
    tools,
)
from tests.browser.robot_page import button, joint_value, region, serious, tool_values, who_controls
from tests.robots.test_dh import KUKA_LIKE
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
    choose(page, "tool")
    field(page, "tool/rpy/0").fill("20")
    field(page, "tool/rpy/1").fill("-30")
    field(page, "tool/rpy/2").fill("40")
    # The server may have answered before the last edit.
    wait_until(lambda: np.allclose(*tools(page), atol=1e-9))
    moved, _ = tools(page)
    assert np.linalg.norm(moved[:3, 3] - drawn[:3, 3]) > 0.05


@pytest.mark.long
def test_an_invalid_position_marks_only_its_own_field(open_page):
    page = opened(open_page, "pt500", drawn=False)
    page.get_by_label("Position of elbow").last.fill("x")
    expect(page.get_by_label("Position of elbow").last).to_have_attribute("aria-invalid", "true")
    expect(page.get_by_label("Position of shoulder").last).to_have_attribute("aria-invalid", "false")


def test_a_wrong_limit_is_told_marked_and_found_again_by_a_click(open_page):
    page = opened(open_page, "pt500", drawn=False)
    settled(page)
    expect(checks(page)).to_contain_text("Nothing is wrong with it.")
    choose(page, 2)
    field(page, "joint/2/limits/0").fill("120")
    expect(problems(page)).to_contain_text(
        "joint 'elbow' limits = [120, 110]: the lower must be below the upper"
    )
    expect(page.get_by_role("list", name="Problems in the table")).to_contain_text("lower must be below")
    expect(page.get_by_label("speed, °/s of elbow")).to_have_value("120")
    expect(page.get_by_role("columnheader", name="speed °/s")).to_be_visible()
    expect(field(page, "joint/2/limits/0")).to_have_attribute("aria-invalid", "true")
    expect(field(page, "joint/2/limits/1")).to_have_attribute("aria-invalid", "true")
    expect(field(page, "joint/2/home")).to_have_attribute("aria-invalid", "false")
    tab(page, "Robot")
    problems(page).click()
    expect(field(page, "joint/2/limits/0")).to_be_focused()
    field(page, "joint/2/limits/0").fill("-110")
    expect(problems(page)).to_have_count(0)


@pytest.mark.long
def test_what_is_no_number_stays_marked_and_is_not_saved(open_page):
    page = opened(open_page, "pt500", drawn=False)
    cell = field(page, "joint/1/a")
    for typed in ("1,234", "0x10", ""):
        cell.fill(typed)
        cell.blur()
        expect(cell).to_have_value(typed)
        expect(cell).to_have_attribute("aria-invalid", "true")
        expect(checks(page)).to_contain_text("is no number: write it as 1234.5")
        button(page, "Save").click()
        expect(cell).to_be_focused()
        page.keyboard.press("Escape")
        expect(checks(page)).to_contain_text("Nothing is wrong with it.")
        expect(cell).to_have_attribute("aria-invalid", "false")


def test_a_pasted_table_is_shown_as_it_is_read_fills_the_rows_and_is_undone(open_page):
    page = opened(open_page, "pt500", drawn=False)
    dialog = page.get_by_role("dialog", name="Table from a spreadsheet")
    button(page, "Paste a table…").click()
    text = dialog.get_by_role("textbox")
    paste(text, "1\t2\n" * 10_000)
    expect(dialog.get_by_role("alert")).to_contain_text("64 rows")
    expect(button(dialog, "Fill the table")).to_be_disabled()
    button(dialog, "Cancel").click()
    # Into the cells from the second row on.
    rows = "a (m)\td\tα\tmin\tmax\n0,25\t1,5\tx\t-30\t120\n" + "0\t2\t90\t-9\t9\n" * 4
    paste(field(page, "joint/1/a"), rows)
    words = dialog.get_by_role("status")
    expect(words).to_contain_text("Row 2, α: “x” cannot be read as Link twist α.")
    expect(words).to_contain_text("5 rows go into joints 2 to 6.")
    expect(words).to_contain_text("1 joint is added.")
    expect(dialog.get_by_role("table")).to_contain_text("250 mm")
    button(dialog.get_by_role("group", name="Lengths without a unit"), "m").click()
    assert serious(page) == []
    button(dialog, "Fill the table").click()
    expect(done(page)).to_contain_text("5 rows of the pasted table were read")
    paths = ("a", "alpha", "d", "limits/0", "limits/1")
    values = [field(page, f"joint/1/{path}").input_value() for path in paths]
    assert values == ["250", "0", "1500", "−30", "120"]
    expect(table_rows(page)).to_have_count(6)
    button(page, "Undo").click()
    expect(table_rows(page)).to_have_count(5)
    expect(field(page, "joint/1/limits/1")).to_have_value("130")


@pytest.mark.long
def test_a_shape_in_the_wrong_unit_is_told(open_page):
    page = opened(open_page, "pt500", drawn=False)
    choose(page, 0)
    page.get_by_role("group", name="The file’s unit").get_by_role("button", name="m", exact=True).click()
    expect(checks(page)).to_contain_text("column.3ds is 242 m large: is the file’s unit right?")


@pytest.mark.long
def test_checks_go_on_when_the_console_is_there_again(open_page):
    page = opened(open_page, "pt500", drawn=False, refused=True)
    settled(page)
    page.route("**/define/check", lambda route: route.abort())
    field(page, "joint/1/a").fill("260")
    expect(checks(page)).to_contain_text("Not checked: this page has no connection to the console")
    page.unroute("**/define/check")
    expect(checks(page)).to_contain_text("Nothing is wrong with it.")


@pytest.mark.long
def test_joints_are_reordered_by_dragging_and_removed_by_the_keyboard(open_page):
    page = opened(open_page, "pt500", drawn=False)
    names = chain_rows(page).get_by_role("strong")
    chain_row(page, 3).drag_to(chain_row(page, 0))
    expect(names).to_have_text(["Base", "wrist", "waist", "shoulder", "elbow", "roll", "Tool"])
    expect(chain_row(page, 0).get_by_role("button")).to_have_attribute("aria-current", "true")
    page.keyboard.press("Control+z")
    expect(names).to_have_text(["Base", "waist", "shoulder", "elbow", "wrist", "roll", "Tool"])
    page.keyboard.press("Control+Shift+z")
    expect(names).to_have_text(["Base", "wrist", "waist", "shoulder", "elbow", "roll", "Tool"])
    button(page, "Undo").click()
    expect(names).to_have_text(["Base", "waist", "shoulder", "elbow", "wrist", "roll", "Tool"])
    chain_row(page, 1).get_by_role("button").focus()
    page.keyboard.press("Delete")
    expect(names).to_have_text(["Base", "waist", "elbow", "wrist", "roll", "Tool"])
    expect(chain_row(page, 1).get_by_role("button")).to_be_focused()
    choose(page, 1)
    button(page, "Insert").click()
    expect(names).to_have_text(["Base", "waist", "joint2", "elbow", "wrist", "roll", "Tool"])
    # A name that the page gave follows the joint's place, one that was typed stays.
    chain_row(page, 1).get_by_role("button").press("Alt+ArrowDown")
    expect(names).to_have_text(["Base", "waist", "elbow", "joint3", "wrist", "roll", "Tool"])
    expect(region(page, "Chain").get_by_role("status")).to_have_text("joint3 is joint 3 of 5.")
    field(page, "joint/2/name").fill("joint9")
    chain_row(page, 2).get_by_role("button").press("Alt+ArrowUp")
    expect(names).to_have_text(["Base", "waist", "joint9", "elbow", "wrist", "roll", "Tool"])
    # A link on the base becomes the base.
    chain_row(page, 2).drag_to(chain_row(page, "base"))
    expect(chain_rows(page)).to_contain_text(
        ["forearm.3ds", "base.wrl", "column.3ds", "no shape", "wrist.wrl"]
    )


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


@pytest.mark.long
def test_files_that_the_server_forgot_are_sent_again(open_page, plant):
    page = open_page("#/define", refused=True)
    drop(page, shape("base.wrl"), shape("wrist.wrl"))
    canvas = drawing(page)
    expect(canvas).to_have_attribute("data-shapes", "2")
    settled(page)
    for folder in ("files", "drafts"):
        for path in (plant.store / folder).iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    field(page, "joint/0/d").fill("77")
    settled(page)
    expect(checks(page)).to_contain_text("Nothing is wrong with it.")
    page.reload()
    expect(canvas).to_have_attribute("data-shapes", "2")


@pytest.mark.long
def test_a_file_that_another_refers_to_is_asked_for_by_name(open_page):
    page = open_page("#/define", drawn=False)
    outer = b'#VRML V2.0 utf8\nInline { url "part.wrl" }\nShape { geometry Box { } }\n'
    drop(page, ("outer.wrl", outer))
    missing = missing_files(page)
    expect(missing).to_contain_text("meshes/outer.wrl refers to part.wrl")
    drop(page, ("part.wrl", b"#VRML V2.0 utf8\nShape { geometry Sphere { } }\n"))
    expect(missing).to_have_count(0)
    # It is a part of the base, not a link.
    expect(chain_rows(page)).to_have_count(2)


@pytest.mark.long
def test_a_file_that_cannot_be_read_is_refused_by_name_and_the_others_are_taken(open_page):
    page = open_page("#/define", drawn=False, refused=True)
    drop(page, shape("base.wrl"), ("bad.3ds", b"MM\x00"))
    expect(refusal(page)).to_contain_text("bad.3ds")
    expect(chain_rows(page)).to_have_count(2)
    expect(chain_rows(page).first).to_contain_text("base.wrl")


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


SAME_NAMES = """<robot name="two"><link name="base">{base}</link><link name="arm">{arm}</link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.2"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


def shapes_of(link):
    """Return a link's elements, whose two files have one name in two folders."""
    return "".join(
        f'<{kind}><geometry><mesh filename="package://two/meshes/{kind}/{link}.stl"/></geometry></{kind}>'
        for kind in ("visual", "collision")
    )


def stl(triangles):
    """Return a surface of so many triangles."""
    vertex = "vertex {} {} {}\n".format
    facets = (
        "facet normal 0 0 1\nouter loop\n"
        + vertex(0, 0, 0)
        + vertex(math.cos(i / 9), math.sin(i / 9), 0.1)
        + vertex(math.cos((i + 1) / 9), math.sin((i + 1) / 9), 0.1)
        + "endloop\nendfacet\n"
        for i in range(triangles)
    )
    return f"solid s\n{''.join(facets)}endsolid s\n".encode()


@pytest.mark.long
def test_a_urdf_and_files_of_one_name_are_read_in_one_drop_and_unused_ones_are_named(open_page):
    page = open_page("#/define")
    urdf = SAME_NAMES.format(base=shapes_of("base"), arm=shapes_of("arm")).encode()
    links = [(f"{link}.stl", stl(count)) for link in ("base", "arm") for count in (7, 31)]
    drop(page, ("two.urdf", urdf), *links, ("spare.stl", stl(3)), ("notes.txt", b"by hand"))
    notices = page.get_by_role("list", name="What was found in the files")
    expect(notices).to_contain_text("two.urdf read: 4 of its 4 mesh files found.")
    expect(notices).to_contain_text("Not used by this robot: spare.stl, notes.txt.")
    expect(drawing(page)).to_have_attribute("data-shapes", "2")
    # The page draws the finer one.
    choose(page, 0)
    expect(page.get_by_role("main")).to_contain_text("31 triangles")


@pytest.mark.long
def test_found_and_missing_files_of_a_urdf_are_counted(open_page):
    page = open_page("#/define")
    urdf = SAME_NAMES.format(base=shapes_of("base"), arm=shapes_of("arm")).encode()
    drop(page, ("two.urdf", urdf), ("base.stl", stl(7)))
    # Without a second file, the one serves both.
    expect(missing_files(page)).to_contain_text("2 mesh files found, 2 missing.")
    drop(page, ("arm.stl", stl(7)))
    expect(page.get_by_role("main")).to_contain_text("two.urdf read: 4 of its 4 mesh files found.")
    expect(drawing(page)).to_have_attribute("data-shapes", "2")


@pytest.mark.long
def test_a_xacro_file_is_refused_with_what_to_do(open_page):
    page = open_page("#/define")
    drop(page, ("arm.urdf.xacro", b"<robot/>"), ("base.stl", stl(7)))
    expect(page.get_by_role("main")).to_contain_text("arm.urdf.xacro is a template, not a URDF.")
    expect(chain_rows(page)).to_have_count(0)


@pytest.mark.long
def test_a_urdf_whose_first_axis_points_down_keeps_its_base_frame(open_page, plant):
    page = open_page("#/define")
    drop(page, ("down.urdf", KUKA_LIKE.encode()))
    expect(table_rows(page)).to_have_count(6)
    expect(drawing(page)).to_have_attribute("data-shapes", "7")
    drawn, reported = tools(page)
    # The URDF's chain at position zero, in its base frame.
    assert np.allclose(drawn[:3, 3], [0.1 + 0.025 + 0.56 + 0.515, 0.2, 0.4 + 0.035 + 0.3], atol=1e-6)
    assert np.allclose(drawn, reported, atol=1e-9)
    choose(page, "base")
    assert abs(float(field(page, "base/pose/rpy/0").input_value().replace("−", "-"))) == 180.0
    field(page, "base/pose/xyz/2").fill("100")
    tab(page, "Robot")
    field(page, "units/length").select_option("m")
    settled(page)
    drawn, reported = tools(page)
    assert np.allclose(drawn[2, 3], 0.735 + 0.1, atol=1e-6)
    assert np.allclose(drawn, reported, atol=1e-9)
    button(page, "Save").click()
    expect(save_state(page)).to_have_text("Saved")
    saved = plant.robots / "down" / "robot.toml"
    assert tomllib.loads(saved.read_text())["base"]["pose"]["xyz"] == [0.0, 0.0, 0.1]
    choose(page, "base")
    page.reload()
    expect(table_rows(page)).to_have_count(6)
    choose(page, "base")
    expect(field(page, "base/pose/xyz/2")).to_have_value("0.1")


OPENHRP = b"""#VRML V2.0 utf8
PROTO Joint [ exposedField SFVec3f translation 0 0 0 field SFString jointType "rotate"
              field SFInt32 jointId -1 field SFVec3f jointAxis 0 0 1 field MFFloat ulimit []
              field MFFloat llimit [] exposedField MFNode children [] ]
{ Transform { translation IS translation children IS children } }
PROTO Segment [ exposedField MFNode children [] ] { Group { children IS children } }
PROTO Humanoid [ exposedField MFNode humanoidBody [] ] { Group { children IS humanoidBody } }
DEF ARM Humanoid { humanoidBody [ DEF ROOT Joint { jointType "fixed" children [
  DEF FOOT Segment { children [ Shape { geometry Box { size 0.2 0.2 0.1 } } ] }
  DEF TURN Joint { jointId 0 translation 0 0 0.3 ulimit [ 1.5 ] llimit [ -1.5 ] children [
    DEF TOP Segment { children [ Shape { geometry Box { size 0.1 0.1 0.1 } } ] } ] } ] } ] }
"""


@pytest.mark.long
def test_a_robot_of_openhrp_is_chosen_as_one(open_page, tmp_path):
    file = tmp_path / "arm.wrl"
    file.write_bytes(OPENHRP)
    page = open_page("#/define")
    page.get_by_role("region", name="From a URDF").get_by_label("Choose files…").set_input_files(file)
    expect(table_rows(page)).to_have_count(1)
    expect(drawing(page)).to_have_attribute("data-shapes", "2")
    choose(page, 0)
    limits = [field(page, f"joint/0/limits/{which}").input_value() for which in (0, 1)]
    # 1.5 rad
    assert limits == ["−85.943669", "85.943669"]


@pytest.mark.long
def test_saving_over_a_robot_is_asked_first(open_page, plant):
    page = open_page(drawn=False, refused=True)
    for title in ("First", "Second"):
        page.goto(f"{plant.address}/")
        page.goto(f"{plant.address}/#/define")
        button(page, "Start empty").click()
        tab(page, "Robot")
        field(page, "name").fill("twice")
        field(page, "title").fill(title)
        button(page, "Save").click()
        if title == "Second":
            expect(page.get_by_role("alertdialog")).to_contain_text("Save over it?")
            assert load(plant.robots / "twice").title == "First"
            button(page, "Save over it").click()
        expect(save_state(page)).to_have_text("Saved")
        expect(page).to_have_url(f"{plant.address}/#/define/twice")
    assert load(plant.robots / "twice").title == "Second"


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
def test_ignored_pairs_frames_constraints_and_views_are_kept(open_page, plant):
    page = opened(open_page, "pt500")
    tab(page, "Frames")
    button(page, "Add frame").click()
    field(page, "frame/0/name").fill("camera")
    field(page, "frame/0/link").select_option("column")
    field(page, "frame/0/xyz/1").fill("100")
    tab(page, "Constraints")
    button(page, "Add constraint").click()
    tab(page, "Collisions")
    page.get_by_label("Ignore base and forearm").click(timeout=190_000)
    tab(page, "Views")
    button(page, "Top").click()
    page.get_by_label("Name of a new view").fill("above")
    button(page, "Add from the camera").click()
    tab(page, "Robot")
    field(page, "name").fill("kept")
    settled(page)
    button(page, "Save").click()
    expect(save_state(page)).to_have_text("Saved")
    saved = load(plant.robots / "kept")
    assert [(frame.name, frame.link, frame.xyz) for frame in saved.frames] == [
        ("camera", "column", (0, 100, 0))
    ]
    assert [row.joints for row in saved.constraints] == [{"shoulder": 1.0, "elbow": 1.0}]
    assert {frozenset(pair) for pair in saved.collision.ignore} == {frozenset(("base", "forearm"))}
    view = saved.views["above"]
    # The automatic view from above: three reaches (2.7 m) over 0.45 of one.
    assert (view.target, view.projection) == ((0.0, 0.0, 405.0), "orthographic")
    assert view.eye == pytest.approx((0.0, 0.0, 3105.0), abs=0.2)


# At home the hand is in the base's side, and out of it further along its slide.
TOUCHING = """<robot name="touching">
<link name="base"><collision><geometry><box size="0.3 0.3 0.3"/></geometry></collision></link>
<link name="arm"><collision><origin xyz="0 0 0.4"/>
  <geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
<link name="hand"><collision><origin xyz="0.15 0 0"/>
  <geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
<joint name="turn" type="revolute"><axis xyz="0 0 1"/><parent link="base"/><child link="arm"/>
  <limit lower="-0.1" upper="0.1" velocity="1" effort="1"/></joint>
<joint name="slide" type="prismatic"><axis xyz="1 0 0"/><parent link="arm"/><child link="hand"/>
  <limit lower="-0.1" upper="0.3" velocity="1" effort="1"/></joint>
</robot>"""


@pytest.mark.long
def test_each_pair_of_links_shows_how_it_is_checked_or_why_it_is_ignored(open_page):
    page = open_page("#/define")
    drop(page, ("touching.urdf", TOUCHING.encode()))
    expect(table(page)).to_be_visible()
    tab(page, "Collisions")
    state = page.get_by_role("tabpanel").get_by_role("status")
    expect(state).to_contain_text("One checked pair touches at home", timeout=190_000)
    expect(state).to_contain_text("Pairs checked: 1, ignored: 2")

    def tick(one, other):
        return page.get_by_label(f"Ignore {one} and {other}")

    def row(one, other):
        return page.get_by_role("row").filter(has=tick(one, other))

    # Links one joint apart are ignored by rule: nothing is there to tick.
    expect(tick("base", "arm")).to_be_checked()
    expect(tick("base", "arm")).to_be_disabled()
    expect(row("base", "arm")).to_contain_text("Ignored. They are one joint apart.")
    expect(row("base", "hand")).to_contain_text("They touch at home, as exact meshes too.")
    tick("base", "hand").check()
    expect(row("base", "hand")).to_contain_text("Ignored. The description says so.")
    expect(state).to_contain_text("At home no checked pair touches.")
    tick("base", "hand").uncheck()
    expect(state).to_contain_text("One checked pair touches at home")
    # Another home is another plan, without being asked for.
    choose(page, 1)
    field(page, "joint/1/home").fill("100")
    tab(page, "Collisions")
    expect(state).to_contain_text("At home no checked pair touches.", timeout=190_000)
    expect(row("base", "hand")).to_contain_text("Convex hulls.")
    button(page, "中文").click()
    expect(page.get_by_role("table", name="碰撞")).to_contain_text("两者仅隔一个关节")


@pytest.mark.long
def test_a_plan_of_pairs_that_failed_says_why_and_is_asked_for_again(open_page):
    page = opened(open_page, "pt500", drawn=False, refused=True)
    page.route(
        "**/define/collisions",
        lambda route: route.fulfill(status=422, content_type="text/plain", body="this took too long"),
    )
    tab(page, "Collisions")
    expect(page.get_by_role("tabpanel").get_by_role("alert")).to_contain_text(
        "could not be worked out: this took too long"
    )
    page.unroute("**/define/collisions")
    button(page, "Try again").click()
    expect(page.get_by_role("tabpanel").get_by_role("status")).to_contain_text(
        "Pairs checked: 10, ignored: 5", timeout=190_000
    )


@pytest.mark.long
def test_renaming_a_joint_and_a_link_leaves_nothing_that_names_the_old(open_page):
    page = opened(open_page, "pt500", drawn=False)
    tab(page, "Constraints")
    button(page, "Add constraint").click()
    tab(page, "Frames")
    button(page, "Add frame").click()
    choose(page, 4)
    field(page, "joint/4/link/name").fill("plate")
    choose(page, 1)
    field(page, "joint/1/name").fill("lift")
    settled(page)
    expect(checks(page)).to_contain_text("Nothing is wrong with it.")
    tab(page, "Frames")
    expect(field(page, "frame/0/link")).to_have_value("plate")
    tab(page, "Constraints")
    expect(field(page, "constraint/0/joints/lift")).to_have_value("1")


@pytest.mark.long
def test_a_robot_that_is_not_here_is_said(open_page):
    page = open_page("#/define/nobody", drawn=False, refused=True)
    expect(refusal(page)).to_contain_text("nobody cannot be opened: there is no robot")
