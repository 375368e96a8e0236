"""ROS 2 service: makes the mesh's robots visible to ROS 2 nodes with rmw_zenoh."""

import asyncio

from robomesh.service.linked_site import be_present
from robomesh.wire.session import Session
from services.ros2.bridge import Bridge
from services.ros2.settings import Settings

SERVICE = "ros2"


async def serve(session: Session, settings: Settings) -> None:
    """Serve until cancelled."""
    bridge = Bridge(session, settings)
    try:
        async with asyncio.TaskGroup() as group:
            group.create_task(be_present(session, SERVICE, site=settings.site, metrics=settings.metrics))
            group.create_task(bridge.run())
    finally:
        bridge.close()
