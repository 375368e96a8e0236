"""The 6,000 nodes of the standard, made once for all OPC UA servers of the process."""

import atexit
import functools
import tempfile
from pathlib import Path


@functools.cache
def keep_standard_nodes():
    """Let servers read only the nodes that they use, from a file that the first one writes."""
    from asyncua.server.internal_server import InternalServer

    folder = tempfile.TemporaryDirectory(prefix="robomesh-")
    atexit.register(folder.cleanup)
    load = InternalServer.load_standard_address_space
    InternalServer.load_standard_address_space = lambda server, _: load(server, Path(folder.name) / "nodes")
