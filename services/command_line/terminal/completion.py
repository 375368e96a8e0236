"""Completion of robot names in a shell."""

import os
import signal
import sys

import typer

from services.command_line.terminal.output import discard

# A person waits at the prompt.
_TIME_LIMIT_S = 1.0


def robot_names(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the robots on the mesh; none, without a message, if no router answers in time.

    Runs in a process of its own, which the shell starts.
    """
    discard(sys.stderr)
    signal.signal(signal.SIGALRM, lambda *_: os._exit(0))
    signal.setitimer(signal.ITIMER_REAL, _TIME_LIMIT_S)
    from robomesh.contract.keys import WHOLE_SITE
    from robomesh.errors import RobomeshError
    from services.command_line.terminal import discovery

    async def present() -> set[tuple[str, str]]:
        async with discovery.attached(ctx.params["connect"]) as session:
            return {(key.site, key.robot) for key in await session.present() if key.robot != WHOLE_SITE}

    try:
        found = discovery.run(present())
    except RobomeshError:
        return []
    finally:
        # Python removes the handler at its exit: an alarm then would kill it, with a message in the shell.
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    names = [robot for _, robot in found]
    # A name that two sites use needs its site.
    both = {f"{site}/{robot}" for site, robot in found if "/" in incomplete or names.count(robot) > 1}
    short = {name for name in names if names.count(name) == 1}
    return sorted(each for each in both | short if each.startswith(incomplete))
