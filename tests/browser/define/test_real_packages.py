"""Real robots' packages dropped flat: a URDF, and meshes whose names visual and collision folders share."""

import pytest
from playwright.sync_api import expect

from tests.browser.define.page import drawing, drop

pytestmark = [pytest.mark.long, pytest.mark.browser]


@pytest.mark.parametrize(
    ("package", "urdf", "meshes", "joints"),
    [
        ("abb_irb2400_support", "irb2400_12_155.urdf", 18, 6),
        ("motoman_gp8_support", "gp8.urdf", 14, 6),
    ],
)
def test_a_real_package_dropped_in_one_go_is_read_whole(open_page, shared, package, urdf, meshes, joints):
    files = sorted(each for each in (shared / "testdata/urdf" / package).rglob("*") if each.is_file())
    page = open_page("#/define")
    drop(page, *((each.name, each.read_bytes()) for each in files))
    read = page.get_by_role("list", name="What was found in the files")
    expect(read).to_contain_text(f"{urdf} read: {meshes} of its {meshes} mesh files found.")
    expect(read).to_contain_text("package.xml")
    expect(drawing(page)).to_have_attribute("data-shapes", str(joints + 1))
    assert drawing(page).bounding_box()["height"] > 250
