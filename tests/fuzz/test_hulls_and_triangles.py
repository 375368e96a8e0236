"""A run with some hundred poses; `python -m tests.fuzz.hulls_and_triangles` runs 10,000."""

import pytest

from tests.fuzz.hulls_and_triangles import compare


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["pt600", "puma560"])
def test_hulls_miss_no_collision_that_shapes_show(robot: str) -> None:
    count = compare(robot, 150, seed=5)
    assert count.missed == []
    # Poses of which none collides, or all do, would have shown nothing.
    assert 0 < count.colliding[0] < 100
    assert count.meshes <= count.hulls
