"""Reasons that only this kind has: code, sentence, advice, and both in Chinese for the page."""

from protocol_gateway.driver_parts import motion_codes as shared
from robomesh.reasons import Code

_of_kind = shared.of_kind("hses")

NOT_STARTED = Code(
    "hses.not_started",
    "the controller has not started it within {seconds:g} s",
    chinese="控制器未在 {seconds} 秒内开始运动",
)
OTHER_JOB = Code(
    "hses.other_job",
    "a job runs on the controller",
    "end it at the controller",
    chinese="控制器上有作业正在运行：请在控制器上结束该作业",
)
ENDED_ELSEWHERE = Code(
    "hses.ended_elsewhere", "it has ended before its target", chinese="运动在到达目标前结束"
)
HELD = Code("hses.held", "it was held", chinese="运动被暂停")
ARM_STOPPED = Code(
    "hses.arm_stopped", "the controller lets no arm move: {state}", chinese="控制器不允许机械臂运动：{state}"
)
TOOL_CHANGED = _of_kind(shared.TOOL_CHANGED)
WENT_LOCAL = _of_kind(shared.WENT_LOCAL)
CHANNEL_LOST = _of_kind(shared.CHANNEL_LOST)
CHANNEL_MISSING = _of_kind(shared.CHANNEL_MISSING)
STATE_OLD = _of_kind(shared.STATE_OLD)
MOVES = _of_kind(shared.MOVES)
AXES = Code(
    "hses.axes", "{detail}", "move the robot from its own panel", chinese="{detail}：请用示教器移动机器人"
)
HELD_MOTION = Code(
    "hses.held_motion",
    "a held motion may go on when HOLD ends",
    "switch the servos off at the robot, as its emergency stop does, then reset the stop",
    chinese="HOLD 结束后，被暂停的运动可能继续：请在机器人处关闭伺服（例如按下急停），然后复位停止",
)
JOINTS_UNDECLARED = Code(
    "joints.undeclared",
    "its joints are not shown, because the controller sends pulses",
    "declare pulses_per_degree of each joint in [robot.yaskawa] of the site file",
    chinese=(
        "控制器发送的是脉冲，因此不显示关节：请在站点文件的 [robot.yaskawa] 中声明每个关节的 "
        "pulses_per_degree"
    ),
)
BASE_UNDECLARED = Code(
    "joints.base_undeclared",
    "its controller moves it on a base ({axes}), which the model does not have: where the arm "
    "stands is not known",
    chinese="控制器用基座轴（{axes}）移动该机械臂，而模型中没有该基座：机械臂所在位置未知",
)
