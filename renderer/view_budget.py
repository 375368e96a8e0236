"""Room for views that are asked for: what all of them may cost together, and each name's share."""

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Protocol

from renderer.errors import NoRoomError, ViewRequestError
from renderer.requested_views import Shot
from robomesh import reason_codes as codes
from robomesh.errors import QuotaError

# Of as many views as may be asked for, so many may be as large and fast as the renderer's own, or as this.
_FULL_VIEWS = 0.125
_FULL_PIXELS_PER_S = 1280 * 720 * 30.0


class AskedFor(Protocol):
    """A view that somebody asked for.

    Attributes:
        askers: In whose names; it counts for the first one.
    """

    shot: Shot
    askers: list[str]


@dataclass(frozen=True, kw_only=True)
class Room:
    """What may be drawn of what is asked for.

    Attributes:
        most_views: Of all askers together.
        quota: Of those, of each asker.
        own_pixels_per_s: What one of the renderer's own views costs.
        again_s: How long a view stays after its last watcher left.
    """

    most_views: int
    quota: int
    own_pixels_per_s: float
    again_s: float

    def check(self, views: Collection[AskedFor], shot: Shot, asker: str) -> None:
        """Whether one more may be drawn.

        Who watches is known to nobody, who asked is. So a view counts for who asked first, as long as it
        is there; one that others asked for too is passed on to them before its asker is refused.

        Args:
            views: Those that are drawn because somebody asked.

        Raises:
            ViewRequestError: If there never is room for it here.
            NoRoomError: If there is no place for it, whoever asks.
            QuotaError: If this asker has its share.
        """
        if len(views) >= self.most_views:
            raise NoRoomError(
                f"{len(views)} views were asked for already, and {self.most_views} are possible "
                "(most_views of the site file's [renderer]): ask again when some of them end"
            )
        most = self._most_pixels_per_s
        if shot.pixels_per_s > most:
            raise ViewRequestError(
                f"{_cost(shot)}: {most / 1e6:.1f} million is all that there is for views that are asked for; "
                f"{math.floor(most / (shot.size[0] * shot.size[1]))} a second is possible, more with a "
                "larger size, fps or most_views in the site file's [renderer]"
            )
        left = most - _pixels_per_s(views)
        if shot.pixels_per_s > left:
            raise NoRoomError(
                f"{_cost(shot)}: {max(left, 0.0) / 1e6:.1f} of {most / 1e6:.1f} million are left "
                "for views that are asked for; ask for a smaller or slower one"
            )
        while not self._fits(views, shot, asker):
            if not self._passed_on(views, asker):
                had = len(_had(views, asker))
                reason = codes.QUOTA_VIEWS(
                    asker=asker,
                    count=had,
                    most=self.quota,
                    megapixels=self._share / 1e6,
                    seconds=self.again_s,
                )
                raise QuotaError(reason, again_s=self.again_s)

    def _fits(self, views: Collection[AskedFor], shot: Shot, asker: str) -> bool:
        """Whether a view is within somebody's share; one alone always is, whatever its size."""
        had = _had(views, asker)
        return len(had) < self.quota and (not had or _pixels_per_s(had) + shot.pixels_per_s <= self._share)

    def _passed_on(self, views: Collection[AskedFor], asker: str) -> bool:
        """Let one of somebody's views count for another who asked for it; False: there is none."""
        for view in _had(views, asker):
            for other in view.askers[1:]:
                if self._fits(views, view.shot, other):
                    view.askers.remove(other)
                    view.askers.insert(0, other)
                    return True
        return False

    @property
    def _most_pixels_per_s(self) -> float:
        return max(self.most_views * _FULL_VIEWS, 1.0) * self._full_pixels_per_s

    @property
    def _share(self) -> float:
        """Each asker's, of the pixels a second."""
        return max(self._most_pixels_per_s * self.quota / self.most_views, self._full_pixels_per_s)

    @property
    def _full_pixels_per_s(self) -> float:
        return max(self.own_pixels_per_s, _FULL_PIXELS_PER_S)


def _had(views: Collection[AskedFor], asker: str) -> list[AskedFor]:
    return [view for view in views if view.askers[:1] == [asker]]


def _cost(shot: Shot) -> str:
    size = f"{shot.size[0]} x {shot.size[1]}"
    return f"{size} at {shot.fps:g} a second counts for {shot.pixels_per_s / 1e6:.1f} million pixels a second"


def _pixels_per_s(views: Collection[AskedFor]) -> float:
    return sum(view.shot.pixels_per_s for view in views)
