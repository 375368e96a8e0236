"""Inverse kinematics: joint positions for a tool pose, each verified by forward kinematics.

No limits of speed and no obstacles (`checks`).
"""

from robots.kinematics.inverse.solver import InverseResult, InverseSolver, build_solver, follow, solve
from robots.kinematics.inverse.tasks import Task, natural_task, tool_pose

__all__ = [
    "InverseResult",
    "InverseSolver",
    "Task",
    "build_solver",
    "follow",
    "natural_task",
    "solve",
    "tool_pose",
]
