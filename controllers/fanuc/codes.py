"""Reasons that only this kind has: code, sentence, advice, and both in Chinese for the page."""

from protocol_gateway.driver_parts import motion_codes as shared
from robomesh.reasons import Code

_of_kind = shared.of_kind("fanuc")

NOT_CONNECTED = Code(
    "fanuc.not_connected",
    "RMI is not connected",
    "wait for it, or see why in the event link.channel_lost",
    chinese="RMI 未连接：请等待连接，或在事件 link.channel_lost 中查看原因",
)
MOVES = _of_kind(shared.MOVES)
STATE_OLD = _of_kind(shared.STATE_OLD)
OTHER_PROGRAM = Code(
    "fanuc.other_program",
    "another program runs on the controller",
    "end it at the controller",
    chinese="控制器上正在运行其他程序：请在控制器上结束它",
)
EXTRA_AXES = Code(
    "fanuc.extra_axes",
    "axis {axes} belongs to no joint of the model and is not at 0, so a motion would move it",
    "declare it, or move it to 0",
    chinese="轴 {axes} 不属于模型的任何关节且不在 0 位，运动会带动它：请声明该轴，或将其移到 0 位",
)
ARM_STOPPED = Code(
    "fanuc.arm_stopped",
    "the controller does not let the arm move ({activity})",
    chinese="控制器不允许机械臂运动（{activity}）",
)
WENT_LOCAL = Code(
    "fanuc.went_local", "the controller is not in remote control any more", chinese="控制器已不再处于远程控制"
)
TOOL_CHANGED = _of_kind(shared.TOOL_CHANGED)
LOST_PROGRAM = Code(
    "fanuc.lost_program",
    "the gateway's program has ended on the controller",
    chinese="网关的程序已在控制器上结束",
)
NO_ANSWER = Code("fanuc.no_answer", "the controller has not answered {name}", chinese="控制器未应答 {name}")
REFUSED = Code(
    "fanuc.refused", "the controller refuses {name}: {problem}", chinese="控制器拒绝 {name}：{problem}"
)
SYSTEM_FAULT = Code(
    "fanuc.system_fault", "the controller reports a fault during a motion", chinese="控制器在运动期间报告故障"
)
CONNECTION_LOST = Code(
    "fanuc.connection_lost", "RMI was disconnected during a motion", chinese="运动期间 RMI 连接断开"
)
MOVED_BEFORE = Code(
    "fanuc.moved_before", "the arm has moved before its motion was sent", chinese="机械臂在运动发出之前已移动"
)
AXES_UNDECLARED = Code(
    "joints.axes_undeclared",
    "its joints are not shown, because the site file does not say how axis 3 is measured, or how "
    "positions may be assigned",
    "declare j23 and assignments in [robot.fanuc] of the site file",
    chinese=(
        "站点文件没有说明第 3 轴如何计量，或允许怎样分配位置数据，因此不显示关节：请在站点文件的 "
        "[robot.fanuc] 中声明 j23 和 assignments"
    ),
)
