"""The soft shadow on the floor: sharp where a body touches it, wide and faint below what is high."""

import cv2
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float32]

# What the shadow map holds where nothing is above the floor [m], and what is surely less.
NOTHING = 1e6
_ANY_HEIGHT = 1e3

# (up to this height, blurred by this much, this dark), heights and widths over the scene's radius.
_LAYERS = (
    (0.04, 0.030, 0.75),
    (0.20, 0.045, 0.50),
    (0.55, 0.075, 0.42),
    (_ANY_HEIGHT, 0.11, 0.34),
)


def soft_shadow(heights: FloatArray, *, texel: float) -> FloatArray:
    """How much light each place of the floor lacks, 0 to 1.

    A large lamp's shadow is the wider and the fainter the higher its caster is, so each slice of
    height is blurred by its own width, and the slices are laid over each other.

    Args:
        heights: (n, n) height of the lowest body above the place, over the scene's radius;
            `NOTHING` where there is none.
        texel: Width of a place, over the scene's radius.
    """
    light = np.ones_like(heights)
    bottom = 0.0
    for top, width, dark in _LAYERS:
        inside = (heights >= bottom) & (heights < top)
        if inside.any():
            light *= 1.0 - dark * cv2.GaussianBlur(inside.astype(np.float32), (0, 0), width / texel)
        bottom = top
    return 1.0 - light
