"""Kinematics and checks: calls a second, share solved and time taken, compared with peers in the same run.

    ./dev run python -m benchmarks kinematics [--targets 1000] [--peers-python PYTHON] [--json]

PYTHON is a separate environment with roboticstoolbox-python, mujoco and ikpy. UR5 and Panda are measured if
`./dev example-robots` installed them. All solvers get the same targets, which random joint positions
within limits reach, and start at home. roboticstoolbox searches to 1e-5 m, ours to 1e-12 m; a solution
counts within limits and 1e-4 m, 1e-3 rad. Its distance from home is the root of the sum of the squared
differences, as shares of the joints' ranges. For Pt500 and Pt600 the task is position and tool axis.
roboticstoolbox has no such task and solves for the whole pose, which is reachable too. TRAC-IK's figures
are quoted, not measured.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pinocchio
from google.protobuf.timestamp_pb2 import Timestamp
from typer import Option

from robots.checks.check import check_program
from robots.collision import allowed_positions, build_cell, outside_nearest, own_contacts, own_nearest
from robots.descriptions.cells import CellDescription, CellRobot, Fixture
from robots.descriptions.description import known_names, load
from robots.kinematics.inverse import InverseSolver, Task, build_solver, solve
from robots.kinematics.joints import FloatArray, violations
from robots.kinematics.model import RobotModel, all_positions, build_model, tool_jacobian, tool_placement
from robots.kinematics.singularity import arm_length
from robots.schema.poses import inverse
from services.kinematics.cell_state import CellState
from services.kinematics.states import FramesMessage, StateMessage, add_proximity
from services.site_file.tables.fixtures import Fixture as FixtureSettings
from services.site_file.tables.fixtures import fixture_shape

ARMS = {
    "ur5": Task.POSE_6D,
    "panda": Task.POSE_6D,
    "puma560": Task.POSE_6D,
    "pt500": Task.POSITION_AND_AXIS_5D,
    "pt600": Task.POSITION_AND_AXIS_5D,
}
# TRAC-IK 1.5.1, its README: 10,000 targets each, 1e-5, at most 5 ms; solved, average ms.
TRAC_IK = {"ur5": (99.17, 0.37), "panda": (99.88, 0.37), "Fanuc M-430iA/2F, 5 joints": (99.93, 0.36)}


def measure(
    targets: int = 1000,
    peers_python: Annotated[str, Option(help="a Python that has the peers")] = "",
) -> dict[str, Any]:
    names = [name for name in ARMS if name in known_names()]
    arms = {name: Arm(name, targets) for name in names}
    peers = ask_peers(arms, peers_python) if peers_python else {}
    toolbox, others = peers.get("roboticstoolbox", {}), peers.get("mujoco", {})
    result: dict[str, Any] = {"targets": targets, "forward": [], "inverse": [], "trac_ik_read": TRAC_IK}
    result["peers"], result["missing"] = {}, {}
    for name, arms_of in peers.items():
        answer = next(iter(arms_of.values()))
        kind = "peers" if "version" in answer else "missing"
        result[kind][name] = answer.get("version", answer.get("missing"))
    for name, arm in arms.items():
        there = toolbox.get(name, {})
        row = {"arm": name, **arm.forward(), "roboticstoolbox": there.get("per_second")}
        row["mujoco"] = others.get(name, {}).get("per_second")
        if "tools" in there:
            own = [tool_placement(arm.model, arm.whole(x)) for x in arm.positions]
            row["from_roboticstoolbox_m"] = float(np.abs(np.array(there["tools"]) - own).max())
        result["forward"].append(row)
        searching = replace(arm.solver, closed=None)
        solvers = {"ours": arm.solver, "ours, by search": searching}
        for who, solver in solvers.items() if arm.solver.closed else [("ours, by search", searching)]:
            result["inverse"].append({"arm": name, "who": who, **arm.inverse(solver)})
        for peer in ("roboticstoolbox", "ikpy"):
            found = peers.get(peer, {}).get(name, {})
            if "solutions" in found:
                judged = arm.judged(found["solutions"], found["seconds"])
                result["inverse"].append({"arm": name, "who": peer, **judged})
    result["collision"] = collisions("ur5" if "ur5" in names else "puma560")
    result["messages"] = messages()
    result["program"] = program()
    return result


class Arm:
    """An arm and its test cases; x (m,) holds the positions of the joints that move its tool."""

    def __init__(self, name: str, count: int) -> None:
        description = load(name)
        self.name, self.task = name, ARMS[name]
        self.model: RobotModel = build_model(description)
        self.solver: InverseSolver = build_solver(description)
        self.chain = self.solver.chain
        random = np.random.default_rng(1)
        self.positions: list[FloatArray] = []
        while len(self.positions) < count:
            x = random.uniform(self.chain.lower, self.chain.upper)
            if not violations(self.model.joints, self.whole(x)):
                self.positions.append(x)
        self.targets = [tool_placement(self.model, self.whole(x)) for x in self.positions]

    def whole(self, x: Sequence[float] | FloatArray) -> FloatArray:
        positions = self.model.joints.home.copy()
        positions[self.chain.moving] = x
        return positions

    def forward(self) -> dict[str, Any]:
        """Count the calls a second of forward kinematics and Jacobian together."""
        model, everywhere = self.model, [self.whole(x) for x in self.positions]
        inner, data, frame = model._pinocchio, model._workspace, model._frame_ids[0]

        def ours(positions: FloatArray) -> None:
            tool_placement(model, positions)
            tool_jacobian(model, positions)

        everything = [all_positions(model, x) for x in everywhere]

        def bare(positions: FloatArray) -> None:
            pinocchio.computeJointJacobians(inner, data, positions)
            pinocchio.updateFramePlacement(inner, data, frame)

        return {
            "ours": rate(ours, everywhere),
            "pinocchio": rate(bare, everything),
            "from_product_m": max(self._from_product(x) for x in everywhere),
        }

    def _from_product(self, positions: FloatArray) -> float:
        """Return the distance between the tool and its place by a plain product of matrices."""
        placement = np.eye(4)
        for fixed, angle in zip(self.fixed()[:-1], positions[self.chain.moving], strict=True):
            c, s = np.cos(angle), np.sin(angle)
            turn = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
            placement = placement @ fixed @ turn
        return float(np.abs(placement @ self.fixed()[-1] - tool_placement(self.model, positions)).max())

    def fixed(self) -> list[FloatArray]:
        """Return (4, 4) from each joint (axis z) to the previous one, and from the tool to the last."""
        if not hasattr(self, "_fixed"):
            frames = [np.eye(4)]
            for axis, origin in zip(self.chain.axes, self.chain.origins, strict=True):
                side = np.cross(axis, [1, 0, 0] if abs(axis[0]) < 0.7 else [0, 1, 0])
                side /= np.linalg.norm(side)
                frame = np.eye(4)
                frame[:3, :3] = np.column_stack([side, np.cross(axis, side), axis])
                frame[:3, 3] = origin
                frames.append(frame)
            frames.append(self.chain.tool_to_base)
            self._fixed = [inverse(one) @ other for one, other in pairwise(frames)]
        return self._fixed

    def inverse(self, solver: InverseSolver) -> dict[str, Any]:
        found, times = [], []
        for target in self.targets:
            begin = time.perf_counter()
            result = solve(solver, target, task=self.task)
            times.append(time.perf_counter() - begin)
            found.append(result.solutions[0][self.chain.moving] if len(result.solutions) else None)
        return self.judged(found, times)

    def judged(self, found: Sequence[Any], seconds: Sequence[float]) -> dict[str, Any]:
        """Return which solutions are correct, by forward kinematics.

        Coupled limits do not count, because the peers do not know them.
        """
        solved, worst, distances = 0, 0.0, []
        weights = np.array([weight for _, _, weight in self.chain.limits])
        for x, target in zip(found, self.targets, strict=False):
            if x is None or not np.isfinite(x).all():
                continue
            x = np.asarray(x)
            positions = self.whole(x)
            apart = inverse(target) @ tool_placement(self.model, positions)
            away = float(np.linalg.norm(apart[:3, 3]))
            if self.task is Task.POSE_6D:
                angle = float(np.arccos(np.clip((np.trace(apart[:3, :3]) - 1) / 2, -1, 1)))
            else:
                angle = float(np.arctan2(np.hypot(apart[0, 2], apart[1, 2]), apart[2, 2]))
            inside = (x >= self.chain.lower - 1e-9).all() and (x <= self.chain.upper + 1e-9).all()
            if away <= 1e-4 and angle <= 1e-3 and inside:
                solved += 1
                worst = max(worst, away)
                distances.append(float(np.sqrt(np.square(x - self.chain.home) @ weights)))
        spread = 1000 * np.array(seconds)
        return {
            "targets": len(found),
            "solved": 100.0 * solved / len(found),
            "worst_m": worst,
            "from_home": float(np.mean(distances)) if distances else float("nan"),
            "median_ms": float(np.median(spread)),
            "mean_ms": float(spread.mean()),
            "p99_ms": float(np.percentile(spread, 99)),
        }


def ask_peers(arms: dict[str, Arm], python: str) -> dict[str, Any]:
    asked = {
        name: {
            "joints": [fixed.tolist() for fixed in arm.fixed()[:-1]],
            "tool": arm.fixed()[-1].tolist(),
            "lower": arm.chain.lower.tolist(),
            "upper": arm.chain.upper.tolist(),
            "home": arm.chain.home.tolist(),
            "positions": [x.tolist() for x in arm.positions],
            "targets": [target.tolist() for target in arm.targets],
        }
        for name, arm in arms.items()
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arms.json"
        path.write_text(json.dumps(asked))
        program = Path(__file__).with_name("kinematics_peers.py")
        try:
            done = subprocess.run(
                [python, str(program), str(path)], capture_output=True, text=True, check=False
            )
        except OSError as error:
            print(f"no peers: {python}: {error.strerror}", file=sys.stderr)
            return {}
    if done.returncode:
        print(f"no peers: {python}: {done.stderr.strip().rpartition(chr(10))[2]}", file=sys.stderr)
        return {}
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


def rate(call: Callable[[FloatArray], Any], positions: Sequence[FloatArray]) -> float:
    """Return the calls a second: the best of five rounds over the positions."""
    best = np.inf
    for _ in range(5):
        begin = time.perf_counter()
        for each in positions:
            call(each)
        best = min(best, time.perf_counter() - begin)
    return len(positions) / float(best)


def around(*, beyond: int = 0) -> tuple[Fixture, ...]:
    """Return three fixtures around an arm on the floor, and others just beyond its reach."""
    rows = [
        ("table", (600.0, 800.0, 100.0), (650.0, 0.0, 50.0)),
        ("fence", (20.0, 1500.0, 1000.0), (-800.0, 0.0, 500.0)),
        ("post", (80.0, 80.0, 900.0), (150.0, -900.0, 450.0)),
    ]
    for number in range(beyond):
        angle, out = number * 2.4, 1300.0 + 8.0 * number
        xyz = (out * np.cos(angle), out * np.sin(angle), 100.0 * (number % 12))
        rows.append((f"box-{number}", (100.0, 100.0, 200.0), xyz))
    fixtures = []
    for name, size, xyz in rows:
        placement = np.eye(4)
        placement[:3, 3] = np.divide(xyz, 1000.0)
        shape = fixture_shape(FixtureSettings(cell="a", name=name, box=size))
        fixtures.append(Fixture(name, (shape,), placement))
    return tuple(fixtures)


def collisions(name: str) -> dict[str, Any]:
    """Count the checks of hulls a second at random positions."""
    cell = build_cell(CellDescription((CellRobot("arm", name, np.eye(4)),), around()))
    joints = cell.arms["arm"].joints
    random = np.random.default_rng(2)
    positions = [random.uniform(joints.lower, joints.upper) for _ in range(1000)]
    free = [x for x in positions if not own_contacts(cell, "arm", x)]
    return {
        "arm": name,
        "pairs": len(cell.arms["arm"].own.pairs),
        "own_contacts": rate(lambda x: own_contacts(cell, "arm", x), free),
        "touching": 1.0 - len(free) / len(positions),
        "own_contacts_with_points": rate(lambda x: own_contacts(cell, "arm", x), positions),
        "own_nearest": rate(lambda x: own_nearest(cell, "arm", x), positions),
        "outside_within_warning": rate(
            lambda x: outside_nearest(cell, "arm", x, {}, within_m=0.05), positions
        ),
    }


def messages() -> dict[str, float]:
    """Return the times of what the kinematics service publishes for a Pt600 next to another one [us]."""
    apart = np.eye(4)
    apart[1, 3] = 0.9
    arms = CellRobot("arm", "pt600", np.eye(4)), CellRobot("other", "pt600", apart)
    cell, description, now = build_cell(CellDescription(arms, around())), load("pt600"), Timestamp(seconds=1)
    model, reach = build_model(description), arm_length(description)
    state = CellState({"arm": np.inf, "other": np.inf}, time.monotonic)
    state.update("other", model.joints.home)
    frames = FramesMessage(model, prefix="bench/arm", base_to_site=np.eye(4))
    states = StateMessage(model, reach=reach)
    inner, data, tool = model._pinocchio, model._workspace, model._frame_ids[0]

    def bare(positions: FloatArray) -> None:
        pinocchio.framesForwardKinematics(inner, data, positions)
        pinocchio.computeFrameJacobian(inner, data, positions, tool, pinocchio.ReferenceFrame.LOCAL)

    def published(positions: FloatArray) -> None:
        found = states.filled(positions, positions, now)
        add_proximity(found, state.proximity(cell, "arm", positions), site="bench")
        found.SerializeToString()

    random = np.random.default_rng(4)
    positions = [model.joints.home + random.uniform(-0.3, 0.3, len(model.joints)) for _ in range(200)]
    calls = {
        "frames": lambda x: frames.filled(x, now).SerializeToString(),
        "state with clearance": published,
        "clearance alone": lambda x: state.proximity(cell, "arm", x),
        "all frames and a Jacobian in Pinocchio": bare,
    }
    return {name: 1e6 / rate(call, positions) for name, call in calls.items()}


def program() -> dict[str, Any]:
    """Return the check time of a minute of moves near three fixtures, and with more around them."""
    cell = build_cell(CellDescription((CellRobot("arm", "pt600", np.eye(4)),), around()))
    joints = cell.arms["arm"].joints
    start = joints.home
    clear = [
        x
        for x in allowed_positions(joints, 500, seed=3)
        if not own_contacts(cell, "arm", x) and not outside_nearest(cell, "arm", x, {}, within_m=0.05)
    ]
    # Use each motion once: a check caches the motions that it has seen.
    lines = ["speed 60", *("move_joints " + " ".join(f"{x:.2f}" for x in np.degrees(x)) for x in clear)]
    count, found = 1, None
    while found is None or found.duration_s < 60:
        count += 1
        text = "\n".join(lines[:count])
        found = check_program(text, cell, "arm", start)
    crowded = build_cell(CellDescription((CellRobot("arm", "pt600", np.eye(4)),), around(beyond=157)))
    best = {}
    for fixtures, where in ((3, cell), (160, crowded)):
        took = []
        for _ in range(3):
            begin = time.perf_counter()
            found = check_program(text, where, "arm", start)
            took.append(time.perf_counter() - begin)
        best[fixtures] = min(took)
    return {
        "duration_s": found.duration_s,
        "check_s": best[3],
        "check_160_fixtures_s": best[160],
        "ok": found.ok,
        "samples": len(found.path.times_s),
        "violations": [violation.text for violation in found.violations][:5],
    }
