"""`robomesh ik`, and the answer of `kinematics/inverse`."""

import io
import json
from typing import Any

import numpy as np
import pytest

from robomesh import reason_codes as codes
from robomesh.reasons import Code
from robomesh.schemas import robomesh_pb2 as schema
from robots.descriptions.description import load
from robots.kinematics.inverse import build_solver
from robots.kinematics.model import build_model, tool_placement
from services.command_line.main import run
from services.kinematics.worker.inverse import inverse_answer
from tests.conftest import needs_eaik
from tests.refusals import refused

MODEL = build_model(load("pt600"))
POSITIONS = np.radians([20.0, 40.0, 50.0, -10.0, 30.0])
TOOL = tool_placement(MODEL, POSITIONS)
SIX_D = schema.InverseRequest.POSE_6D


def asked(
    lines: list[Any], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> tuple[int, list[dict[str, Any]]]:
    text = "\n".join(line if isinstance(line, str) else json.dumps(line) for line in lines)
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
    status = run(["ik", "--robot", "pt600", "-"])
    return status, [json.loads(line) for line in capsys.readouterr().out.splitlines()]


@needs_eaik
def test_each_request_line_gets_an_answer_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    near = POSITIONS.tolist()
    lines = [
        {"pose": TOOL.tolist(), "task": "6d", "near": near},
        {"pose": TOOL.ravel().tolist(), "all": True, "seed": 3, "near": near},
    ]
    status, answers = asked(lines, capsys, monkeypatch)
    assert status == 0
    for answer in answers:
        assert set(answer) == {"solutions", "residual_m", "residual_rad", "reason", "analytic"}
        np.testing.assert_allclose(answer["solutions"][0], POSITIONS, atol=1e-9)
        assert answer["analytic"] is True
        assert answer["reason"] == ""
    assert len(answers[0]["solutions"]) == 1
    assert len(answers[1]["solutions"]) >= 2


POSE = TOOL.tolist()


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("nonsense", "'nonsense' is no request"),
        ([1], "'[1]' is no request"),
        ({"task": "6d"}, "is no request"),
        ({"pose": POSE, "nar": []}, "'nar': must be one of all, near, pose, seed, task"),
        ({"pose": POSE, "task": "7d"}, "task '7d': must be one of 6d, 5d, 3d"),
        ({"pose": POSE, "seed": -1}, "seed -1: must be a whole number from 0"),
        ({"pose": POSE, "all": 1}, "all 1: must be true or false"),
        ({"pose": POSE, "near": ["a"]}, "near ['a']: must be a number for each joint"),
        ({"pose": POSE, "near": [0.0]}, "this robot takes (5,)"),
        ('{"pose": ' + str(POSE) + ', "near": [0, 0, 0, 0, NaN]}', "not finite"),
        ({"pose": [1.0]}, "the pose has 1 numbers; it must have 16"),
    ],
)
def test_an_invalid_line_gets_an_error_and_the_next_an_answer(
    line: Any, error: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    status, answers = asked([line, {"pose": POSE}], capsys, monkeypatch)
    assert status == 1
    assert error in answers[0]["error"]
    assert len(answers[1]["solutions"]) == 1


def test_a_line_without_solution_has_the_reason_and_exit_status_1(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    far = [1, 0, 0, 9, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    status, (answer,) = asked([{"pose": far}], capsys, monkeypatch)
    assert status == 1
    assert answer["solutions"] == []
    assert answer["reason"].startswith("out of reach: ")
    assert answer["residual_m"] > 8


@needs_eaik
def test_arguments_and_printed_solutions_are_in_degrees_and_millimetres(
    capsys: pytest.CaptureFixture[str],
) -> None:
    # Chen et al. 2001, section 4: the sample frame's tool.
    assert run(["ik", "--robot", "pt600", "-28.1", "159.4", "852.8"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("1 solution found by search, the tool within 0.0000 mm")
    assert run(["ik", "--robot", "puma560", "--all", "300", "100", "200", "180", "0", "30"]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "2 solutions in closed form, the tool within 0.0000 mm and 0.0000°"
    assert printed[1].split() == list(build_model(load("puma560")).joints.names)
    assert printed[2].split()[0] == "-5.66°"
    assert run(["ik", "--robot", "pt600", "300", "0", "400", "90", "0", "0"]) == 1
    assert capsys.readouterr().out.startswith("no solution: not this orientation: ")


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["1", "2"], "2 numbers; must be 3 or 6: X Y Z in mm"),
        (["1", "2", "up"], "'up' is no number"),
        (["1", "2", "inf"], "'inf' is not a finite number"),
        (["1", "2", "3", "--task", "4d"], "task '4d': must be one of 6d, 5d, 3d"),
        (["1", "2", "3", "--task", "6d"], "--task 6d takes six numbers"),
        (["1", "2", "3", "--robot", "pt60"], "did you mean 'pt600'"),
    ],
)
def test_invalid_arguments_end_with_2(
    words: list[str], error: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["ik", *words]) == 2
    assert error in capsys.readouterr().err


@needs_eaik
def test_a_request_on_the_mesh_gets_solutions_or_the_reason() -> None:
    solver = build_solver(load("pt600"))
    request = schema.InverseRequest(pose=TOOL.ravel(), task=SIX_D, near=POSITIONS, all_solutions=True)
    answer = inverse_answer(solver, request)
    assert answer.analytic
    assert len(answer.solutions) >= 2
    np.testing.assert_allclose(answer.solutions[0].joint_positions, POSITIONS, atol=1e-9)
    request.pose[3] = 5.0
    answer = inverse_answer(solver, request)
    assert not answer.solutions
    assert answer.reason.startswith("out of reach")
    assert answer.residual_m > 3


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        (schema.InverseRequest(pose=TOOL.ravel()), codes.INVERSE_TASK),
        (schema.InverseRequest(task=SIX_D), codes.POSE_SIZE),
        (schema.InverseRequest(pose=-TOOL.ravel(), task=SIX_D), codes.POSE_LAST_ROW),
        (schema.InverseRequest(pose=TOOL.ravel(), task=SIX_D, near=[1.0]), codes.JOINT_SHAPE),
    ],
)
def test_an_invalid_request_on_the_mesh_is_refused(request_: schema.InverseRequest, code: Code) -> None:
    with refused(code):
        inverse_answer(build_solver(load("pt600")), request_)
