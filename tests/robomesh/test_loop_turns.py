"""The measured event loop: a long turn is counted, and reported with its cause."""

import asyncio
import time

import pytest

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
