"""Thinning of a resting arm's joint states: all of a moving arm, none that differs, some of a resting one."""

import math
import random
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol_gateway.telemetry.thinning import LONGEST_S, SETTLED_S, Thinning
from robots.kinematics.joints import JointType
from tests.protocol_gateway.gateway_site import gateway, until
from tests.protocol_gateway.scripted_controller import repeated, scripted_controller

TYPES = (JointType.ROTARY, JointType.PRISMATIC)
REST = (0.5, 0.1)
BAND = (1e-4, 1e-5)
PERIOD_S = 0.01


def published(positions, *, rests=lambda s: True, stale_after_s=1.0, thinning=None):
    """Return the numbers of the units of a controller at 100 Hz that are published."""
    thinning = thinning or Thinning(TYPES, stale_after_s)
    return [
        number
        for number, each in enumerate(positions)
        if thinning.publishes(each, number * PERIOD_S, rests=rests(number * PERIOD_S))
    ]


def steps(numbers):
    return {later - earlier for earlier, later in pairwise(numbers)}


def test_an_arm_at_rest_is_published_ten_times_a_second_once_it_has_settled():
    thinning = Thinning(TYPES, 1.0)
    numbers = published([REST] * 1000, thinning=thinning)
    settled = round(SETTLED_S / PERIOD_S)
    assert numbers[:settled] == [*range(settled)]
    assert steps(numbers[settled:]) <= {9, 10, 11}
    assert thinning.thinned == 1000 - len(numbers)


def test_the_last_digits_of_encoders_are_rest():
    flickering = [
        (REST[0] + 0.4 * BAND[0] * (-1) ** k, REST[1] - 0.4 * BAND[1] * (k % 3 - 1)) for k in range(1000)
    ]
    assert len(published(flickering)) < 160


@pytest.mark.parametrize("joint", [0, 1])
def test_every_unit_is_published_from_the_one_that_left_the_band(joint):
    moved = [list(REST) for _ in range(400)]
    for k in range(300, 400):
        moved[k][joint] += 1.1 * BAND[joint] + (k - 300) * BAND[joint]
    numbers = published([tuple(each) for each in moved])
    assert [number for number in numbers if number >= 300] == [*range(300, 400)]
    assert len(numbers) < 180


def test_every_unit_is_published_while_the_arm_is_busy_and_shortly_after():
    numbers = published([REST] * 1000, rests=lambda s: not 2.0 <= s < 4.0)
    assert set(numbers) >= {*range(200, 400 + round(SETTLED_S / PERIOD_S) - 1)}
    assert len(numbers) < 400


def test_arms_that_rest_are_published_at_the_same_times():
    arms = [Thinning(TYPES, 1.0) for _ in range(2)]
    numbers = [
        [k for k in range(500) if arm.publishes(REST, k * PERIOD_S + late_s, rests=True)]
        for arm, late_s in zip(arms, (0.0, 0.003), strict=True)
    ]
    assert all(abs(one - other) <= 1 for one, other in zip(*(each[-20:] for each in numbers), strict=True))


def test_positions_after_a_lost_link_are_published():
    thinning = Thinning(TYPES, 1.0)
    published([REST] * 200, thinning=thinning)
    thinning.forget()
    assert thinning.publishes(REST, 2.001, rests=True)


def test_a_short_stale_time_keeps_five_states_in_it():
    numbers = published([REST] * 1000, stale_after_s=0.1)
    assert max(steps(numbers)) * PERIOD_S <= 0.1 / 5 + PERIOD_S


def test_a_controller_slower_than_the_rate_at_rest_is_not_thinned():
    thinning = Thinning(TYPES, 1.0)
    assert all(thinning.publishes(REST, 1.02 * LONGEST_S * k, rests=True) for k in range(100))


@given(st.lists(st.floats(-3e-4, 3e-4), min_size=1, max_size=300))
def test_no_unit_is_left_out_that_differs_from_the_last_published_one(steps):
    thinning, position, last = Thinning(TYPES, 1.0), 0.0, math.nan
    for k, step in enumerate(steps):
        position += step
        if thinning.publishes((position, 0.0), k * PERIOD_S, rests=True):
            last = position
        assert abs(position - last) <= BAND[0]


@pytest.mark.parametrize("thins", [True, False])
async def test_a_gateway_leaves_out_states_of_an_arm_at_rest_and_counts_them(mesh, tmp_path, thins):
    turned_deg = 0.0

    def state():
        flicker_deg = random.choice((0.0, 0.001))
        return f"2#ABSOLUTE.DEG*{turned_deg + flicker_deg:.3f};0;0;0;0&STATUS*idle;remote;homed@"

    async with (
        scripted_controller() as (port, say, _),
        repeated(say, state),
        gateway(mesh, tmp_path, port, thin_at_rest=thins) as site,
    ):
        async for sample in site.session.subscribe(site.key("units")):
            counts = sample.message()
            if counts.received >= 300:
                break
        assert (counts.thinned > counts.received / 2) == thins
        assert counts.lost == counts.malformed == counts.skipped == 0
        # The first ones were published before the monitor had subscribed.
        await until(lambda: len(site.seen["joints"]) > counts.received - counts.thinned - 50)
        turned_deg = 1.0
        await until(lambda: site.joints[0] > math.radians(0.9))
