"""Comparison with stored pictures, with tolerance for other drivers, but not for visible differences.

`make_pictures.py` makes the stored pictures.
"""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from renderer.drawing import drawing
from renderer.drawing.shadow import FloorShadow
from renderer.scene.scene import Finish
from tests.renderer.bodies import context_or_skip
from tests.renderer.make_pictures import PICTURES, STORED, free
from tests.renderer.renderer_site import shared_shapes

# Levels of 255, after a blur that removes small differences of edges between rasterisers.
_BLUR_PX = 5
_MOST, _MOST_ON_AVERAGE = 20.0, 0.8


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    context_or_skip().release()
    return shared_shapes(tmp_path_factory.mktemp("pictures"))


def like_stored(picture, name):
    stored = cv2.imread(str(PICTURES / f"{name}.png"))[..., ::-1]
    blurred = (cv2.blur(each.astype(np.float32), (_BLUR_PX, _BLUR_PX)) for each in (picture, stored))
    difference = np.abs(np.subtract(*blurred))
    return bool(difference.max() < _MOST and difference.mean() < _MOST_ON_AVERAGE)


@pytest.mark.parametrize("name", STORED)
@pytest.mark.slow
def test_a_picture_matches_the_stored_one(name, folder):
    assert like_stored(STORED[name](folder), name)


def without_its_flange(scene):
    return replace(scene, parts=scene.parts[:-1])


def with_a_red_forearm(scene):
    red = (replace(part, finish=Finish.RED) if part.name == "forearm" else part for part in scene.parts)
    return replace(scene, parts=tuple(red))


@pytest.mark.parametrize("change", [without_its_flange, with_a_red_forearm])
@pytest.mark.slow
def test_a_missing_link_or_another_colour_is_detected(change, folder):
    assert not like_stored(free(folder, change=change), "free")


@pytest.mark.slow
def test_another_lamp_is_detected(folder, monkeypatch):
    monkeypatch.setattr(drawing, "KEY", (0.0, 0.0, -1.0))
    assert not like_stored(free(folder), "free")


@pytest.mark.slow
def test_a_missing_shadow_is_detected(folder, monkeypatch):
    monkeypatch.setattr(FloorShadow, "lay", lambda *_, **__: None)
    assert not like_stored(free(folder), "free")
