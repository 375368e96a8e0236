"""What the sites of simulated controllers of all kinds share."""

import asyncio
import contextlib

from tests.protocol_gateway.gateway_site import STATE, C, until


@contextlib.asynccontextmanager
async def running(serve, settings):
    """Run a simulated controller; yield what its service says once clients can connect."""
    ready = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(serve(settings, ready=ready.set_result))
    await asyncio.wait([ready, task], return_when=asyncio.FIRST_COMPLETED)
    if task.done():
        await task
    try:
        yield ready.result()
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


def kept(monkeypatch, module, name):
    """Return a list to which a module's class or function adds what it makes."""
    made = []
    make = getattr(module, name)
    monkeypatch.setattr(module, name, lambda *given: made.append(make(*given)) or made[-1])
    return made


async def remote(site):
    """Wait until the robot is in remote control and its joints are known."""
    await until(lambda: site.seen.get("controller") and site.controller.mode == STATE.REMOTE)
    await until(lambda: site.joints)


async def move(site, *offsets, **fields):
    """Command a target by offsets from the present positions; return the target."""
    target = [here + by for here, by in zip(site.joints, (*offsets, *[0.0] * 6), strict=False)]
    await site.command(C.MOVE_ABSOLUTE, joint_positions=target, **fields)
    return target
