"""Room for views that are asked for: all together, and each name's share."""

from types import SimpleNamespace

import pytest

from renderer.errors import NoRoomError, ViewRequestError
from renderer.requested_views import Shot
from renderer.service import Settings
from renderer.view_budget import Room
from robomesh.errors import QuotaError


def room(**changed):
    """As a renderer's own settings have it."""
    settings = Settings(site="hall")
    width, height = settings.size
    own = width * height * settings.fps
    values = {"most_views": settings.most_views, "quota": settings.quotas.views, "again_s": 5.0}
    return Room(**({"own_pixels_per_s": own} | values | changed))


def shot(width=320, height=180, fps=15.0):
    return Shot(name="free-1", of="front", size=(width, height), fps=fps, requested=True)


def views(*askers, of=None):
    return [SimpleNamespace(shot=of or shot(), askers=list(each)) for each in askers]


def test_the_largest_view_is_within_everybody_s_share_and_a_second_one_is_not():
    largest = shot(1920, 1080, 30.0)
    room().check([], largest, "li")
    there = views(["li"], of=shot())
    room().check(there, shot(), "li")
    with pytest.raises(
        QuotaError, match=r"li has 1 views already: .* together 55\.3 million pixels a second"
    ):
        room().check(there, largest, "li")
    room().check(there, shot(1280, 720, 30.0), "wang")
    with pytest.raises(NoRoomError, match=r"48\.4 of 110\.6 million are left"):
        room().check(views(["li"], of=largest), largest, "wang")


def test_what_never_has_room_is_told_so_and_what_would_have_it():
    fastest = shot(1920, 1080, 60.0)
    with pytest.raises(ViewRequestError, match=r"124\.4 million .* 53 a second is possible") as caught:
        room().check([], fastest, "li")
    assert not isinstance(caught.value, NoRoomError)
    room().check([], shot(1920, 1080, 53.0), "li")
    # As a site file with a GPU behind it has it.
    room(own_pixels_per_s=1920 * 1080 * 60.0).check([], fastest, "li")


def test_a_view_that_another_asked_for_too_counts_for_that_one_before_its_asker_is_refused():
    there = views(["li", "wang"], ["li"])
    small = room(quota=2)
    small.check(there, shot(), "li")
    assert [view.askers for view in there] == [["wang", "li"], ["li"]]
    there += views(["li"])
    with pytest.raises(QuotaError, match="li has 2 views already: quota views = 2 a name"):
        small.check(there, shot(), "li")
    # Who has a whole share is given nothing.
    there = views(["li", "wang"], ["li"], ["wang"], ["wang"])
    with pytest.raises(QuotaError):
        small.check(there, shot(), "li")
    assert there[0].askers == ["li", "wang"]


def test_without_views_that_may_be_asked_for_there_is_no_room():
    with pytest.raises(NoRoomError, match="0 are possible"):
        room(most_views=0).check([], shot(), "li")


def test_a_slow_view_counts_for_the_memory_that_it_holds():
    slow = shot(1920, 1080, 1.0)
    room().check(views(["li"], of=slow), slow, "li")
    with pytest.raises(QuotaError, match="li has 2 views already"):
        room().check(views(["li"], ["li"], of=slow), slow, "li")
