"""Long answers in pieces: what is lost, forgotten, or asked for without end."""

import asyncio
from contextlib import asynccontextmanager

import pytest

from robomesh import pieces
from robomesh.errors import BrokenAnswerError
from robomesh.session import open_session
from tests.conftest import run
from tests.protocol_gateway.gateway_site import until

KEY = "robomesh/hall/arm/mesh/{}"
NAMED = "robomesh/hall/arm/kinematics/check/{}"
PIECES = 6
LENGTH = (PIECES - 1) * pieces.PIECE_BYTES + 7


def mesh_of(name):
    return name[0].encode() * LENGTH


@asynccontextmanager
async def hall(mesh):
    """An asker, the meshes that were asked for, and what their owner keeps; of NAMED the same."""
    async with open_session(mesh) as owner, open_session(mesh) as asker:
        asked = []

        async def answer(request):
            asked.append(request.chunk)
            return mesh_of(request.chunk)  # never the same object twice

        answerer = owner.answer("hall", "arm", "mesh/*", answer)
        await asker.ask_bytes(KEY.format("ready"), timeout_s=20.0)
        answerer._long._kept.clear()
        named = owner.answer("hall", "arm", "kinematics/check/*", answer)
        await asker.ask_bytes(NAMED.format("ready"), timeout_s=20.0)
        named._long._kept.clear()
        asked.clear()
        yield asker, asked, answerer._long, named._long


async def get(asker, selector):
    """One reply, as it is."""
    replies = await asyncio.to_thread(lambda: list(asker.zenoh_session.get(selector, timeout=20.0)))
    assert len(replies) == 1
    return replies[0]


async def token_of(asker, name, key=KEY):
    first = pieces.first_of((await get(asker, pieces.selector(key.format(name)))).ok)
    assert first.length == LENGTH
    return first.token


async def piece(asker, name, token, offset, key=KEY):
    """Its bytes; None: refused."""
    reply = await get(asker, f"{key.format(name)}?piece={token}:{offset}")
    return None if reply.ok is None else reply.ok.payload.to_bytes()


def between(monkeypatch, act):
    """What happens to the n-th question for a piece before its owner sees it; True: it is lost."""
    answered, seen = pieces.LongAnswers.reply_piece, []

    def reply_piece(self, query):
        if query.parameters.get("piece") is None:
            return False
        seen.append(query)
        if act(self, len(seen)):
            with query:
                return True
        return answered(self, query)

    monkeypatch.setattr(pieces.LongAnswers, "reply_piece", reply_piece)


def test_lost_pieces_are_asked_for_again_and_the_owner_is_not(mesh, monkeypatch):
    async def main():
        async with hall(mesh) as (asker, asked, *_):
            between(monkeypatch, lambda answers, number: number % 3 == 0)
            assert await asker.ask_bytes(KEY.format("base"), timeout_s=20.0) == mesh_of("base")
            assert asked == ["base"]

    run(main())


def test_what_its_owner_forgot_while_it_was_taken_is_asked_anew(mesh, monkeypatch):
    async def main():
        async with hall(mesh) as (asker, asked, *_):
            between(monkeypatch, lambda answers, number: number == 3 and answers._kept.clear())
            assert await asker.ask_bytes(KEY.format("base"), timeout_s=20.0) == mesh_of("base")
            assert asked == ["base", "base"]

    run(main())


def test_an_answer_that_breaks_off_is_told_as_such(mesh, monkeypatch):
    async def main():
        async with hall(mesh) as (asker, *_):
            between(monkeypatch, lambda answers, number: number > 1)
            told = rf"mesh/base: [36]0000 of {LENGTH} bytes arrived, then none for 2 s"
            with pytest.raises(BrokenAnswerError, match=told):
                await asker.ask_bytes(KEY.format("base"), timeout_s=2.0)

    run(main())


def test_of_too_much_what_was_taken_goes_first_and_the_same_is_kept_once(mesh, monkeypatch):
    async def main():
        monkeypatch.setattr(pieces, "_KEPT_BYTES", 2 * LENGTH)
        async with hall(mesh) as (asker, _, answers, _):
            taking, taken = await token_of(asker, "a"), await token_of(asker, "b")
            for number in range(1, PIECES):
                assert await piece(asker, "b", taken, number * pieces.PIECE_BYTES)
            # Many who ask for one mesh push out nothing.
            assert {await token_of(asker, "c") for _ in range(4)} == {await token_of(asker, "c")}
            assert await piece(asker, "a", taking, LENGTH - 7) == b"a" * 7
            assert await piece(asker, "b", taken, LENGTH - 7) is None
            assert len(answers._kept) == 2

    run(main())


def test_what_is_asked_in_a_name_is_given_out_a_few_times_and_no_longer(mesh):
    async def main():
        async with hall(mesh) as (asker, _, _, answers):
            another, token = await token_of(asker, "li", NAMED), await token_of(asker, "li", NAMED)
            assert another != token
            for offset in (LENGTH, "9" * 5000, "-1", "x", ""):
                assert await piece(asker, "li", token, offset, NAMED) is None
            given = 0
            while await piece(asker, "li", token, 0, NAMED) is not None:
                given += 1
            assert given == pieces._TIMES * (PIECES - 1)
            assert list(answers._kept) == [another]

    run(main())


def test_an_idle_owner_keeps_nothing(mesh, monkeypatch):
    async def main():
        monkeypatch.setattr(pieces, "_KEPT_S", 0.1)
        async with hall(mesh) as (asker, _, answers, _):
            await token_of(asker, "a")
            await until(lambda: not answers._kept)

    run(main())
