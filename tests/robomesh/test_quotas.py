"""Quotas for each name, and their errors."""

import pytest

from robomesh.contract import quotas
from robomesh.contract.quotas import Quota
from robomesh.errors import QuotaError
from robomesh.schemas.robomesh_pb2 import CheckAnswer, CheckRequest
from robomesh.service.metrics import SessionMetrics
from robomesh.wire.session import open_session


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def use_up(quota, asker):
    """Use up a caller's quota; return how much it was."""
    for number in range(1000):
        try:
            with quota.in_progress(asker):
                pass
        except QuotaError:
            return number
    raise AssertionError("there is no end")


def test_quota_allows_a_burst_and_then_refills():
    clock = Clock()
    quota = Quota("checks", a_minute=30, clock=clock)
    assert use_up(quota, "li") == 30
    assert use_up(quota, "wang") == 30
    with pytest.raises(QuotaError, match=r"li has used up its quota: checks_a_minute = 30 .* try again in"):
        quota.check("li", 1.0)
    clock.now += 10.0
    assert use_up(quota, "li") == 5
    clock.now += 1000.0
    assert use_up(quota, "li") == 30


def test_amount_charged_afterwards_blocks_until_it_refills():
    clock = Clock()
    quota = Quota("recordings_mib", a_minute=60, clock=clock)
    quota.check("li")
    quota.count("li", 90.0)
    with pytest.raises(QuotaError) as caught:
        quota.check("li")
    assert caught.value.again_s == pytest.approx(30.0)
    clock.now += 30.1
    quota.check("li")


def test_limit_of_parallel_requests_is_released_with_each_request():
    quota = Quota("checks", at_once=2, a_minute=1e9)
    with quota.in_progress("li"), quota.in_progress("li"):
        with (
            pytest.raises(QuotaError, match="li already has 2 requests in progress: quota checks = 2"),
            quota.in_progress("li"),
        ):
            pass
        with quota.in_progress("wang"):
            pass
    assert use_up(Quota("checks", at_once=2, a_minute=5), "li") == 5
    with pytest.raises(ZeroDivisionError), quota.in_progress("li"):
        raise ZeroDivisionError
    with quota.in_progress("li"), quota.in_progress("li"):
        pass


def test_flood_of_names_takes_no_memory(monkeypatch):
    monkeypatch.setattr(quotas, "_MOST_ASKERS", 10)
    clock = Clock()
    quota = Quota("checks", a_minute=10, clock=clock)
    assert use_up(quota, "li") == 10
    for number in range(100):
        quota.count(f"n{number}", 1.0)
    assert len(quota._even_at) <= 10
    with pytest.raises(QuotaError):
        quota.check("li", 1.0)  # the caller that used most is forgotten last


async def test_caller_over_its_quota_waits_or_gets_an_error_which_is_counted(mesh):
    quota = Quota("checks", a_minute=120)

    async def answer(request):
        with quota.in_progress(request.asker):
            return CheckAnswer(ok=True)

    async with open_session(mesh) as owner, open_session(mesh) as asker:
        owner.answer("s", "r", "kinematics/check/*", answer)
        key = f"robomesh/s/r/kinematics/check/{asker.own_name}"
        quota.count(asker.own_name, 120.0)
        # Answered as soon as the quota allows it.
        assert (await asker.ask(key, CheckRequest(), timeout_s=30.0)).ok
        quota.count(asker.own_name, 120.0)
        with pytest.raises(QuotaError, match="quota: checks_a_minute = 120 for each name") as caught:
            await asker.ask(key, CheckRequest(), timeout_s=5.0)
        assert caught.value.again_s > 5.0
        assert (await asker.ask("robomesh/s/r/kinematics/check/another", CheckRequest())).ok
        (metric,) = [
            each for each in SessionMetrics(owner, {}).collect() if each.name == "robomesh_over_quota"
        ]
        counted = {each.labels["request"]: each.value for each in metric.samples}
        assert counted["kinematics/check/*"] >= 1
