"""Cameras: projection of points, and fitting."""

import numpy as np
import pytest

from renderer.scene.cameras import Camera, close_up, fitted, pixels, site_to_camera

SIZE = (640, 360)
TOP = Camera(np.array([0, 0, 3.0]), np.zeros(3), np.array([0, 1.0, 0]), half_height=0.9)


def test_a_top_view_shows_x_to_the_right_and_y_upwards_to_scale():
    points = np.array([[0.0, 0.0, 0.5], [0.4, 0.0, 0.1], [0.0, 0.45, 0.9]])
    # 180 px for 0.9 m, independent of the height.
    assert pixels(TOP, SIZE, points) == pytest.approx(np.array([[320, 180], [400, 180], [320, 90]]))


def test_a_perspective_target_is_in_the_centre_and_closer_bodies_are_larger():
    camera = Camera(np.array([2.0, -1.0, 1.5]), np.array([0.1, 0.2, 0.3]), np.array([0, 0, 1.0]))
    assert pixels(camera, SIZE, camera.target[None]) == pytest.approx(np.array([[320.0, 180.0]]))
    up = np.array([0.0, 0.0, 0.1])
    near, far = camera.target - camera.forward, camera.target + camera.forward
    rows = [pixels(camera, SIZE, np.array([at, at + up]))[:, 1] for at in (near, far)]
    assert rows[0][0] - rows[0][1] > 1.5 * (rows[1][0] - rows[1][1]) > 0


@pytest.mark.parametrize("half_height", [1.0, None])
def test_a_fitted_camera_shows_every_point_and_wastes_little(half_height):
    random = np.random.default_rng(1)
    points = random.uniform(-1, 1, (200, 3)) * [0.8, 0.6, 0.5] + [3.0, 0.0, 0.2]
    start = Camera(np.array([4.5, -2, 1.5]), np.array([3.0, 0, 0.2]), np.array([0, 0, 1.0]), half_height)
    camera = fitted(start, SIZE[0] / SIZE[1], points)
    assert camera.forward == pytest.approx(start.forward)
    shares = pixels(camera, SIZE, points) / SIZE * 2 - 1
    assert 0.9 < np.abs(shares).max() < 1.0
    # Equal margins on both sides, in the direction that determines the scale.
    tight = np.abs(shares).max(axis=0).argmax()
    assert shares[:, tight].min() == pytest.approx(-shares[:, tight].max(), abs=1e-6)


def test_a_close_up_moves_only_when_its_object_no_longer_fills_it():
    random = np.random.default_rng(1)
    points = random.uniform(-0.5, 0.5, (200, 3)) + np.array([3.0, 0.0, 0.5])
    far = Camera(np.array([9.0, -6, 3.5]), np.array([3.0, 0, 0.2]), np.array([0, 0, 1.0]))
    aspect = SIZE[0] / SIZE[1]
    near = close_up(far, aspect, points)
    shares = pixels(near, SIZE, points) / SIZE
    assert 0.7 < np.ptp(shares[:, 1]) < 0.9
    assert close_up(near, aspect, points + 0.02) is near
    for elsewhere in (points + np.array([0.0, 0.0, 0.6]), points * 0.5):
        moved = close_up(near, aspect, elsewhere)
        assert moved is not near
        shares = pixels(moved, SIZE, elsewhere) / SIZE
        assert (shares > 0).all()
        assert (shares < 1).all()


def test_a_view_direction_along_up_is_possible():
    camera = Camera(np.array([0, 0, 3.0]), np.zeros(3), np.array([0, 0, 1.0]), half_height=1.0)
    rotation = site_to_camera(camera)[:3, :3]
    assert rotation @ rotation.T == pytest.approx(np.eye(3))
    assert np.linalg.det(rotation) == pytest.approx(1.0)
