"""The order of dropped files in Define, guessed from their names and from which parts touch."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from robots.shapes.files.read import read_geometry
from robots.shapes.surface_points import surface_points
from tests import page_modules

pytestmark = pytest.mark.slow

# Each in its order: files of this project, of manufacturers' and other packages, and in Chinese.
NAMED = [
    "base.wrl column.3ds upper_arm.wrl forearm.3ds wrist.wrl flange.3ds",
    "base.3ds column.wrl upper_arm.3ds forearm.wrl wrist.3ds wrist_cage.3ds flange.3ds",
    "link0.wrl link1.wrl link2.wrl link3.wrl link4.wrl link5.wrl link6.wrl",
    "gp8_base_link.stl gp8_link_1_s.stl gp8_link_2_l.stl gp8_link_3_u.stl gp8_link_10_t.stl",
    "base.stl shoulder.stl upperarm.stl forearm.stl wrist1.stl wrist2.stl wrist3.stl",
    "link_base.stl link_1.stl link_2.stl link_6.stl link_finger_1.stl link_finger_tip_1.stl",
    "link0.dae link1.dae link7.dae hand.dae leftfinger.dae",
    "base_link.stl shoulder_link.stl half_arm_1_link.stl half_arm_2_link.stl forearm_link.stl bracelet.stl",
    "IRB1600_Base.stp IRB1600_LowerArm.stp IRB1600_UpperArm.stp IRB1600_Wrist.stp",
    "KR6_base.stl KR6_A1.stl KR6_A2.stl KR6_A10.stl",
    "axis_01.stl axis_02.stl axis_10.stl",
    "基座.stl 关节1.stl 关节2.stl 关节10.stl",
]


@pytest.fixture(scope="module")
def module(tmp_path_factory):
    """Return the path of the page's modules as one file for Node."""
    return page_modules.bundle(
        tmp_path_factory.mktemp("order"),
        order="features/define/opening/part-order.ts",
        description="features/define/description/description.ts",
        edits="features/define/description/edits.ts",
    )


def guess(module, *asked):
    return page_modules.ask(module, "answer(asked.map(page.guessOrder));", asked)


def test_names_of_real_files_give_their_order(module):
    orders = [[f"meshes/{name}" for name in names.split()] for names in NAMED]
    answers = guess(module, *([{"path": path, "points": []} for path in sorted(each)] for each in orders))
    assert [answer["paths"] for answer in answers] == orders
    assert {answer["by"] for answer in answers} == {"names"}


def test_parts_of_a_real_arm_without_names_are_ordered_by_what_touches(module, shared):
    folder = shared / "testdata" / "urdf"
    urdf = str(folder / "motoman_gp8_support" / "urdf" / "gp8.urdf")
    model = pinocchio.buildModelFromUrdf(urdf)
    shapes = pinocchio.buildGeomFromUrdf(
        model, urdf, pinocchio.GeometryType.VISUAL, package_dirs=[str(folder)]
    )
    data, places = model.createData(), shapes.createData()
    pinocchio.updateGeometryPlacements(model, data, shapes, places, pinocchio.neutral(model))
    parts = []
    for letter, shape, place in zip("fbgdaec", shapes.geometryObjects, places.oMg, strict=True):
        own = surface_points(read_geometry(Path(shape.meshPath)), 200) * shape.meshScale.ravel()
        parts.append(
            {"path": f"part-{letter}.stl", "points": (own @ place.rotation.T + place.translation).tolist()}
        )
    # Drawn about their own origins, as most packages have them, they say nothing.
    own = [{**part, "points": (np.array(part["points"]) * 0.01).tolist()} for part in parts[:1]] * 3
    moved = [{**part, "path": path} for part, path in zip(own, "abc", strict=True)]
    named = [
        {**part, "path": path} for part, path in zip(parts[:3], ("base.stl", "x.stl", "y.stl"), strict=True)
    ]
    answers = guess(module, parts, moved, named)
    assert answers[0] == {
        "paths": [part["path"] for part in parts],
        "by": "geometry",
        "unnamed": sorted(part["path"] for part in parts),
    }
    assert answers[1]["by"] == "alphabet"
    assert (answers[2]["by"], answers[2]["paths"]) == ("both", ["base.stl", "x.stl", "y.stl"])


def test_names_by_place_follow_every_change_and_typed_ones_never_change(module):
    script = """
    const { empty, insertJoint, moveJoint, removeJoint, renameJoint } = page;
    const robot = empty();
    for (const at of [0, 1, 2, 3]) insertJoint(robot, at);
    renameJoint(robot, 1, "joint4");
    robot.frame.push({ name: "camera", link: "joint3", xyz: [0, 0, 0], rpy: [0, 0, 0] });
    robot.collision.ignore.push(["joint1", "joint3"]);
    robot.constraint.push({ joints: { joint1: 1, joint3: -1 }, limits: [0, 1] });
    const names = () => robot.joint.map(({ name }) => name);
    const steps = [names()];
    moveJoint(robot, 0, 2);
    steps.push(names());
    removeJoint(robot, 3);
    steps.push(names());
    insertJoint(robot, 0);
    steps.push(names());
    const { frame, collision, constraint } = robot;
    answer({ steps, frame: frame[0].link, ignore: collision.ignore, joints: constraint[0].joints });
    """
    answer = page_modules.ask(module, script, None)
    assert answer["steps"] == [
        ["joint1", "joint4", "joint3", "joint4_1"],
        ["joint4", "joint2", "joint3", "joint4_1"],
        ["joint4", "joint2", "joint3"],
        ["joint1", "joint4", "joint3", "joint4_1"],
    ]
    # The third joint is now the second, then again the third; the first is the third, then the fourth.
    assert answer["frame"] == "joint3"
    assert answer["ignore"] == [["joint4_1", "joint3"]]
    assert answer["joints"] == {"joint4_1": 1, "joint3": -1}
