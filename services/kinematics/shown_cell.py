"""The content of a cell that kinematics describes and measures clearance to; it follows the gateway's.

A new content is prepared beside the old one. All that depends on it changes in one step of the event loop:
descriptions, meshes, fixtures in `frames`, clearance and its events.
"""

import asyncio
import gc
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from robomesh import reason_codes as codes
from robomesh.contract.keys import ROOT
from robomesh.contract.messages import reason_message
from robomesh.errors import MessageError, RefusedError
from robomesh.publications.publisher import Publisher
from robomesh.reasons import Reason
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from robots.collision import Cell, build_cell
from robots.descriptions.cells import CellDescription
from robots.kinematics.joints import FloatArray
from robots.schema.errors import RobotError, reason_of
from services.kinematics.answers import Workers
from services.kinematics.descriptions import FixtureShape, fixture_shapes
from services.kinematics.settings import CellContents

log = logging.getLogger(__name__)

_NEWEST = 512


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownContent:
    """One content of a cell, ready to be shown.

    Attributes:
        version: The gateway's version of it; empty: cells do not change.
        built: Its hulls; None until they are built for the first time.
    """

    version: str
    description: CellDescription
    fixtures: tuple[FixtureShape, ...]
    built: Cell | None = None

    @property
    def shapes(self) -> dict[str, bytes]:
        """GLB of each fixture by the last chunk of its key."""
        return {each.name: each.glb for each in self.fixtures}

    @property
    def placements(self) -> dict[str, FloatArray]:
        """(4, 4) placement of each fixture in the site's frame, by name."""
        return {each.fixture.name: each.fixture.fixture_to_site for each in self.fixtures}


def first_content(description: CellDescription, contents: CellContents | None) -> ShownContent:
    """Return the content of a cell at the start, without hulls.

    Raises:
        RobotError: If a mesh cannot be read.
    """
    version, robot = "", description.robots[0].name
    if contents is not None:
        version, _ = contents.describe(robot, contents.content(robot))
    return ShownContent(version=version, description=description, fixtures=fixture_shapes(description))


class ShownCell:
    """The content of one cell now.

    Attributes:
        now: What is shown.
    """

    def __init__(self, first: ShownContent, contents: CellContents | None, workers: Workers) -> None:
        self.now = first
        self._contents, self._workers = contents, workers
        self._robot = first.description.robots[0].name
        self._describe: dict[str, Callable[[], None]] = {}
        self._publishers: dict[str, Publisher] = {}
        self._prepared: ShownContent | None = None
        self._problem: Reason | None = None
        self._one_at_a_time = asyncio.Lock()

    async def build(self) -> None:
        """Build the hulls of the first content; descriptions and frames do not wait for it."""
        async with self._one_at_a_time:
            if self.now.built is None:
                built = await asyncio.to_thread(build_cell, self.now.description)
                self.now = replace(self.now, built=built)
        # Hulls live as long as the service; without this each full garbage collection would take 0.2 s.
        gc.freeze()

    def serve(self, session: Session, site: str, robot: str, describe: Callable[[], None]) -> None:
        """Publish what is shown for a robot, and prepare what the gateway asks for.

        Args:
            describe: Publishes the robot's description with the present content.
        """
        self._describe[robot] = describe
        describe()
        if self._contents is None:
            return
        self._publishers[robot] = session.declare_publisher(site, robot, "cell/shown")
        session.answer(site, robot, "cell/prepare", self._answer)
        self._publish()

    async def _answer(self, request: Request) -> schema.CellPrepared:
        asked = request.message
        assert isinstance(asked, schema.CellPreparation)
        await self._prepare(asked.version, asked.content)
        return schema.CellPrepared(version=asked.version)

    async def take(self, state: schema.CellState) -> None:
        """Show the content that the gateway checks motions against."""
        if state.version == self.now.version and self._problem is None:
            return
        problem = None
        try:
            new = await self._prepare(state.version, state.content)
            await self._workers.replace_cells(
                {robot.name: new.description for robot in new.description.robots}
            )
            self.now = new
        except RefusedError as error:
            problem = error.reason
            log.error("the gateway's cell of %s cannot be shown: %s", self._robot, problem)
        self._problem = problem
        for describe in self._describe.values():
            describe()
        self._publish()
        gc.freeze()

    async def _prepare(self, version: str, content: schema.CellContent) -> ShownContent:
        """Return a content that is ready to be shown.

        Raises:
            RefusedError: If it cannot be read here.
        """
        assert self._contents is not None
        async with self._one_at_a_time:
            for each in (self.now, self._prepared):
                if each is not None and each.version == version and each.built is not None:
                    return each
            try:
                self._prepared = await asyncio.to_thread(self._made, version, content)
            except RobotError as error:
                raise RefusedError(codes.INVALID(reason_of(error))) from None
            return self._prepared

    def _made(self, version: str, content: schema.CellContent) -> ShownContent:
        assert self._contents is not None
        _, description = self._contents.describe(self._robot, content)
        return ShownContent(
            version=version,
            description=description,
            fixtures=fixture_shapes(description),
            built=build_cell(description),
        )

    def _publish(self) -> None:
        shown = schema.CellShown(version=self.now.version)
        if self._problem is not None:
            shown.problem.CopyFrom(reason_message(self._problem))
        for publisher in self._publishers.values():
            publisher.put(shown)


async def follow_gateway(session: Session, site: str, cells: Mapping[str, ShownCell]) -> None:
    """Follow the contents that the gateway publishes, until cancelled.

    Args:
        cells: Of each robot.
    """
    async for sample in session.subscribe(f"{ROOT}/{site}/*/cell", newest=_NEWEST):
        cell = cells.get(sample.parsed.robot)
        if cell is None:
            continue
        try:
            state = sample.message()
        except MessageError as error:
            log.warning("%s: %s", sample.key, error)
            continue
        assert isinstance(state, schema.CellState)
        await cell.take(state)
