"""A target that would collide, or is beyond a limit, is reported while it is chosen, before it is sent."""

import re

import pytest
from playwright.sync_api import expect

from robots.descriptions.cells import Fixture
from robots.schema.robot_toml import Pose
from services.site_file.tables.fixtures import Fixture as FixtureRow
from services.site_file.tables.fixtures import fixture_shape, fixture_to_site
from tests.browser.robot_page import ARM, audited, button, drag, joints_notice, ready

pytestmark = [pytest.mark.long, pytest.mark.browser]

ROBOTS = ("arm",)
# In the way of the wrist at 45 degrees of the waist.
POST = FixtureRow(cell="", name="post", cylinder=(40.0, 900.0), pose=Pose(xyz=(300.0, 300.0, 450.0)))
FIXTURES = (Fixture(POST.name, (fixture_shape(POST),), fixture_to_site(POST)),)


def test_a_target_that_would_collide_is_told_before_it_is_sent(open_page, plant):
    page = open_page(ARM, drawn=False)
    ready(page)
    before = audited(plant, "MOVE_ABSOLUTE")
    notice = joints_notice(page)
    value = page.get_by_label("Type a target of waist")
    value.click()
    value.fill("45")
    expect(notice).to_have_text(re.compile("^Target waist: 45.00°, not sent yet. .*post"))
    value.fill("-20")
    expect(notice).to_have_text("Target waist: −20.00°, not sent yet")
    value.press("Escape")
    # On its way there the slider passes the post.
    drag(page, "waist", 40, release=False)
    expect(notice).to_have_text(re.compile("^Target waist: .*, not sent yet. .*post"))
    page.keyboard.press("Escape")
    page.mouse.up()
    assert audited(plant, "MOVE_ABSOLUTE") == before
    button(page, "Release").click()
