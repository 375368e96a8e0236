"""Writer of programs and of a plan's steps as program text."""

from collections.abc import Iterator, Sequence
from math import degrees

from robots.kinematics.joints import FloatArray, Joints
from robots.programs.statements import (
    Home,
    JointTarget,
    MoveJoints,
    MoveLine,
    MoveLineBy,
    Program,
    Repeat,
    Speed,
    Statement,
    Target,
    ToolSpeed,
    Trace,
    Wait,
)
from robots.programs.steps import Step, StepKind
from robots.programs.text import joint_scales
from robots.schema.poses import rotation_rpy


def program_text(program: Program, joints: Joints) -> str:
    """Return a program's text, points first, without comments."""
    points = (_definition(target, joints) for target in program.points.values())
    return "".join(f"{line}\n" for line in (*points, *_written(program.statements, joints, "")))


def steps_text(steps: Sequence[Step], joints: Joints) -> str:
    """Return the text of a program with the same steps: joint moves, nothing nested."""
    return "".join(f"{_step_words(step, joints)}\n" for step in steps)


def _step_words(step: Step, joints: Joints) -> str:
    match step:
        case Step(kind=StepKind.MOVE, target=target) if target is not None:
            return f"move_joints {joint_words(target, joints)}"
        case Step(kind=StepKind.SPEED, percent=percent) if percent is not None:
            return f"speed {number(percent)}"
        case Step(kind=StepKind.WAIT, seconds=seconds) if seconds is not None:
            return f"wait {number(seconds)}"
        case Step(kind=StepKind.TRACE, on=on):
            return f"trace {'on' if on else 'off'}"
    return "home"


def _written(statements: Sequence[Statement], joints: Joints, indent: str) -> Iterator[str]:
    for statement in statements:
        match statement:
            case Home():
                yield f"{indent}home"
            case MoveJoints():
                yield f"{indent}move_joints {_target(statement.target, joints)}"
            case MoveLine():
                yield f"{indent}move_line {_target(statement.target, joints)}"
            case MoveLineBy():
                yield f"{indent}move_line_by {statement.frame} {pose_words(statement.offset)}"
            case Speed():
                yield f"{indent}speed {number(statement.percent)}"
            case ToolSpeed():
                yield f"{indent}tool_speed {number(statement.most * 1000)}"
            case Wait():
                yield f"{indent}wait {number(statement.seconds)}"
            case Trace():
                yield f"{indent}trace {'on' if statement.on else 'off'}"
            case Repeat():
                yield f"{indent}repeat {statement.count}"
                yield from _written(statement.body, joints, indent + "  ")
                yield f"{indent}end"


def _target(target: Target, joints: Joints) -> str:
    return target.name or _target_words(target, joints)


def _target_words(target: Target, joints: Joints) -> str:
    if isinstance(target, JointTarget):
        return joint_words(target.positions, joints)
    return pose_words(target.tool_to_base)


def _definition(target: Target, joints: Joints) -> str:
    kind = "joints" if isinstance(target, JointTarget) else "pose"
    return f"point {target.name} = {kind} {_target_words(target, joints)}"


def joint_words(positions: FloatArray, joints: Joints) -> str:
    """Format joint positions [rad] or [m] for a program."""
    return " ".join(number(value) for value in (positions / joint_scales(joints)).tolist())


def pose_words(tool_to_base: FloatArray) -> str:
    """Format a pose (4, 4) [m] for a program."""
    millimetres = (tool_to_base[:3, 3] * 1000).tolist()
    return " ".join(
        number(value) for value in (*millimetres, *map(degrees, rotation_rpy(tool_to_base[:3, :3])))
    )


def number(value: float) -> str:
    """Format a number in as few digits as possible, to 1e-6 degrees or millimetres."""
    return f"{round(value, 6) + 0.0:.6f}".rstrip("0").rstrip(".")
