"""The supervisor's small parts; a whole site is tried in test_whole_site."""

import asyncio
import subprocess
import sys

import pytest

from services.supervisor import CouldNotStartError, Program, _lines, supervise
from tests.conftest import run


def test_lines_of_any_length_and_any_bytes_end_nobody():
    async def main():
        stream = asyncio.StreamReader()
        stream.feed_data(b"one\n" + b"x" * 200_000 + b"\ntw\xff\no\nlast")
        stream.feed_eof()
        return [line async for line in _lines(stream)]

    lines = run(main())
    assert [line[:4] for line in lines] == ["one", "xxxx", "tw\ufffd", "o", "last"]
    assert len(lines[1]) == 2000


def test_a_needed_program_that_cannot_start_ends_all_and_another_does_not():
    async def never():
        await asyncio.Event().wait()

    log = []

    async def main(needed):
        wrong = Program(name="wrong", arguments=("robot", "show", "nobody"), needed=needed)
        await supervise([wrong], ready=never, write=log.append)

    with pytest.raises(CouldNotStartError, match="wrong could not start"):
        run(main(needed=True))
    assert "wrong | robomesh: nobody: no such robot" in log[0]
    with pytest.raises(TimeoutError):
        run(main(needed=False), timeout_s=3.0)
    assert log[-1] == "wrong | could not start; everything else runs without it"


def test_a_held_terminal_holds_no_service():
    # Nobody reads the pipe: what does not fit is dropped.
    program = (
        "import logging, time\n"
        "from bus.service import log_to_stderr\n"
        "log_to_stderr()\n"
        "begun = time.monotonic()\n"
        "for number in range(20000): logging.getLogger('x').info('a line of some length %d', number)\n"
        "print(time.monotonic() - begun, flush=True)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout.readline().strip()
        process.wait(10.0)
    finally:
        process.kill()
        process.communicate()
