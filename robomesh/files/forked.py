"""Forks of a process that has open sessions.

A fork copies the connections, but not the threads that use them. If the parent is killed, the copies keep
its connections open: the router does not see its death, and an arm that it controls stops only when its lease
expires. So the child closes its copies. Inherited objects raise an error, because no thread would receive an
answer.
"""

import ctypes
import os
import socket
from contextlib import suppress
from functools import cache
from pathlib import Path

import zenoh

from robomesh.errors import ForkedError

_sessions: list[zenoh.Session] = []
# Addresses of routers that a session was connected to: it may just be reconnecting at a fork.
_routers: set[str] = set()


def open_unshared(config: zenoh.Config) -> zenoh.Session:
    """Open a session; a forked process closes its copies of the connections.

    Raises:
        zenoh.ZError: If no router answers.
    """
    _register()
    session = zenoh.open(config)
    _sessions.append(session)
    _note_routers()
    return session


def close_unshared(session: zenoh.Session) -> None:
    """Close a session of `open_unshared`."""
    session.close()
    _sessions.remove(session)


def check_owner(pid: int) -> None:
    """Check that this process opened what it uses.

    Args:
        pid: The process that opened it.

    Raises:
        ForkedError: If this process was forked from it.
    """
    if os.getpid() != pid:
        raise ForkedError(
            f"process {os.getpid()} was forked from {pid}, which has the connection: "
            "call robomesh.connect() in the new process"
        )


@cache
def _register() -> None:
    os.register_at_fork(before=_note_routers, after_in_child=_close_copies)


def _note_routers() -> None:
    for session in tuple(_sessions):
        with suppress(zenoh.ZError):
            for link in session.info.links():
                # tcp/127.0.0.1:7447?prio=1-4
                _routers.add(link.dst.partition("/")[2].partition("?")[0].partition("#")[0])


def _close_copies() -> None:
    """Close this process's copies of the connections, and leave the parent's alone."""
    timeout_s = socket.getdefaulttimeout()
    # Otherwise Python would make each of these sockets, which the parent shares, non-blocking.
    socket.setdefaulttimeout(None)
    null = os.open(os.devnull, os.O_RDWR)
    for descriptor in [int(each.name) for each in Path("/proc/self/fd").iterdir()]:
        if _peer(descriptor) in _routers:
            # The number stays taken: Zenoh's copied objects still use it.
            os.dup2(null, descriptor, inheritable=False)
    os.close(null)
    socket.setdefaulttimeout(timeout_s)
    for session in _sessions:
        # Without its threads a session's end would wait forever, also when Python exits.
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(session))
    _sessions.clear()


def _peer(descriptor: int) -> str:
    """Return the address of a connected socket's peer; empty for other descriptors."""
    try:
        found = socket.socket(fileno=descriptor)
    except OSError:
        return ""
    try:
        host, port = found.getpeername()[:2]
    except (OSError, ValueError):
        return ""
    finally:
        found.detach()
    return f"[{host}]:{port}" if found.family == socket.AF_INET6 else f"{host}:{port}"
