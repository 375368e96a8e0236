"""Limits of requested views: for all together, and for each operator."""

from types import SimpleNamespace

import pytest

from renderer.errors import NoRoomError, ViewRequestError
from renderer.pictures.requested_views import ViewSpec
from renderer.service import Settings
from renderer.service.view_budget import ViewBudget
from robomesh.errors import QuotaError


def budget(**changed):
    """Return the budget of a renderer's default settings, with changes."""
    settings = Settings(site="hall")
    width, height = settings.size
    own = width * height * settings.fps
    values = {"most_views": settings.most_views, "quota": settings.quotas.views, "again_s": 5.0}
    return ViewBudget(**({"own_pixels_per_s": own} | values | changed))


def spec(width=320, height=180, fps=15.0):
    return ViewSpec(name="free-1", of="front", size=(width, height), fps=fps, requested=True)


def views(*askers, of=None):
    return [SimpleNamespace(spec=of or spec(), askers=list(each)) for each in askers]


def test_the_largest_view_is_within_each_operators_share_and_a_second_one_is_not():
    largest = spec(1920, 1080, 30.0)
    budget().check([], largest, "li")
    existing = views(["li"], of=spec())
    budget().check(existing, spec(), "li")
    with pytest.raises(
        QuotaError, match=r"li already has 1 views: .* together 55\.3 million pixels a second"
    ):
        budget().check(existing, largest, "li")
    budget().check(existing, spec(1280, 720, 30.0), "wang")
    with pytest.raises(NoRoomError, match=r"48\.4 of 110\.6 million are left"):
        budget().check(views(["li"], of=largest), largest, "wang")


def test_a_view_above_the_total_limit_is_rejected_with_a_possible_rate():
    fastest = spec(1920, 1080, 60.0)
    with pytest.raises(ViewRequestError, match=r"124\.4 million .* 53 a second is possible") as caught:
        budget().check([], fastest, "li")
    assert not isinstance(caught.value, NoRoomError)
    budget().check([], spec(1920, 1080, 53.0), "li")
    # The settings of a site with a GPU.
    budget(own_pixels_per_s=1920 * 1080 * 60.0).check([], fastest, "li")


def test_a_view_with_two_askers_is_reassigned_before_a_request_is_rejected():
    existing = views(["li", "wang"], ["li"])
    small = budget(quota=2)
    small.check(existing, spec(), "li")
    assert [view.askers for view in existing] == [["wang", "li"], ["li"]]
    existing += views(["li"])
    with pytest.raises(QuotaError, match="li already has 2 views: quota views = 2 for each name"):
        small.check(existing, spec(), "li")
    # No view is reassigned to an operator with a used-up share.
    existing = views(["li", "wang"], ["li"], ["wang"], ["wang"])
    with pytest.raises(QuotaError):
        small.check(existing, spec(), "li")
    assert existing[0].askers == ["li", "wang"]


def test_most_views_of_zero_rejects_every_request():
    with pytest.raises(NoRoomError, match="0 are possible"):
        budget(most_views=0).check([], spec(), "li")


def test_a_slow_view_counts_for_its_memory():
    slow = spec(1920, 1080, 1.0)
    budget().check(views(["li"], of=slow), slow, "li")
    with pytest.raises(QuotaError, match="li already has 2 views"):
        budget().check(views(["li"], ["li"], of=slow), slow, "li")
