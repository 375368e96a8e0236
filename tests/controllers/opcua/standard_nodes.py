"""The 6,000 nodes of the standard, made once for all OPC UA servers of the process."""

import functools
import shelve
from types import SimpleNamespace


@functools.cache
def keep_standard_nodes():
    """Let servers read only the nodes that they use, from what the first one made.

    The shelf is in memory: which databases a Python has differs, and some must be closed by their thread.
    """
    from asyncua.server import address_space
    from asyncua.server.internal_server import InternalServer

    nodes = {}
    make = InternalServer.load_standard_address_space

    async def load(server, shelf_file):
        if nodes:
            server.aspace.load_aspace_shelf(shelf_file)
        else:
            await make(server)
            server.aspace.make_aspace_shelf(shelf_file)

    address_space.shelve = SimpleNamespace(
        open=lambda *_, **how: shelve.Shelf(nodes, **how), Shelf=shelve.Shelf
    )
    InternalServer.load_standard_address_space = load
