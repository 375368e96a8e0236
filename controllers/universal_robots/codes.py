"""Reasons that only this kind has: code, sentence, advice, and both in Chinese for the page."""

from protocol_gateway.driver_parts import motion_codes as shared
from robomesh.reasons import Code

_of_kind = shared.of_kind("universal_robots")

NOT_STARTED = Code(
    "universal_robots.not_started",
    "the controller has not started its program within {seconds:g} s",
    chinese="控制器未在 {seconds} 秒内启动运动程序",
)
OTHER_PROGRAM = Code(
    "universal_robots.other_program",
    "another program runs or waits on the controller",
    "end it at the controller",
    chinese="控制器上有其他程序正在运行或暂停：请在控制器上结束该程序",
)
LOST_PROGRAM = Code(
    "universal_robots.lost_program",
    "the program that runs on the controller is not the gateway's",
    chinese="控制器上运行的不是网关的程序",
)
PAUSED = Code("universal_robots.paused", "its program was paused", chinese="运动程序被暂停")
ARM_STOPPED = Code(
    "universal_robots.arm_stopped",
    "the controller has stopped the arm ({mode})",
    chinese="控制器已停止机械臂（{mode}）",
)
TOOL_CHANGED = Code(
    "universal_robots.tool_changed",
    "tool or payload were changed during a motion",
    chinese="运动期间工具或负载被更改",
)
WENT_LOCAL = _of_kind(shared.WENT_LOCAL)
CHANNEL_LOST = _of_kind(shared.CHANNEL_LOST)
STATE_OLD = _of_kind(shared.STATE_OLD)
MOVES = _of_kind(shared.MOVES)
CHANNEL_MISSING = _of_kind(shared.CHANNEL_MISSING)
SOFTWARE = Code(
    "universal_robots.software",
    "motion needs PolyScope 5.6 or a later version 5, this is {version}",
    "move the robot from its own panel",
    chinese="运动需要 PolyScope 5.6 或更高的 5.x 版本，当前为 {version}：请用示教器移动机器人",
)
STOP_YOUNG = Code(
    "universal_robots.stop_young",
    "the protective stop is seen for {seen:.1f} s only; it can be unlocked after {seconds:g} s",
    "find its cause first",
    chinese="保护性停止仅出现 {seen} 秒；{seconds} 秒后才能解锁：请先查明原因",
)
NOT_NOW = Code(
    "universal_robots.recovery_not_now",
    "{recovery} does not fit the controller's state (safety mode {safety}, robot mode {robot})",
    chinese="{recovery} 与控制器状态不符（安全模式 {safety}，机器人模式 {robot}）",
)
RECOVERS = Code(
    "universal_robots.recovers",
    "the controller has not answered {recovery} yet",
    "wait for its answer",
    chinese="控制器尚未回答 {recovery}：请等待其回答",
)
REGISTER = Code(
    "universal_robots.register",
    "{name} cannot be used: {problem}",
    "choose other registers in the site file (universal_robots)",
    chinese="{name} 无法使用：{problem}：请在站点文件（universal_robots）中选择其他寄存器",
)
