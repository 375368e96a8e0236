"""All cells of a gateway, and what kinematics shows of them."""

import asyncio
import logging
from collections.abc import Mapping, Sequence

from protocol_gateway.cells.changes import CellChanges
from protocol_gateway.checking.cell_occupancy import CellOccupancy
from protocol_gateway.checking.checker import Checker
from protocol_gateway.configuration.settings import Settings
from protocol_gateway.robot.robot import Robot
from robomesh.contract.keys import ROOT
from robomesh.contract.quotas import Quota
from robomesh.contract.topics import Role
from robomesh.errors import MessageError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session

log = logging.getLogger(__name__)

_NEWEST = 512


class GatewayCells:
    """All cells of a gateway, one for all of its robots; none without a file of cells.

    Args:
        robots: The gateway's robots by name.
        occupancies: Occupancy of each cell by the names of its robots.
        checkers: Worker processes for motions and for programs, by robot.
    """

    def __init__(
        self,
        session: Session,
        settings: Settings,
        robots: Mapping[str, Robot],
        occupancies: Mapping[frozenset[str], CellOccupancy],
        checkers: Sequence[Mapping[str, Checker]],
    ) -> None:
        self._session, self._site = session, settings.site
        self._cells: dict[str, CellChanges] = {}
        if settings.cell_file is None:
            return
        quota = Quota("cell_changes", a_minute=settings.quotas.cell_changes_a_minute)
        for names, occupancy in occupancies.items():
            own = {name: robots[name] for name in sorted(names & robots.keys())}
            cell = CellChanges(
                session,
                settings.site,
                robots=own,
                elsewhere=names - robots.keys(),
                file=settings.cell_file,
                occupancy=occupancy,
                checkers={checker for each in checkers for name in own for checker in [each[name]]},
                quota=quota,
            )
            self._cells |= dict.fromkeys(own, cell)

    async def run(self) -> None:
        """Follow what kinematics shows, until cancelled."""
        if not self._cells:
            return
        for cell in dict.fromkeys(self._cells.values()):
            cell.serve()
        async with asyncio.TaskGroup() as group:
            group.create_task(self._follow_shown())
            group.create_task(self._follow_presence())

    async def _follow_shown(self) -> None:
        key = f"{ROOT}/{self._site}/*/cell/shown"
        async for sample in self._session.subscribe(key, newest=_NEWEST):
            cell = self._cells.get(sample.parsed.robot)
            if cell is None:
                continue
            try:
                shown = sample.message()
            except MessageError as error:
                log.warning("%s: %s", sample.key, error)
                continue
            assert isinstance(shown, schema.CellShown)
            cell.on_shown(sample.parsed.robot, shown)

    async def _follow_presence(self) -> None:
        key = f"{ROOT}/{self._site}/*/alive/{Role.KINEMATICS.value}/*"
        async for who, alive in self._session.watch_presence(key):
            if (cell := self._cells.get(who.robot)) is not None:
                cell.on_presence(who.robot, who.id, alive=alive)
