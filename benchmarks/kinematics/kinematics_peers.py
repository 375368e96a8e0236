"""Peers on the same arms, targets and tasks: `kinematics` runs this with a Python that has them.

    PEERS_PYTHON benchmarks/kinematics/kinematics_peers.py ARMS.json

It imports no module of the project. Each arm is a list of joints that turn about z: the placement of each in
the previous one, and of the tool in the last.
"""

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

# Half the squared error [m^2 + rad^2], for an error within 1e-5.
TOLERANCE = 5e-11
# For solvers that take a tenth of a second for each target.
SLOW_TARGETS = 100


def main() -> None:
    arms = json.loads(Path(sys.argv[1]).read_text())
    answer: dict[str, Any] = {"roboticstoolbox": {}, "mujoco": {}, "ikpy": {}}
    for name, arm in arms.items():
        arm = {key: np.array(value) for key, value in arm.items()}
        for peer, measure in (("roboticstoolbox", toolbox), ("mujoco", mujoco_), ("ikpy", ikpy_)):
            try:
                answer[peer][name] = measure(arm)
            except Exception as error:  # not only ImportError: a peer may fail on another's old package
                answer[peer][name] = {"missing": f"{type(error).__name__}: {error}"}
    print(json.dumps(answer))


def toolbox(arm: dict[str, Any]) -> dict[str, Any]:
    import roboticstoolbox as rtb

    ets = rtb.ETS()
    for placement, lower, upper in zip(arm["joints"], arm["lower"], arm["upper"], strict=True):
        ets = ets * rtb.ET.SE3(placement) * rtb.ET.Rz(qlim=[lower, upper])
    ets = ets * rtb.ET.SE3(arm["tool"])
    found, times = [], []
    for target in arm["targets"]:
        begin = time.perf_counter()
        # The best damping for it, of 1, 0.1 and 0.01.
        solution = ets.ik_LM(target, q0=arm["home"], tol=TOLERANCE, method="chan", k=0.1)
        times.append(time.perf_counter() - begin)
        found.append(np.asarray(solution.q if hasattr(solution, "q") else solution[0]).tolist())

    def both(positions: Any) -> None:
        ets.eval(positions)
        ets.jacob0(positions)

    tools = [np.asarray(ets.eval(positions)).tolist() for positions in arm["positions"]]
    return {
        "version": rtb.__version__,
        "solutions": found,
        "seconds": times,
        "tools": tools,
        "per_second": rate(both, arm["positions"]),
    }


def mujoco_(arm: dict[str, Any]) -> dict[str, Any]:
    import mujoco

    opened, text = 0, ""
    for placement in arm["joints"]:
        text += f'<body {pose(placement)}><joint axis="0 0 1"/><geom size="0.01" mass="1"/>'
        opened += 1
    text += f'<site name="tool" {pose(arm["tool"])}/>' + "</body>" * opened
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    site = model.site("tool").id
    linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))

    def both(positions: Any) -> None:
        data.qpos[:] = positions
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacSite(model, data, linear, angular, site)

    places = []
    for positions in arm["positions"]:
        both(positions)
        places.append(data.site_xpos[site].tolist())
    return {"version": mujoco.__version__, "places": places, "per_second": rate(both, arm["positions"])}


def ikpy_(arm: dict[str, Any]) -> dict[str, Any]:
    import importlib.metadata
    import warnings

    from ikpy.chain import Chain
    from ikpy.link import OriginLink, URDFLink

    warnings.simplefilter("ignore")
    links: list[Any] = [OriginLink()]
    for number, placement in enumerate(arm["joints"]):
        links.append(
            URDFLink(
                f"j{number}",
                placement[:3, 3],
                rpy(placement),
                rotation=np.array([0.0, 0.0, 1.0]),
                bounds=(arm["lower"][number], arm["upper"][number]),
            )
        )
    links.append(URDFLink("tool", arm["tool"][:3, 3], rpy(arm["tool"]), joint_type="fixed", rotation=None))
    chain = Chain(links, active_links_mask=[False, *[True] * len(arm["joints"]), False])
    home = np.concatenate([[0.0], arm["home"], [0.0]])
    five = len(arm["joints"]) == 5
    found, times = [], []
    for target in arm["targets"][:SLOW_TARGETS]:
        begin = time.perf_counter()
        positions = chain.inverse_kinematics(
            target[:3, 3],
            target[:3, 2] if five else target[:3, :3],
            orientation_mode="Z" if five else "all",
            initial_position=home,
        )
        times.append(time.perf_counter() - begin)
        found.append(positions[1:-1].tolist())
    return {"version": importlib.metadata.version("ikpy"), "solutions": found, "seconds": times}


def rate(call: Any, positions: Any) -> float:
    """Return the calls a second: the best of five rounds over the positions."""
    best = np.inf
    for _ in range(5):
        begin = time.perf_counter()
        for each in positions:
            call(each)
        best = min(best, time.perf_counter() - begin)
    return len(positions) / float(best)


def pose(placement: Any) -> str:
    """Return a placement in MJCF's form, with Shepperd's quaternion."""
    r = placement[:3, :3]
    squares = [1 + np.trace(r), *(1 + 2 * r[i, i] - np.trace(r) for i in range(3))]
    k = int(np.argmax(squares))
    if k == 0:
        q = [squares[0], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]
    else:
        i = k - 1
        j, m = (i + 1) % 3, (i + 2) % 3
        q = [r[m, j] - r[j, m], 0.0, 0.0, 0.0]
        q[1 + i], q[1 + j], q[1 + m] = squares[k], r[j, i] + r[i, j], r[m, i] + r[i, m]
    quaternion = np.array(q) / np.linalg.norm(q)
    numbers = " ".join(f"{x:.17g}" for x in quaternion)
    return f'pos="{" ".join(f"{x:.17g}" for x in placement[:3, 3])}" quat="{numbers}"'


def rpy(placement: Any) -> Any:
    r = placement[:3, :3]
    pitch = np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0]))
    if np.hypot(r[0, 0], r[1, 0]) < 1e-12:
        return np.array([0.0, pitch, np.arctan2(-r[0, 1], r[1, 1])])
    return np.array([np.arctan2(r[2, 1], r[2, 2]), pitch, np.arctan2(r[1, 0], r[0, 0])])


if __name__ == "__main__":
    main()
