"""Output without a reader: `robomesh ... | head`, and a terminal that is paused."""

import os
import subprocess
import sys
import threading

import pytest
from typer import Context

from services.command_line.commands import COMMANDS, root
from services.site_file.site import Site
from services.site_file.tables.console import Console

ROBOMESH = (sys.executable, "-m", "services.command_line.main")


@pytest.mark.parametrize(
    ("arguments", "lines"),
    [
        (("robot", "show", "pt600"), ""),
        (("fk", "-"), '{"joints": [0, 0, 0, 0, 0]}\n' * 3),
        (("simulate", "--listen", "127.0.0.1:0"), ""),
    ],
)
@pytest.mark.slow
def test_a_command_ends_quietly_when_the_reader_of_its_output_is_gone(arguments, lines):
    reader, writer = os.pipe()
    os.close(reader)
    try:
        result = subprocess.run(
            [*ROBOMESH, *arguments],
            input=lines,
            stdout=writer,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
            # Buffered output, as in a shell.
            env={name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"},
        )
    finally:
        os.close(writer)
    assert (result.stderr, result.returncode) == ("", 0)


@pytest.mark.slow
def test_a_failure_keeps_its_status_when_the_reader_of_its_errors_is_gone():
    reader, writer = os.pipe()
    os.close(reader)
    try:
        result = subprocess.run(
            [*ROBOMESH, "send", "arm", "jump"], stdout=writer, stderr=writer, check=False, timeout=60
        )
    finally:
        os.close(writer)
    assert result.returncode == 2


def test_the_help_shows_each_commands_whole_sentence():
    shown = " ".join(root().get_help(Context(root(), terminal_width=80)).split())
    assert [row.help for row in COMMANDS.values() if row.help not in shown] == []


@pytest.mark.slow
def test_a_site_keeps_running_when_its_log_is_not_read():
    program = (
        "from services.command_line.site import up\n"
        "up._log_plain_lines()\n"
        "for number in range(3000): up._write(f'{number:<200}')\n"
        "print('goes on', flush=True)\n"
    )
    held = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    deadline = threading.Timer(40.0, held.kill)
    deadline.start()
    try:
        assert held.stdout.readline() == "goes on\n"
        # The output is complete for a late reader.
        assert held.stderr.readline() == f"{0:<200}\n"
    finally:
        deadline.cancel()
        held.kill()
        held.communicate()


def test_list_watch_writes_to_a_pipe_and_ends_quietly_with_its_reader(router):
    watching = subprocess.Popen(
        [*ROBOMESH, "list", "--watch", "--connect", router],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = threading.Timer(50.0, watching.kill)
    deadline.start()
    try:
        assert any("service" in line for line in watching.stdout)
        watching.stdout.close()
        assert (watching.stderr.read(), watching.wait()) == ("", 0)
    finally:
        deadline.cancel()
        watching.kill()
        watching.wait()
        watching.stderr.close()


@pytest.mark.parametrize(
    ("listen", "address"),
    [("0.0.0.0:8443", "127.0.0.1:8443"), ("[::1]:8080", "[::1]:8080"), ("10.0.0.7:80", "10.0.0.7:80")],
)
def test_up_prints_the_url_of_the_page(listen, address):
    assert Site(site="hall", console=Console(listen=listen)).console.url == f"http://{address}/"
