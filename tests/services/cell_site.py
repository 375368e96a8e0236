"""A cell with one arm: a simulated controller, a gateway and a kinematics service, and an engineer."""

import asyncio
import contextlib
from dataclasses import dataclass
from pathlib import Path

from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from services.cells.content import version_of
from services.cells.file import CellFile
from services.command_line.service_settings.table import SERVICES, Options
from services.kinematics import serve as serve_kinematics
from services.site_file.site import load
from tests.conftest import last_value
from tests.protocol_gateway.gateway_site import simulator, until

SITE = """# The cell of the tests.
site = "hall"

[[robot]]
name = "arm"
model = "pt600"
cell = "a"
check = "require"

# A post beside the arm.
[[fixture]]
cell = "a"
name = "post"
box = [100.0, 100.0, 1000.0]   # mm
pose = { xyz = [900.0, 0.0, 500.0] }
"""


def write_site(folder: Path) -> Path:
    path = folder / "site.toml"
    path.write_text(SITE)
    return path


@dataclass
class CellSite:
    """The site as an engineer sees it."""

    session: object
    path: Path

    def key(self, topic: str) -> str:
        return f"robomesh/hall/arm/{topic}"

    async def state(self) -> schema.CellState:
        return await last_value(self.session, self.key("cell"))

    async def ask(self, *, x=None, content=None, dry_run=False, based_on=None, timeout_s=90.0):
        """Move the post, or change the whole content."""
        state = await self.state()
        if content is None:
            content = schema.CellContent()
            content.CopyFrom(state.content)
            content.fixtures[0].xyz.x = x
        request = schema.CellRequest(
            based_on=state.version if based_on is None else based_on,
            content=content,
            dry_run=dry_run,
            reason="the post was moved",
        )
        return await self.session.ask(self.key("cell/request/wang"), request, timeout_s=timeout_s)

    async def versions(self) -> dict[str, str]:
        """Return the version of the check, of the picture, of live clearance, and of the file."""
        description = await last_value(self.session, self.key("description"))
        shown = await last_value(self.session, self.key("cell/shown"))
        file = version_of(CellFile(self.path, load(self.path)).content("arm"))
        return {
            "check": (await self.state()).version,
            "described": description.cell_version,
            "shown": shown.version,
            "file": file,
        }

    async def agreed(self) -> str:
        """Wait until all have one version, and return it."""
        async with asyncio.timeout(60.0):
            while len(versions := set((await self.versions()).values())) > 1:
                await asyncio.sleep(0.05)
        return versions.pop()


def settings(name: str, path: Path, *controllers: str):
    return SERVICES[name].settings(load(path), Options(site_file=path, controllers=controllers))


@contextlib.asynccontextmanager
async def cell_site(mesh, folder):
    """Run the site in this process; yield it when its motions can be checked."""
    from protocol_gateway.gateway import serve as serve_gateway

    path = write_site(folder)
    path.write_text(f'{SITE}\n[audit]\nfolder = "{folder}/audit"\n')
    async with (
        simulator() as port,
        open_session(mesh) as gateway,
        open_session(mesh) as kinematics,
        open_session(mesh) as session,
    ):
        kinematics.declare_presence("hall", "arm", "kinematics")
        controller = f"arm=tcp://127.0.0.1:{port}"
        tasks = [
            asyncio.create_task(serve_gateway(gateway, settings("gateway", path, controller))),
            asyncio.create_task(serve_kinematics(kinematics, settings("kinematics", path))),
        ]
        try:
            site = CellSite(session, path)
            states = []

            async def watch():
                async for sample in session.subscribe(site.key("controller")):
                    states.append(sample.message())

            tasks.append(asyncio.create_task(watch()))
            await until(
                lambda: states and states[-1].check_text == "" and states[-1].link == states[-1].UP, 60
            )
            await site.agreed()
            yield site
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
