"""Worker process for long computations, driven by a `Worker`.

Run `python -m services.kinematics.worker.worker`.
"""

from collections.abc import Callable
from functools import cache

import numpy as np

from robomesh.files.worker import answer_all
from robomesh.schemas import robomesh_pb2 as schema
from robots.collision import Cell, build_cell, pending
from robots.descriptions.cells import CellDescription
from robots.descriptions.description import load
from robots.kinematics.inverse import InverseSolver, build_solver
from services.kinematics.worker.check import check_answer
from services.kinematics.worker.inverse import inverse_answer
from services.kinematics.worker.messages import InverseQuestion, Question, ReplaceCells


def begin(cells: dict[str, CellDescription]) -> Callable[[Question], bytes]:
    """Return the function that answers questions about robots; it loads their cells on demand.

    Args:
        cells: By robot.
    """
    cell_of = dict(cells)
    ready: dict[tuple[CellDescription, bool], Cell] = {}

    def built(robot: str, exact: bool) -> Cell:
        key = cell_of[robot], exact
        if key in ready:
            return ready[key]
        # A pair study may take longer than a request's timeout; it continues in another process.
        cell = build_cell(cell_of[robot], exact=exact, wait=False)
        if not pending(cell):
            ready[key] = cell
        return cell

    @cache
    def solver(robot: str) -> InverseSolver:
        (described,) = (each for each in cell_of[robot].robots if each.name == robot)
        return build_solver(load(described.model, confined=described.confined))

    def answer(question: Question) -> bytes:
        if isinstance(question, ReplaceCells):
            cell_of.update(question.cells)
            ready.clear()
            return b""
        if isinstance(question, InverseQuestion):
            pose = schema.InverseRequest.FromString(question.request)
            return inverse_answer(solver(question.robot), pose).SerializeToString()
        request = schema.CheckRequest.FromString(question.request)
        return check_answer(
            request,
            built(question.robot, request.exact),
            question.robot,
            question.start,
            others={name: np.atleast_2d(positions) for name, positions in question.others.items()},
            solver=solver(question.robot),
        ).SerializeToString()

    return answer


if __name__ == "__main__":
    answer_all(begin)
