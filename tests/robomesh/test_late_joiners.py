"""Answers to late joiners: threads, errors, floods."""

import threading

import pytest
import zenoh

from robomesh.publications.late_joiners import _MOST_WAITING, AnsweringThread
from robomesh.wire.session import open_session
from tests.conftest import last_value
from tests.robomesh.test_session import joints


@pytest.fixture
def answering():
    thread = AnsweringThread()
    yield thread
    thread.close()


def test_answers_run_in_order_on_one_thread(answering):
    ran, ended = [], threading.Event()
    for number in range(10):
        answering.add(lambda number=number: ran.append((number, threading.get_ident())))
    answering.add(ended.set)
    assert ended.wait(60.0)
    assert [number for number, _ in ran] == [*range(10)]
    assert len({thread for _, thread in ran} - {threading.get_ident()}) == 1


def test_an_answer_that_fails_does_not_end_the_thread(answering, caplog):
    ended = threading.Event()

    def fail(error):
        raise error

    answering.add(lambda: fail(zenoh.ZError("the session is closed")))
    answering.add(lambda: fail(ValueError("broken")))
    answering.add(ended.set)
    assert ended.wait(60.0)
    assert "broken" in caplog.text
    assert "the session is closed" not in caplog.text


def test_a_flood_waits_at_its_sender(answering):
    go, added = threading.Event(), []

    def flood():
        for number in range(_MOST_WAITING + 50):
            answering.add(lambda: go.wait(60.0))
            added.append(number)

    flooding = threading.Thread(target=flood)
    flooding.start()
    flooding.join(0.5)
    assert flooding.is_alive()
    assert len(added) <= _MOST_WAITING + 1
    go.set()
    flooding.join(60.0)
    assert len(added) == _MOST_WAITING + 50


def test_an_answer_after_close_is_dropped():
    answering, ran = AnsweringThread(), []
    answering.add(lambda: ran.append("before"))
    answering.close()
    answering.add(lambda: ran.append("after"))
    assert ran == ["before"]


async def test_publishers_have_no_threads_of_their_own(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        gateway.declare_publisher("site", "arm", "joints").put(joints(1.0))
        assert await last_value(monitor, "robomesh/site/arm/joints") == joints(1.0)
        before = threading.active_count()
        for number in range(10):
            publisher = gateway.declare_publisher("site", f"arm-{number}", "joints")
            publisher.on_watched(lambda: None)
            publisher.put(joints(number))

            async def image():
                return None

            gateway.declare_publisher("site", f"arm-{number}", "image/front", on_get=image)
        assert threading.active_count() <= before
        assert await last_value(monitor, "robomesh/site/arm-7/joints") == joints(7.0)
