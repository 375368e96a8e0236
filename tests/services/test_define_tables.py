"""The arm that results from a table in Define, compared with the manufacturer's URDF."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from robots.descriptions.description import from_values
from robots.descriptions.example_robots import example_folder
from robots.kinematics.model import build_model, link_placements
from tests import page_modules

pytestmark = pytest.mark.slow

FILL = """
const { readText, readValues, typesFrom, fillJoints, empty, concise } = page;
const filled = (text) => {
  const table = readText(text);
  const description = empty();
  const reading = { decimal: table.decimal.sign, ...description.units };
  const read = readValues(table, reading, description.units, typesFrom(description, 0));
  fillJoints(description, read, 0, table.modified ? "modified" : "standard");
  return { problems: read.problems, description: concise(description) };
};
answer(asked.map(filled));
"""


@pytest.fixture(scope="module")
def module(tmp_path_factory):
    """Return the path of the page's modules as one file for Node."""
    return page_modules.bundle(
        tmp_path_factory.mktemp("tables"),
        text="features/define/table/table-text.ts",
        fill="features/define/table/table-fill.ts",
        description="features/define/description/description.ts",
    )


def fill(module, *texts):
    return page_modules.ask(module, FILL, texts)


def placements(answer, positions):
    """Return the placement (4, 4) [m] of each link for joint positions [rad]."""
    description, problems = from_values(answer["description"], folder=Path(), confined=True)
    assert description is not None, problems
    return link_placements(build_model(description), np.asarray(positions))


def frames(urdf, positions, names):
    """Return the placements (4, 4) [m] of a URDF's links, by Pinocchio, for its first joints' positions."""
    model = pinocchio.buildModelFromUrdf(str(next(example_folder().rglob(urdf))))
    data = model.createData()
    q = pinocchio.neutral(model)
    q[: len(positions)] = positions
    pinocchio.framesForwardKinematics(model, data, q)
    return [data.oMf[model.getFrameId(name)].homogeneous for name in names]


# Universal Robots' table of the UR5 (standard), as copied from a spreadsheet with decimal commas.
UR5 = (
    "Kinematics\ttheta [rad]\ta [m]\td [m]\talpha [rad]\n"
    "Joint 1\t0\t0\t0,089159\tπ/2\nJoint 2\t0\t-0,425\t0\t0\nJoint 3\t0\t-0,39225\t0\t0\n"
    "Joint 4\t0\t0\t0,10915\tπ/2\nJoint 5\t0\t0\t0,09465\t-π/2\nJoint 6\t0\t0\t0,0823\t0\n"
)
# Franka's table of the Panda (modified), as text of its documentation's table.
PANDA = """| Joint | a_{i-1} (m) | d_i (m) | α_{i-1} (rad) | θ_i (rad) |
|---|---|---|---|---|
| Joint 1 | 0 | 0.333 | 0 | θ1 |
| Joint 2 | 0 | 0 | -π/2 | θ2 |
| Joint 3 | 0 | 0.316 | π/2 | θ3 |
| Joint 4 | 0.0825 | 0 | π/2 | θ4 |
| Joint 5 | -0.0825 | 0.384 | -π/2 | θ5 |
| Joint 6 | 0 | 0 | π/2 | θ6 |
| Joint 7 | 0.088 | 0 | π/2 | θ7 |
"""


@pytest.mark.skipif(example_folder() is None, reason="no example robots here")
def test_tables_of_manufacturers_place_the_tool_as_their_urdf(module):
    ur5, panda = fill(module, UR5, PANDA)
    assert ur5["problems"] == panda["problems"] == []
    draw = np.random.default_rng(3)
    for _ in range(20):
        q = draw.uniform(-2.8, 2.8, 7)
        own = placements(panda, q)
        assert np.allclose(own[-1], frames("panda.urdf", q, ["panda_link7"])[0], atol=1e-9)
        base, flange = frames("ur5_robot.urdf", q[:6], ["base", "tool0"])
        # The URDF rounds π/2 to ten digits.
        assert np.allclose(placements(ur5, q[:6])[-1], np.linalg.inv(base) @ flange, atol=1e-5)
