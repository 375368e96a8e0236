"""Choice of each body's level of detail by the size of its error in the picture."""

from bisect import bisect_right
from collections.abc import Sequence

from renderer.drawing.opengl import Uploaded
from renderer.scene.cameras import Camera, FloatArray
from renderer.scene.scene import Part

# Largest error of a level in a picture [px], by the bound of the simplifier: the real distance was at most
# 0.6 of it, half a pixel.
_MOST_PX = 0.85
# A body keeps its level until the error that is allowed changes by this factor, so that nothing flickers.
_KEEPS = 1.2
_MOST_KEPT = 10_000


class LevelsOfDetail:
    """The levels of the bodies of a drawing's cameras."""

    def __init__(self) -> None:
        self._kept: dict[tuple[bytes, int, str], int] = {}

    def of(self, bodies: Sequence[tuple[Part, Uploaded]], camera: Camera, scales: FloatArray) -> list[int]:
        """Return the level of each body.

        Args:
            scales: (n,) of the bodies in the picture [px/m].
        """
        if len(self._kept) > _MOST_KEPT:
            self._kept.clear()
        view = camera.eye.tobytes() + camera.target.tobytes()
        found = []
        for number, ((part, uploaded), allowed) in enumerate(
            zip(bodies, (_MOST_PX / scales).tolist(), strict=True)
        ):
            key = (view, number, part.shape)
            level = next_level(uploaded.errors, allowed, self._kept.get(key))
            self._kept[key] = level
            found.append(level)
        return found


def next_level(errors: Sequence[float], allowed: float, before: int | None) -> int:
    """Return the coarsest level with an allowed error, or the level before while it is nearly that.

    Args:
        errors: Of the levels [m], ascending from 0.
        allowed: Largest error [m].
        before: Level in the picture before; None: there is none.
    """
    if before is not None and before < len(errors):
        finest = bisect_right(errors, allowed / _KEEPS) - 1
        coarsest = bisect_right(errors, allowed * _KEEPS) - 1
        return min(max(before, finest), coarsest)
    return bisect_right(errors, allowed) - 1
