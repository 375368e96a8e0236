"""The soft shadow on the floor: sharp where a body touches it, wide and faint below what is high."""

import cv2
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float32]

# What the shadow map holds where nothing is above the floor.
NOTHING = 1e6

# (up to this height, blurred by this much, this dark), heights and widths over the scene's radius.
_LAYERS = (
    (0.05, 0.025, 0.62),
    (0.25, 0.05, 0.36),
    (0.60, 0.09, 0.34),
    (1e9, 0.15, 0.26),
)


def soft_shadow(heights: FloatArray, *, texel: float) -> FloatArray:
    """How much light each place of the floor lacks, 0 to 1.

    A large lamp's shadow is as wide as its caster is high, so each slice of height is blurred
    by its own width and the slices are laid over each other.

    Args:
        heights: (n, n) height of the lowest body above the place, over the scene's radius;
            `NOTHING` where there is none.
        texel: Width of a place, over the scene's radius.
    """
    light = np.ones_like(heights)
    below = np.zeros(heights.shape, dtype=bool)
    for top, width, dark in _LAYERS:
        # What is lower belongs to the slice too: a post's foot is part of its top's shadow.
        inside = heights < min(top, NOTHING)
        if inside.any() and (inside & ~below).any():
            blurred = cv2.GaussianBlur(inside.astype(np.float32), (0, 0), max(width / texel, 0.6))
            light *= 1.0 - dark * blurred
        below |= inside
    return 1.0 - light
