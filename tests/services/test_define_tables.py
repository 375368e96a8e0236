"""Tables of a spreadsheet, a data sheet or a paper in Define, and the arm that results."""

from itertools import pairwise
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
const filled = ({ text, ...choices }) => {
  const began = performance.now();
  const table = readText(text);
  if (table.refused) return { ...table, ms: performance.now() - began };
  const description = empty();
  const reading = { decimal: table.decimal.sign, ...description.units, ...choices };
  const read = readValues(table, reading, description.units, typesFrom(description, 0));
  fillJoints(description, read, 0, table.modified ? "modified" : "standard");
  const columns = table.columns.map(({ meaning, unit }) => [meaning, unit ? unit.text : ""]);
  const { sure } = table.decimal;
  return { columns, ...read, description: concise(description), sure, ms: performance.now() - began };
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


def fill(module, *texts, **choices):
    return page_modules.ask(module, FILL, [{"text": text, **choices} for text in texts])


def values(answer):
    """Return the numbers of each row, in the order of the page's table."""
    order = ("a", "alpha", "d", "theta", "lower", "upper", "max_speed", "max_acceleration")
    return [[row["values"][key] for key in order if key in row["values"]] for row in answer["rows"]]


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


ROWS = [[25.0, -90.0, 400.0, 0.0, -185.0, 185.0, 156.0], [455.5, 0.0, 0.0, -90.0, -155.0, 35.0, 156.0]]


TSV = "a\tα\td\tθ\tmin\tmax\tspeed\n25\t−90\t400\t0\t-185\t185\t156\n455.5\t0\t0\t-90\t-155\t35\t156\n"
GERMAN = """a (mm);alpha [deg];d (mm);θ;min;max;vmax (°/s)\r
25;-90;400;0;-185;185;156\r
455,5;0;0;-90;-155;35;156"""
CSV = 'a,alpha,d,theta,lower,upper,velocity\n25,-90,400,0,-185,185,156\n"455.5",0,0,-90,-155,35,156\n'
SI = """"a
(m)"\t"α
(rad)"\td / m\tθ in rad\tlimits\tspeed (rpm)
0.025\t-pi/2\t0.4\t0\t±185°\t26
0.4555\t0\t0\t-π/2\t-155°/35°\t26
"""
NO_HEADER = TSV.partition("\n")[2]
SPACES = "A1  25  -90  400  θ1  -185  185  156\nA2  455.5  0  0  θ2 - 90  -155  35  156\n"
CHINESE = """Robot X
连杆\t连杆长度\t扭角\t偏距\t关节角\t下限\t上限\t速度
\tmm\t°\tmm\t°
1\t25\t-90\t400\t0\t-185\t185\t156
2\t455.5\t0\t0\t-90\t-155\t35\t156
Note
"""


@pytest.mark.parametrize("text", [TSV, GERMAN, CSV, SI, NO_HEADER, SPACES, CHINESE])
def test_one_table_in_many_writings_is_one_robot(module, text):
    [answer] = fill(module, text)
    assert values(answer) == [pytest.approx(row) for row in ROWS]
    assert answer["problems"] == []


# The clipboard of LibreOffice Calc 7.4 with cells in the formats of two countries.
CALC = """Joint\ta (mm)\tα (°)\td [m]\tθ\tmin\tmax\tspeed (°/s)
A1\t25.50\t-90.00\t0.40\t0.00\t-185.00\t185.00\t1,156.25
A2\t455.00\t0.00\t0.00\t-90.00\t-155.00\t35.00\t156.00
"""


def test_the_clipboard_of_a_real_spreadsheet_is_read_in_both_number_formats(module):
    swapped = CALC.translate({ord(","): ".", ord("."): ","})
    for answer in fill(module, CALC, swapped):
        assert values(answer) == [[25.5, -90, 400, 0, -185, 185, 1156.25], [455, 0, 0, -90, -155, 35, 156]]
        assert [row["name"] for row in answer["rows"]] == ["A1", "A2"]
        assert answer["sure"]


def test_an_unreadable_cell_is_named_and_stays_as_it_is(module):
    [answer] = fill(module, "a\talpha\td\ttype\n1\tabc\t3\tR\n4 kg\t5\td2\tP\n")
    assert answer["problems"] == [
        {"row": 2, "column": 1, "text": "abc"},
        {"row": 3, "column": 0, "text": "4 kg"},
    ]
    first, second = answer["description"]["joint"]
    assert (first["a"], first["alpha"], first["d"]) == (1, 0, 3)
    assert (second["type"], second["a"], second["alpha"], second["d"]) == ("prismatic", 0, 5, 0)


def test_a_comma_that_may_group_thousands_is_a_guess(module):
    guess, sure, both = fill(module, "a\td\n1,250\t0\n", "a\td\n0,5\t1,250\n", "a\td\n1,250.5\t0\n")
    assert (guess["sure"], sure["sure"], both["sure"]) == (False, True, True)
    assert values(both) == [[1250.5, 0]]
    [point] = fill(module, "a\td\n1,250\t0\n", decimal=".")
    assert values(point) == [[1250, 0]]


def test_what_is_no_table_is_refused_at_once(module):
    texts = {
        "1\t2\t3\n" * 10_000: "too_many_rows",
        "x" * 10_000_000: "too_long",
        "\t" * 9_999: "empty",
        "90": "one_column",
    }
    assert [each["refused"] for each in fill(module, *texts)] == list(texts.values())


def test_no_text_of_the_longest_length_takes_long(module):
    parts = ("1 ", "1,2", "-\t", "θ", '"', "(", "±1/", "π/", "1..", "a (", "e1")
    texts = [(part * 700 + "\t1\n") * 40 for part in parts]
    texts += [(part * 50_000)[:99_000] + "\t1" for part in parts]
    times = [each["ms"] for each in fill(module, *(text[:99_999] for text in texts))]
    # Together; the worst takes some tens of milliseconds.
    assert sum(times) < 20_000


def test_the_last_row_of_a_modified_table_ends_in_its_joint(module):
    [answer] = fill(module, PANDA)
    rows = answer["description"]["joint"]
    assert [(row["a"], row["alpha"]) for row in rows[-2:]] == [(88, 90), (0, 0)]
    assert all(one["name"] != other["name"] for one, other in pairwise(rows))


def test_a_modified_table_changes_no_cell_that_it_does_not_give(module):
    script = """
const { readText, readValues, fillJoints, empty, typesFrom } = page;
const fillOne = (description, text) => {
  const table = readText(text);
  const reading = { decimal: table.decimal.sign, ...description.units };
  const read = readValues(table, reading, description.units, typesFrom(description, 0));
  fillJoints(description, read, 0, "modified");
};
const description = empty();
fillOne(description, "a\\talpha\\td\\ttheta\\n10\\t90\\t1\\t0\\n20\\t45\\t2\\t0\\n30\\t-90\\t3\\t0");
fillOne(description, "alpha\\td\\n5\\t1\\nabc\\t2\\n7\\t3");
answer([description.base.pose, description.joint.map(({ a, alpha }) => [a, alpha])]);
"""
    pose, rows = page_modules.ask(module, script, None)
    assert (pose["xyz"], pose["rpy"]) == ([10, 0, 0], [5, 0, 0])
    assert rows == [[20, 45], [30, 7], [0, 0]]
