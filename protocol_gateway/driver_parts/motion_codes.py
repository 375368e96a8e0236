"""Reasons that several kinds of controllers give, each with a prefix of its own."""

from collections.abc import Callable
from dataclasses import replace

from robomesh.reasons import Code

MOVES = Code(
    "moves",
    "a motion still runs",
    "wait for its end, or stop the robot",
    chinese="上一个运动仍在进行：请等待其结束，或停止机器人",
)
STATE_OLD = Code(
    "state_old", "the newest state of the controller is too old", chinese="控制器的最新状态已过时"
)
CHANNEL_LOST = Code(
    "channel_lost", "the connection {name} was lost during a motion", chinese="运动期间连接 {name} 断开"
)
CHANNEL_MISSING = Code(
    "channel_missing",
    "the connection {name} to the controller is missing",
    "the event link.channel_lost says why",
    chinese="与控制器的连接 {name} 断开：原因见事件 link.channel_lost",
)
WENT_LOCAL = Code(
    "went_local", "the controller was switched to local control", chinese="控制器已切换到本地控制"
)
TOOL_CHANGED = Code("tool_changed", "the tool was changed during a motion", chinese="运动期间工具被更改")


def of_kind(prefix: str) -> Callable[[Code], Code]:
    """Return a function that gives a code of this table a kind's prefix: "moves" becomes "fast.moves"."""
    return lambda code: replace(code, name=f"{prefix}.{code.name}")
