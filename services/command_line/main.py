"""The program `robomesh`: run one command, and end as it does.

Exit status 0: done; 1: done, and the answer is no; 2: not possible, and one line says why; 75 (EX_TEMPFAIL):
not possible now, because an address is in use or not there yet.
"""

import os
import select
import sys
from typing import Any

import typer

from robomesh.errors import UnavailableError
from robomesh.extras import EXTRAS, missing
from services.command_line.commands import root
from services.command_line.terminal.output import discard, print_line, print_text, protect
from services.command_line.terminal.reading_limits import limit
from services.errors import TRY_AGAIN


def main() -> None:
    """Run the command that the arguments name."""
    protect()
    limit(*sys.argv[1:])
    status = run(sys.argv[1:])
    try:
        # Flush now: at the interpreter's exit a broken pipe would print a warning.
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        discard(sys.stdout)
    sys.exit(status)


def run(arguments: list[str]) -> int:
    """Run one command and return its exit status."""
    if arguments[:1] == ["help"]:
        arguments = [*arguments[1:], "--help"]
    try:
        outcome: Any = root().main(arguments, prog_name="robomesh", standalone_mode=False)
        return outcome if isinstance(outcome, int) else 0
    except typer.TyperException as error:
        return _wrong_usage(error)
    except (KeyboardInterrupt, typer.Abort):
        return 130
    except MemoryError:
        return _failed("not enough memory to read this: more than this machine has, or than 6 GB")
    except SystemExit:
        # Typer and rich exit this way when the reader of the output is gone.
        discard(sys.stdout)
        return 0
    except ModuleNotFoundError as error:
        from protocol_gateway.configuration.kinds import kind_with

        # `cv2.typing` comes with `cv2`.
        module = (error.name or "").partition(".")[0]
        if module in EXTRAS:
            return _failed(missing(module))
        if kind := kind_with(module):
            return _failed(missing(module, kind.extra, kind.distribution))
        return _failed_ourselves(error)
    except ImportError as error:
        if str(error).startswith("libgomp.so.1:"):  # Pinocchio's wheel lacks it
            return _failed(f"{error}: apt-get install libgomp1")
        return _failed_ourselves(error)
    except Exception as error:
        # Services run their robots in task groups.
        while isinstance(error, ExceptionGroup):
            error = error.exceptions[0]
        if isinstance(error, BrokenPipeError) and _reader_is_gone():
            discard(sys.stdout)
            return 0
        if isinstance(error, _known_errors()):
            return _failed(str(error), TRY_AGAIN if isinstance(error, UnavailableError) else 2)
        return _failed_ourselves(error)


def _reader_is_gone() -> bool:
    """Return whether the reader of standard output has closed it: any other broken pipe is a fault."""
    output = select.poll()
    output.register(1, 0)
    return any(event & select.POLLERR for _, event in output.poll(0))


def _wrong_usage(error: typer.TyperException) -> int:
    text = error.format_message()
    if text.startswith("Usage: "):  # a group without a command
        print_text(text, err=True)
        return 2
    context = getattr(error, "ctx", None)
    command = "robomesh" if context is None else context.command_path
    return _failed(f"{text} (see {command} --help)")


def _failed_ourselves(error: Exception) -> int:
    if os.environ.get("ROBOMESH_DEBUG"):
        raise error
    return _failed(f"a fault of robomesh itself: {error!r} (ROBOMESH_DEBUG=1 shows where)")


def _failed(text: str, status: int = 2) -> int:
    print_line(f"robomesh: {text}", err=True)
    return status


def _known_errors() -> tuple[type[Exception], ...]:
    from protocol_gateway.seam.errors import ProtocolGatewayError
    from renderer.errors import RendererError
    from robomesh.errors import RobomeshError
    from robots.schema.errors import RobotError
    from services.errors import ServiceError

    return (RobomeshError, ProtocolGatewayError, RendererError, RobotError, ServiceError)


if __name__ == "__main__":
    main()
