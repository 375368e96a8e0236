"""The measured event loop: a long turn is counted, and reported with its cause."""

import asyncio
import time

import pytest

from robomesh.service import loop_turns
from robomesh.service.loop_turns import LONG_S, OTHER, LoopTurns, MeasuredLoop, turns_of

BLOCKED_S = 4 * LONG_S


def reports(*what: object) -> tuple[LoopTurns, list[tuple[float, object]]]:
    """Block a turn for each cause, and return the reports."""
    found: list[tuple[float, object]] = []

    def block(turns: LoopTurns, cause: object) -> None:
        begin_s = time.monotonic()
        time.sleep(BLOCKED_S)
        if cause != OTHER:
            turns.ran(cause, begin_s)

    async def main() -> LoopTurns:
        turns = turns_of(asyncio.get_running_loop())
        turns.on_long = lambda took_s, cause: found.append((took_s, cause))
        for each in what:
            block(turns, each)
            while not any(cause == each for _, cause in found):
                await asyncio.sleep(0)
        return turns

    with asyncio.Runner(loop_factory=MeasuredLoop) as runner:
        return runner.run(main()), found


@pytest.mark.parametrize("what", ["arm", OTHER])
def test_long_turn_is_reported_with_what_ran(what: str) -> None:
    turns, found = reports(what)
    assert any(took_s >= BLOCKED_S and cause == what for took_s, cause in found)
    assert turns.long_turns == len(found)
    assert turns.longest_s() >= BLOCKED_S


def test_the_longest_turn_is_known_for_30_to_60_s(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter((0.0, 1.0, 31.0, 60.0, 62.0, 130.0))
    monkeypatch.setattr(loop_turns, "_now_s", lambda: next(clock))
    turns = LoopTurns()
    turns.end(0.03)
    found = [turns.longest_s() for _ in range(4)]
    turns.end(0.02)
    assert [*found, turns.longest_s()] == [0.03, 0.03, 0.03, 0.0, 0.0]


def test_what_ran_in_one_turn_is_not_blamed_for_the_next() -> None:
    _, found = reports("arm", OTHER)
    assert [cause for _, cause in found].count("arm") == 1


def test_other_loops_run_without_a_measurement() -> None:
    async def main() -> float:
        turns = turns_of(asyncio.get_running_loop())
        turns.ran("arm", time.monotonic() - BLOCKED_S)
        await asyncio.sleep(0)
        return turns.longest_s()

    with asyncio.Runner() as runner:
        assert runner.run(main()) == 0.0
