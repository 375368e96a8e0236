"""Pairs of an arm's links: which are checked against each other, and with which geometry."""

import json
import re
import shutil
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from robomesh.schemas import robomesh_pb2 as schema
from robots.bodies import pair_study
from robots.bodies.link_pairs import plan_of
from robots.bodies.surfaces import winding_number
from robots.bodies.verdicts import Kind
from robots.collision import build_cell, own_contacts, own_nearest, path_encounters, pending
from robots.collision.cell import Cell
from robots.descriptions.cells import CellDescription, CellRobot
from robots.descriptions.description import load
from robots.descriptions.importing import import_robot
from robots.descriptions.save_description import write_folder
from robots.shapes.solids import ball
from services.command_line.main import run
from services.kinematics.worker.messages import CheckQuestion
from services.kinematics.worker.worker import begin
from tests.conftest import rest_is_long

REAL = Path(__file__).parents[3] / "shared" / "testdata" / "urdf" / "abb_irb2400_support"
# Studies run in separate processes.
pytestmark = pytest.mark.slow
needs_real_robots = pytest.mark.skipif(not REAL.is_dir(), reason="no ../shared/testdata/urdf: no real robots")


def solid(x: float, size: str, z: float = 0.0) -> str:
    return f'<collision><origin xyz="{x} 0 {z}"/><geometry><box size="{size}"/></geometry></collision>'


# The hand slides along x between two walls of the base, 0.19 m to each side, inside their hull.
WALLS = solid(-0.2, "0.02 0.4 0.4") + solid(0.2, "0.02 0.4 0.4")
ARM = """<robot name="hollow">
<link name="base">{base}</link>
<link name="arm">{arm}</link>
<link name="hand">{hand}</link>
<joint name="turn" type="revolute"><axis xyz="0 0 1"/><parent link="base"/><child link="arm"/>
  <limit lower="-0.1" upper="0.1" velocity="1" effort="1"/></joint>
<joint name="slide" type="prismatic"><axis xyz="1 0 0"/><parent link="arm"/><child link="hand"/>
  <limit lower="-0.3" upper="0.3" velocity="1" effort="1"/></joint>
</robot>"""


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


def hollow(folder: Path, *, base: str = WALLS, hand: str = solid(0, "0.1 0.1 0.1")) -> Path:
    path = folder / "hollow.urdf"
    path.write_text(ARM.format(base=base, arm=solid(0, "0.01 0.01 0.01", 0.3), hand=hand))
    return path


def cell_of(model: Path, *, wait: bool = True) -> Cell:
    return build_cell(CellDescription((CellRobot("arm", model, np.eye(4)),)), wait=wait)


def touching(cell: Cell, *positions: float) -> list[tuple[str, str]]:
    return [each.pair for each in own_contacts(cell, "arm", np.array(positions))]


def test_pair_of_which_only_hulls_touch_at_home_is_checked_as_shapes(tmp_path: Path) -> None:
    cell = cell_of(hollow(tmp_path))
    pair = ("arm/base", "arm/hand")
    assert touching(cell, 0.0, 0.0) == []
    assert touching(cell, 0.0, 0.135) == []
    assert touching(cell, 0.0, 0.145) == [pair]
    nearest = own_nearest(cell, "arm", np.zeros(2))
    assert nearest is not None
    assert nearest.distance_m == pytest.approx(0.14, abs=0.01)
    # On a path, into the wall.
    path = np.column_stack([np.zeros(50), np.linspace(0.0, 0.2, 50)])
    near = path_encounters(cell, "arm", path, {}, within_m=0.01)
    (encounter,) = (each for each in near.encounters if each.own)
    assert encounter.pair == pair
    assert path[encounter.samples[0], 1] == pytest.approx(0.14, abs=0.006)
    ((links, text),) = cell.arms["arm"].plan.refined
    assert links == ("base", "hand")
    assert "exact collision meshes" in text


# The hand is clear of both walls at home, fits between them, and moves through each.
BESIDE = solid(0.12, "0.02 0.4 0.4") + solid(0.3, "0.02 0.4 0.4")


def test_pair_apart_at_home_of_which_only_hulls_often_touch_is_checked_as_shapes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = hollow(tmp_path, base=BESIDE)
    cell = cell_of(model)
    pair = ("arm/base", "arm/hand")
    assert [touching(cell, 0.0, x) for x in (0.0, 0.1, 0.21, 0.27)] == [[], [pair], [], [pair]]
    for x, distance in ((-0.1, 0.16), (0.0, 0.06), (0.21, 0.03), (0.27, 0.0)):
        nearest = own_nearest(cell, "arm", np.array([0.0, x]))
        assert nearest is not None
        assert nearest.distance_m == pytest.approx(distance, abs=0.01)
    # On a path, through the first wall, up to the second.
    path = np.column_stack([np.zeros(200), np.linspace(-0.3, 0.3, 200)])
    (encounter,) = (
        each for each in path_encounters(cell, "arm", path, {}, within_m=0.01).encounters if each.own
    )
    angles = path[encounter.samples, 1]
    assert angles.min() == pytest.approx(0.06, abs=0.006)
    free = angles[np.diff(angles, append=angles[-1]).argmax() :][:2]
    assert free == pytest.approx([0.18, 0.24], abs=0.006)
    assert run(["robot", "check", str(model)]) == 0
    # 10 % expected, with a standard deviation of 1.5 %.
    found = re.search(
        r"base and hand are apart at home; only their hulls touch in (\d+) % of", capsys.readouterr().out
    )
    assert found is not None
    assert int(found[1]) == pytest.approx(10, abs=5)


@pytest.mark.parametrize(
    "base",
    [solid(0.2, "0.2 0.4 0.4"), solid(0.2, "0.02 0.4 0.4")],
    ids=["its solid holds the hand", "its hull is its mesh"],
)
def test_pair_apart_at_home_stays_hulls_if_shapes_touch_as_often(tmp_path: Path, base: str) -> None:
    cell = cell_of(hollow(tmp_path, base=base))
    assert cell.arms["arm"].plan.elsewhere == ()
    assert touching(cell, 0.0, 0.2) == [("arm/base", "arm/hand")]


def test_too_large_shapes_and_a_failed_study_leave_hulls(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pair_study, "_failed", {})
    model = hollow(tmp_path, base=BESIDE)
    with monkeypatch.context() as broken:
        broken.setattr(pair_study.sys, "executable", "/bin/false")
        cell = cell_of(model)
    assert cell.arms["arm"].plan.elsewhere == cell.arms["arm"].plan.refined == ()
    assert touching(cell, 0.0, 0.21) == [("arm/base", "arm/hand")]
    monkeypatch.setattr(pair_study, "MOST_TRIANGLES", 30)
    monkeypatch.setattr(
        "robots.bodies.link_pairs.study_results", lambda case, *, wait: pair_study.study(case)
    )
    ((links, text),) = plan_of(load(model)).elsewhere
    assert links == ("base", "hand")
    assert "hulls are checked, for the exact meshes have over" in text


def test_a_study_is_made_once_for_the_same_content(
    tmp_path: Path, own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = hollow(tmp_path)
    cell_of(model)
    (kept,) = own_cache.rglob("*.json")
    other = tmp_path / "other"
    other.mkdir()
    shutil.copy(model, other)

    def refused(*_: object, **__: object) -> None:
        raise AssertionError("another process was started")

    monkeypatch.setattr(pair_study.subprocess, "Popen", refused)
    assert touching(cell_of(other / model.name), 0.0, 0.0) == []
    assert [*own_cache.rglob("*.json")] == [kept]


@pytest.mark.parametrize(
    "damaged",
    rest_is_long(2, ("", '[["nothing", 0.0]]', "[", "5", "[]", '[["apart"]]', '[["apart", null]]')),
    ids=["empty", "no kind", "cut off", "a number", "too few", "too short", "no share"],
)
def test_a_damaged_result_of_a_study_is_replaced(tmp_path: Path, own_cache: Path, damaged: str) -> None:
    model = hollow(tmp_path)
    cell_of(model)
    (kept,) = own_cache.rglob("*.json")
    whole = kept.read_text()
    kept.write_text(damaged)
    assert touching(cell_of(model), 0.0, 0.0) == []
    assert kept.read_text() == whole


def test_threads_share_the_same_study(own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pair_study, "_failed", {})
    monkeypatch.setattr(pair_study, "_running", {})
    started, waiting, ended = [], threading.Semaphore(0), threading.Event()

    class Failing:
        def __init__(self, *_: object, **__: object) -> None:
            started.append(self)

        def wait(self, _: float) -> None:
            waiting.release()
            assert ended.wait(60.0)

    monkeypatch.setattr(pair_study.subprocess, "Popen", Failing)
    none = np.empty((0, 3, 3))
    case = pair_study.Case(((0, 1),), (none, none), (none, none), np.eye(4)[None, None], (np.empty(0, int),))
    with ThreadPoolExecutor(2) as threads:
        asked = [threads.submit(pair_study.study_results, case) for _ in range(2)]
        for _ in asked:
            assert waiting.acquire(timeout=60.0)
        ended.set()
        for each in asked:
            assert each.result() == (pair_study.Finding(Kind.NOT_STUDIED),)
    assert len(started) == 1
    ((failures, _),) = pair_study._failed.values()
    assert failures == 1


def test_a_cell_is_pending_until_the_study_ends(tmp_path: Path) -> None:
    model = hollow(tmp_path)
    waiting = cell_of(model, wait=False)
    assert pending(waiting) == ("arm",)
    assert touching(waiting, 0.0, 0.0) == [("arm/base", "arm/hand")]
    assert pending(cell_of(model)) == ()
    assert pending(cell_of(model, wait=False)) == ()


def test_failed_study_leaves_hulls_and_is_repeated_later(
    tmp_path: Path, own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pair_study, "_failed", {})
    model = hollow(tmp_path)
    with monkeypatch.context() as broken:
        broken.setattr(pair_study.sys, "executable", "/bin/false")
        cell = cell_of(model)
    assert touching(cell, 0.0, 0.0) == [("arm/base", "arm/hand")]
    ((_, text),) = cell.arms["arm"].plan.refined
    assert "hulls are checked" in text
    assert [*own_cache.rglob("*.json")] == []
    ((path, (failures, _)),) = pair_study._failed.items()
    assert failures == 1
    # Not immediately, ...
    assert pending(cell_of(model, wait=False)) == ("arm",)
    assert pair_study._running == {}
    pair_study._failed[path] = (pair_study._TRIES, pair_study._failed[path][1])
    unready = cell_of(model, wait=False)
    assert (pending(unready), touching(unready, 0.0, 0.0)) == ((), [("arm/base", "arm/hand")])
    # ... but later.
    pair_study._failed[path] = (failures, 0.0)
    assert touching(cell_of(model), 0.0, 0.0) == []
    assert pair_study._failed == {}


def test_kinematics_service_answers_checks_during_a_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pair_study, "_running", {})
    answer = begin({"arm": CellDescription((CellRobot("arm", hollow(tmp_path), np.eye(4)),))})
    home = CheckQuestion("arm", schema.CheckRequest(program="home").SerializeToString(), np.zeros(2), {})
    text = "links whose hulls touch are not studied yet; until then they are checked as hulls"

    class Endless:
        def __init__(self, *_: object, **__: object) -> None:
            pass

        def poll(self) -> None:
            return None

        def wait(self, _: float) -> None:
            raise AssertionError("somebody waited for the study")

    with monkeypatch.context() as patch:
        patch.setattr(pair_study.subprocess, "Popen", Endless)
        for _ in range(2):
            unready = schema.CheckAnswer.FromString(answer(home))
            assert text in unready.notes
            assert not unready.ok
    pair_study._running.clear()
    cell_of(tmp_path / "hollow.urdf")
    ready = schema.CheckAnswer.FromString(answer(home))
    assert text not in ready.notes
    assert ready.ok


def test_link_inside_another_touches_it_and_one_in_a_cavity_does_not(tmp_path: Path) -> None:
    inside = cell_of(hollow(tmp_path, base=solid(0, "2 0.4 0.4")))
    assert "all of 10,000 positions" in dict(inside.arms["arm"].plan.ignored)["base", "hand"]
    vertices, triangles = ball(1.0, 16)
    outer = vertices[triangles]
    shell = np.concatenate([outer, 0.9 * outer[:, ::-1]])
    middle, wall = np.array([0.01, 0.02, 0.03]), np.array([0.01, 0.02, 0.95])
    assert abs(winding_number(outer, middle)) == pytest.approx(1.0)
    assert winding_number(shell, middle) == pytest.approx(0.0, abs=1e-9)
    assert abs(winding_number(shell, wall)) == pytest.approx(1.0)


def test_only_a_pair_that_touches_everywhere_as_shapes_too_is_ignored(tmp_path: Path) -> None:
    # The hand is a bar that goes through the base in every position.
    inside = solid(0, "1.2 0.05 0.05")
    always = cell_of(hollow(tmp_path, base=solid(0, "0.01 0.2 0.01"), hand=inside))
    reasons = dict(always.arms["arm"].plan.ignored)
    assert "all of 10,000 positions" in reasons["base", "hand"]
    assert touching(always, 0.0, 0.0) == []


def test_contact_at_home_does_not_exclude_a_pair(tmp_path: Path) -> None:
    cell = cell_of(hollow(tmp_path, base=solid(0.05, "0.02 0.4 0.4")))
    assert ("base", "hand") not in dict(cell.arms["arm"].plan.ignored)
    assert touching(cell, 0.0, 0.0) == [("arm/base", "arm/hand")]
    assert touching(cell, 0.0, -0.2) == []


@pytest.mark.parametrize(("reason", "ignored"), [("Default", True), ("User", True), ("Never", False)])
def test_pairs_that_the_srdf_disables_are_ignored_unless_they_never_touch(
    tmp_path: Path, reason: str, ignored: bool
) -> None:
    model = hollow(tmp_path)
    disabled = f'<disable_collisions link1="hand" link2="base" reason="{reason}"/>'
    (tmp_path / "any.srdf").write_text(f'<robot name="hollow">{disabled}</robot>')
    reasons = dict(cell_of(model).arms["arm"].plan.ignored)
    assert (reasons.get(("base", "hand")) == "any.srdf says so") is ignored


@pytest.mark.parametrize(("folder", "ignored"), [("urdf", True), ("robots", True), ("elsewhere", False)])
def test_srdf_folder_next_to_a_packages_urdf_folder_is_used(
    tmp_path: Path, folder: str, ignored: bool
) -> None:
    (tmp_path / folder).mkdir()
    (tmp_path / "srdf").mkdir()
    disabled = '<disable_collisions link1="hand" link2="base" reason="User"/>'
    (tmp_path / "srdf" / "hollow.srdf").write_text(f'<robot name="hollow">{disabled}</robot>')
    plan = cell_of(hollow(tmp_path / folder)).arms["arm"].plan
    assert (("base", "hand") in dict(plan.ignored)) is ignored


@pytest.mark.parametrize(
    ("name", "ignored"),
    [
        ("hollow_2_5", True),
        ("hollow", True),
        ("Hollow-2", False),
        ("hollow_2", True),
        ("HOLLOW", True),
        ("", True),
        ("hol", False),
        ("other", False),
    ],
)
def test_an_srdf_alone_with_a_urdf_is_used_unless_it_names_another_robot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, ignored: bool
) -> None:
    model = hollow(tmp_path)
    model.write_text(model.read_text().replace('"hollow"', '"hollow_2_5"'))
    disabled = '<disable_collisions link1="hand" link2="base" reason="User"/>'
    (tmp_path / "any.srdf").write_text(f'<robot name="{name}">{disabled}</robot>')
    plan = plan_of(load(model))
    assert (("base", "hand") in dict(plan.ignored)) is ignored
    assert run(["robot", "check", str(model)]) == 0
    found = f"any.srdf: is for the robot '{name}'; it is not used"
    assert (found in capsys.readouterr().out) is not ignored


@pytest.mark.parametrize("urdf", ["hollow", "of_another_name"])
def test_srdf_with_the_urdfs_or_robots_name_has_priority(tmp_path: Path, urdf: str) -> None:
    model = hollow(tmp_path)
    model = model.rename(model.with_stem(urdf))
    disabled = '<disable_collisions link1="hand" link2="base" reason="User"/>'
    for name in ("a", "hollow"):
        (tmp_path / f"{name}.srdf").write_text(f'<robot name="hollow">{disabled}</robot>')
    assert dict(plan_of(load(model)).ignored)["base", "hand"] == "hollow.srdf says so"


def test_the_srdf_of_another_robot_and_a_broken_one_are_not_used(tmp_path: Path) -> None:
    model = hollow(tmp_path)
    (tmp_path / "second.urdf").write_text("<robot/>")
    srdf = tmp_path / "any.srdf"
    srdf.write_text('<robot name="x"><disable_collisions link1="hand" link2="base"/></robot>')
    assert ("base", "hand") not in dict(cell_of(model).arms["arm"].plan.ignored)
    (tmp_path / "second.urdf").unlink()
    srdf.write_text("<robot")
    assert touching(cell_of(model), 0.0, 0.0) == []


@pytest.mark.parametrize("as_dh", [True, False], ids=["rows", "urdf"])
def test_imported_robot_keeps_the_pairs_that_its_srdf_disables(tmp_path: Path, as_dh: bool) -> None:
    model = hollow(tmp_path, base=solid(0.05, "0.02 0.4 0.4"))
    disabled = '<disable_collisions link1="hand" link2="base" reason="User"/>'
    (tmp_path / "hollow.srdf").write_text(f'<robot name="hollow">{disabled}</robot>')
    robot = import_robot(str(model), as_dh=as_dh)
    saved = write_folder(robot.values, robot.files, tmp_path / "imported").path
    assert ("base", "hand") in dict(cell_of(saved).arms["arm"].plan.ignored)


@pytest.mark.parametrize(
    ("others", "ignored"), [("", False), ('<disable_collisions link1="cap" link2="base"/>', True)]
)
def test_rows_link_of_several_links_is_ignored_if_all_of_them_are(
    tmp_path: Path, others: str, ignored: bool
) -> None:
    model = hollow(tmp_path)
    cap = f'<link name="cap">{solid(0, "0.1 0.1 0.1", 0.1)}</link><joint name="screws" type="fixed">'
    cap += '<parent link="hand"/><child link="cap"/></joint></robot>'
    model.write_text(model.read_text().replace("</robot>", cap))
    disabled = '<disable_collisions link1="hand" link2="base" reason="User"/>'
    (tmp_path / "hollow.srdf").write_text(f'<robot name="hollow">{disabled}{others}</robot>')
    values = import_robot(str(model), as_dh=True).values
    assert values.get("collision", {}).get("ignore", []) == ([["base", "hand"]] if ignored else [])


def test_robot_check_lists_unchecked_pairs_and_protruding_geometry(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = '<visual><geometry><box size="0.1 0.1 0.118"/></geometry></visual>'
    model = hollow(tmp_path, hand=seen + solid(0, "0.1 0.1 0.1"))
    assert run(["robot", "check", str(model), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["not_checked"] == [
        {"links": ["base", "arm"], "reason": "one joint apart"},
        {"links": ["arm", "hand"], "reason": "one joint apart"},
    ]
    assert report["touch_at_home"][0]["links"] == ["base", "hand"]
    assert report["stands_out"] == {"hand": pytest.approx(0.009, abs=1e-6)}
    assert run(["robot", "check", str(model)]) == 0
    assert "extends beyond checked geometry by 9.0 mm" in capsys.readouterr().out


@needs_real_robots
def test_a_real_arm_with_a_spherical_wrist_is_free_at_home_with_and_without_its_srdf(tmp_path: Path) -> None:
    shutil.copytree(REAL, tmp_path / REAL.name, copy_function=shutil.copyfile)
    model = tmp_path / REAL.name / "urdf" / "irb2400_12_155.urdf"
    with_srdf = cell_of(model)
    (tmp_path / REAL.name / "urdf" / "abb_irb2400.srdf").unlink()
    other = model.rename(model.with_name("other.urdf"))
    without = cell_of(other)
    for cell, reason in ((with_srdf, "abb_irb2400.srdf says so"), (without, "all of 10,000 positions")):
        assert touching(cell, *np.zeros(6)) == []
        assert reason in dict(cell.arms["arm"].plan.ignored)["link_4", "link_6"]
        # A pair that never touched stays checked.
        assert ("link_2", "link_6") not in dict(cell.arms["arm"].plan.ignored)
