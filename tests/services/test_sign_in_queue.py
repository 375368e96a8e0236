"""The order of password verifications, and rejections by a full queue."""

import asyncio
import threading

import pytest

from services.console.accounts.passwords import Verifier
from services.console.accounts.sign_in_queue import MOST_OF_ADDRESS, MOST_OF_NAME, MOST_WAITING, SignInQueue
from services.console.common.errors import SignInBusyError


def filled(*attempts):
    queue = SignInQueue()
    for address, name in attempts:
        queue.add((address, name), address=address, name=name)
    return queue


def taken(queue):
    found = []
    while (job := queue.take()) is not None:
        found.append(job)
    return found


def test_addresses_take_turns_and_so_do_the_names_of_each():
    queue = filled(("a", "x"), ("a", "x"), ("a", "x"), ("a", "y"), ("b", "z"))
    assert taken(queue) == [("a", "x"), ("b", "z"), ("a", "y"), ("a", "x"), ("a", "x")]
    assert len(queue) == 0


def test_a_name_that_floods_has_no_further_place_and_takes_no_others():
    queue = filled(*[("a", "x")] * MOST_OF_NAME)
    with pytest.raises(SignInBusyError):
        queue.add("more", address="a", name="x")
    assert queue.add("y", address="a", name="y") is None


def test_a_name_finds_a_place_at_an_address_that_others_have_filled():
    names = [f"n{each}" for each in range(MOST_OF_ADDRESS // 2)]
    queue = filled(*[("a", name) for name in names * 2])
    assert queue.add("own", address="a", name="li")[0] == "a"
    assert len(queue) == MOST_OF_ADDRESS


def test_an_address_finds_a_place_in_a_queue_that_others_have_filled():
    addresses = range(MOST_WAITING // 4)
    queue = filled(*[(f"a{each}", f"n{name}") for each in addresses for name in range(4)])
    assert len(queue) == MOST_WAITING
    assert queue.add("own", address="b", name="li") is not None
    assert "own" in taken(queue)[: len(addresses) + 1]


async def test_the_sender_of_most_attempts_is_not_verified_next():
    held, begun, order = threading.Event(), threading.Event(), []
    verifier = Verifier()

    def wait():
        begun.set()
        assert held.wait(30.0)

    async def one(address, name):
        await verifier._do(lambda: order.append((address, name)), address, name)

    flood = [asyncio.create_task(verifier._do(wait, "a", "first"))]
    await asyncio.to_thread(begun.wait, 30.0)
    flood += [asyncio.create_task(one("a", f"n{n}")) for n in range(MOST_OF_ADDRESS)]
    await asyncio.sleep(0)
    own = asyncio.create_task(one("b", "li"))
    await asyncio.sleep(0)
    held.set()
    await asyncio.gather(*flood, own)
    verifier.close()
    assert order.index(("b", "li")) <= 1
