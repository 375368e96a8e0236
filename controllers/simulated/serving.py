"""What the services of simulated controllers share: settings, listening, and the run."""

import asyncio
import logging
import os
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Any

from controllers.simulated.fault_requests import Mesh, answer_requests
from controllers.simulated.faults import Faults
from robomesh.errors import ListenError
from robomesh.listen_address import check_reach, split_address

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class SimulatorSettings:
    """Settings of every simulated controller.

    Attributes:
        robot: A library robot, or a path to a robot.toml or URDF.
        listen: `HOST:PORT`; port 0 takes a free one.
        demo: A program moves the arm.
        faults: Faults in the syntax of `controllers.simulated.faults`, of those that the controller can show.
        insecure: May listen beyond loopback; the old protocols have no TLS.
        mesh: Where to answer fault requests; None to stay off the mesh.
    """

    robot: str = "puma560"
    listen: str = "127.0.0.1:0"
    demo: bool = False
    faults: tuple[str, ...] = ()
    insecure: bool = False
    mesh: Mesh | None = None


def warn_beyond_loopback(address: str, *, insecure: bool, because: str) -> None:
    """Warn if other machines can reach an address.

    Args:
        because: Why that is a risk.

    Raises:
        ListenError: If they can, and it is not permitted.
    """
    host, _ = split_address(address)
    remedy = f"listen on 127.0.0.1, or take the risk with --insecure: {because}"
    if warning := check_reach("the simulator", host, secured=False, insecure=insecure, remedy=remedy):
        logger.warning("%s", warning)


def cannot_listen(address: str, error: OSError) -> ListenError:
    """Return the error of an address that is not free, or not this machine's."""
    reason = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
    return ListenError(f"the simulator cannot listen on {address}: {reason.lower()}")


async def listen(protocol: Callable[[], asyncio.BaseProtocol], address: str) -> asyncio.Server:
    """Listen for TCP connections, each with a protocol of its own.

    Raises:
        ListenError: If it cannot listen on the address.
    """
    host, port = split_address(address)
    try:
        return await asyncio.get_running_loop().create_server(protocol, host, port)
    except OSError as error:
        raise cannot_listen(address, error) from None


async def run(*work: Coroutine[Any, Any, None], mesh: Mesh | None, faults: Faults) -> None:
    """Do the work of a controller, and answer requests for faults, until cancelled."""
    async with asyncio.TaskGroup() as tasks:
        for each in work:
            tasks.create_task(each)
        if mesh is not None:
            tasks.create_task(answer_requests(mesh, faults))
