"""Limits of requested views: for all of them together, and for each operator."""

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Protocol

from renderer.errors import NoRoomError, ViewRequestError
from renderer.pictures.requested_views import ViewSpec
from robomesh import reason_codes as codes
from robomesh.errors import QuotaError

# Share of the `most_views` views that may have the size and rate of the renderer's own views, or at least
# this cost.
_FULL_VIEWS = 0.125
_FULL_PIXELS_PER_S = 1280 * 720 * 30.0


class RequestedView(Protocol):
    """A requested view.

    Attributes:
        askers: The operators who requested it; it counts for the first one.
    """

    spec: ViewSpec
    askers: list[str]


@dataclass(frozen=True, kw_only=True)
class ViewBudget:
    """Limits of the number and cost of requested views.

    Attributes:
        most_views: Largest number of views of all askers together.
        quota: Largest number of views of each asker.
        own_pixels_per_s: Cost of one of the renderer's own views.
        again_s: Time for which an unwatched view is kept [s].
    """

    most_views: int
    quota: int
    own_pixels_per_s: float
    again_s: float

    def check(self, views: Collection[RequestedView], spec: ViewSpec, asker: str) -> None:
        """Check that one more view may be drawn.

        Watchers are anonymous, askers are not. So a view counts for its first asker while it exists. If it
        has other askers too, it is reassigned to one of them before a request of its first asker is rejected.

        Args:
            views: The requested views that exist.

        Raises:
            ViewRequestError: If the view alone exceeds the limit.
            NoRoomError: If it exceeds what the existing views leave.
            QuotaError: If it exceeds the asker's quota.
        """
        if len(views) >= self.most_views:
            raise NoRoomError(codes.VIEWS_TOO_MANY(count=len(views), most=self.most_views))
        most = self._most_pixels_per_s
        if spec.pixels_per_s > most:
            possible = math.floor(most / (spec.size[0] * spec.size[1]))
            raise ViewRequestError(
                codes.VIEW_TOO_COSTLY(**_cost(spec), most_megapixels=most / 1e6, possible=possible)
            )
        left = most - _pixels_per_s(views)
        if spec.pixels_per_s > left:
            left_megapixels = max(left, 0.0) / 1e6
            raise NoRoomError(
                codes.VIEWS_TOO_COSTLY(
                    **_cost(spec), left_megapixels=left_megapixels, most_megapixels=most / 1e6
                )
            )
        while not self._fits(views, spec, asker):
            if not self._reassign(views, asker):
                had = len(_views_of(views, asker))
                reason = codes.QUOTA_VIEWS(
                    asker=asker,
                    count=had,
                    most=self.quota,
                    megapixels=self._share / 1e6,
                    seconds=self.again_s,
                )
                raise QuotaError(reason, again_s=self.again_s)

    def _fits(self, views: Collection[RequestedView], spec: ViewSpec, asker: str) -> bool:
        """Return whether a view is within the asker's share; a single view always is, whatever its size."""
        had = _views_of(views, asker)
        return len(had) < self.quota and (not had or _pixels_per_s(had) + spec.pixels_per_s <= self._share)

    def _reassign(self, views: Collection[RequestedView], asker: str) -> bool:
        """Let one of the asker's views count for another of its askers; return whether that was possible."""
        for view in _views_of(views, asker):
            for other in view.askers[1:]:
                if self._fits(views, view.spec, other):
                    view.askers.remove(other)
                    view.askers.insert(0, other)
                    return True
        return False

    @property
    def _most_pixels_per_s(self) -> float:
        return max(self.most_views * _FULL_VIEWS, 1.0) * self._full_pixels_per_s

    @property
    def _share(self) -> float:
        """Each asker's share of the pixels per second."""
        return max(self._most_pixels_per_s * self.quota / self.most_views, self._full_pixels_per_s)

    @property
    def _full_pixels_per_s(self) -> float:
        return max(self.own_pixels_per_s, _FULL_PIXELS_PER_S)


def _views_of(views: Collection[RequestedView], asker: str) -> list[RequestedView]:
    return [view for view in views if view.askers[:1] == [asker]]


def _cost(spec: ViewSpec) -> dict[str, float]:
    width, height = spec.size
    return {"width": width, "height": height, "fps": spec.fps, "megapixels": spec.pixels_per_s / 1e6}


def _pixels_per_s(views: Collection[RequestedView]) -> float:
    return sum(view.spec.pixels_per_s for view in views)
