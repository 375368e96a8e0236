"""The process that listens on a TCP port, for errors about a port in use."""

import errno
import os
import socket
from pathlib import PurePath

import psutil

from robomesh.errors import UnavailableError

_OWN_MODULE = "services.command_line.main"


def check_free(what: str, host: str, port: int, remedy: str) -> None:
    """Check that no other program listens on an address; other problems are for the listener to report.

    Args:
        what: The service that is going to listen, for the error's text.
        remedy: What to do besides ending the other program.

    Raises:
        UnavailableError: If the address is in use.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise in_use(what, host, port, remedy) from None


def is_absent(host: str) -> bool:
    """Return whether an address is not this machine's now: its network is down, or its name is unknown."""
    try:
        family, _, _, _, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.bind(address)
    except OSError as error:
        return isinstance(error, socket.gaierror) or error.errno == errno.EADDRNOTAVAIL
    return False


def in_use(what: str, host: str, port: int, remedy: str) -> UnavailableError:
    """Return the error for an address in use, with the program that uses it if that is known."""
    shown = f"[{host}]" if ":" in host else host
    return UnavailableError(
        f"{what} cannot listen on {shown}:{port}: {_user(port)} uses the port. End it, or {remedy}"
    )


def is_used_by_child(port: int) -> bool:
    """Return whether a child of this process listens on a port; True if the listener is unknown."""
    try:
        parents = [process.ppid() for process in _listeners(port)]
    except psutil.Error:
        return False  # a listener has just ended
    return not parents or os.getpid() in parents


def _listeners(port: int) -> list[psutil.Process]:
    """Return the processes that listen on a port, as far as this user may see them."""
    found = []
    for each in psutil.net_connections("tcp"):
        listens = each.status == psutil.CONN_LISTEN and each.laddr and each.laddr.port == port
        if listens and each.pid is not None:
            try:
                found.append(psutil.Process(each.pid))
            except psutil.NoSuchProcess:
                continue
    return found


def _user(port: int) -> str:
    for process in _listeners(port):
        try:
            # A site's services end with the process that started them.
            parent = process.parent()
            if parent is not None and _command(parent).startswith("robomesh "):
                process = parent
            return f"process {process.pid} ({_command(process)})"
        except psutil.Error:
            continue
    return "another program"


def _command(process: psutil.Process) -> str:
    """Return a process's program with its first argument, as an operator knows it."""
    words = process.cmdline()
    for number, word in enumerate(words[:4]):
        if word == _OWN_MODULE or PurePath(word).name == "robomesh":
            return " ".join(["robomesh", *words[number + 1 : number + 2]])
    return process.name()
