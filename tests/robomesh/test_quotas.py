"""Quotas: what one name may ask for, told in words, asked for again when there is some."""

import pytest

from robomesh import quotas
from robomesh.errors import QuotaError
from robomesh.metrics import SessionMetrics
from robomesh.quotas import Quota
from robomesh.schemas.robomesh_pb2 import CheckAnswer, CheckRequest
from robomesh.session import open_session
from tests.conftest import run


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def had(quota, asker):
    """How much somebody is given now."""
    for number in range(1000):
        try:
            with quota.one(asker):
                pass
        except QuotaError:
            return number
    raise AssertionError("there is no end")


def test_a_minutes_worth_comes_at_once_and_then_what_time_gives_back():
    clock = Clock()
    quota = Quota("checks", a_minute=30, clock=clock)
    assert had(quota, "li") == 30
    assert had(quota, "wang") == 30
    with pytest.raises(QuotaError, match=r"li has used up its quota: checks_a_minute = 30 .* try again in"):
        quota.check("li", 1.0)
    clock.now += 10.0
    assert had(quota, "li") == 5
    clock.now += 1000.0
    assert had(quota, "li") == 30


def test_what_is_counted_afterwards_is_owed_until_time_has_given_it_back():
    clock = Clock()
    quota = Quota("recordings_mib", a_minute=60, clock=clock)
    quota.check("li")
    quota.count("li", 90.0)
    with pytest.raises(QuotaError) as caught:
        quota.check("li")
    assert caught.value.again_s == pytest.approx(30.0)
    clock.now += 30.1
    quota.check("li")


def test_so_many_are_under_way_at_once_and_their_places_are_given_back():
    quota = Quota("checks", at_once=2, a_minute=1e9)
    with quota.one("li"), quota.one("li"):
        with (
            pytest.raises(QuotaError, match="li already has 2 requests in progress: quota checks = 2"),
            quota.one("li"),
        ):
            pass
        with quota.one("wang"):
            pass
    assert had(Quota("checks", at_once=2, a_minute=5), "li") == 5
    with pytest.raises(ZeroDivisionError), quota.one("li"):
        raise ZeroDivisionError
    with quota.one("li"), quota.one("li"):
        pass


def test_a_flood_of_names_takes_no_memory(monkeypatch):
    monkeypatch.setattr(quotas, "_MOST_ASKERS", 10)
    clock = Clock()
    quota = Quota("checks", a_minute=10, clock=clock)
    assert had(quota, "li") == 10
    for number in range(100):
        quota.count(f"n{number}", 1.0)
    assert len(quota._even_at) <= 10
    with pytest.raises(QuotaError):
        quota.check("li", 1.0)  # who has had most is forgotten last


def test_who_asks_for_more_waits_for_it_or_is_told_and_the_owner_counts_it(mesh):
    async def main():
        quota = Quota("checks", a_minute=120)

        async def answer(request):
            with quota.one(request.asker):
                return CheckAnswer(ok=True)

        async with open_session(mesh) as owner, open_session(mesh) as asker:
            owner.answer("s", "r", "kinematics/check/*", answer)
            key = f"robomesh/s/r/kinematics/check/{asker.own_name}"
            quota.count(asker.own_name, 120.0)
            # It is answered as soon as the quota gives it.
            assert (await asker.ask(key, CheckRequest(), timeout_s=30.0)).ok
            quota.count(asker.own_name, 120.0)
            with pytest.raises(QuotaError, match="quota: checks_a_minute = 120 for each name") as caught:
                await asker.ask(key, CheckRequest(), timeout_s=5.0)
            assert caught.value.again_s > 5.0
            assert (await asker.ask("robomesh/s/r/kinematics/check/another", CheckRequest())).ok
            (told,) = [
                each for each in SessionMetrics(owner, {}).collect() if each.name == "robomesh_over_quota"
            ]
            counted = {each.labels["request"]: each.value for each in told.samples}
            assert counted["kinematics/check/*"] >= 1

    run(main())
