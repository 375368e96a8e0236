"""Scripts on the simulated controller of Universal Robots' kind: language, limits, programs, dashboard."""

import math
import os
import re
import time
from operator import eq, ge, gt, le, lt
from pathlib import Path

import numpy as np
import pytest

from controllers.simulated.demo import demo_tour
from controllers.universal_robots.interfaces.modes import RuntimeState
from controllers.universal_robots.interfaces.primary import KeyMessage, Popup, PrimaryText, RuntimeFault
from controllers.universal_robots.interfaces.rtde_messages import ControllerVersion
from controllers.universal_robots.simulated import dashboard
from controllers.universal_robots.simulated.controller import UrController
from controllers.universal_robots.simulated.script.code import LONGEST_SOURCE, compile_script
from controllers.universal_robots.simulated.script.errors import ScriptError
from controllers.universal_robots.simulated.script.machine import Machine, Wait, text_of
from robots.descriptions.description import load
from robots.kinematics.joints import violations

PUMA = load("puma560")
VERSION = ControllerVersion(5, 21, 0, 0)


def execute(source, ticks=50, **functions):
    """Execute a program; return what it writes with textmsg."""
    said = []
    built_in = {
        "textmsg": lambda machine, thread, *given: said.append("".join(map(text_of, given))),
        "sync": lambda machine, thread: Wait(lambda now_s: (None,)),
        **functions,
    }
    machine = Machine(compile_script(source), built_in)
    for number in range(ticks):
        machine.tick(number * 0.01)
        if machine.ended:
            break
    return said


def program(*lines):
    return "\n".join(["def test():", *(f"  {line}" for line in lines), "end"])


class Simulated:
    """A simulated controller with a clock of its own."""

    def __init__(self, *, tour=None):
        self.now_s = 100.0
        self.messages = []
        self.controller = UrController(
            PUMA, tour=tour, powered=True, now_s=self.now_s, announce=self.messages.append
        )
        self.registers = self.controller.registers

    def run(self, seconds, each=lambda: None):
        for _ in range(round(seconds / 0.01)):
            self.now_s += 0.01
            self.controller.tick(self.now_s)
            each()

    def send(self, *lines):
        self.controller.take_script(program(*lines), self.now_s)

    def ask(self, command, *, remote=True, version=VERSION):
        return dashboard.answer(command, self.controller, version, remote=remote, now_s=self.now_s)

    def values(self, name):
        return self.controller.values((name,), self.now_s)[name]

    def placed(self):
        """Return the tool's pose."""
        return np.array(self.values("actual_TCP_pose"))

    def goal(self, *way):
        """Return the tool's pose after a way [m]."""
        return (self.placed() + np.array([*way, 0, 0, 0])).tolist()

    @property
    def positions(self):
        return self.controller.programs.arm(self.now_s).positions

    @property
    def state(self):
        return self.controller.programs.state

    def of(self, kind):
        return [each for each in self.messages if isinstance(each, kind)]


# ---------------------------------------------------------------------- language


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1 + 2 * 3", "7"),
        ("-2 * (3 - 5)", "4"),
        ("7 % 4 - 1 / 2", "2.5"),
        ("[1, 2, 3] * 2 - [1, 1, 1]", "[1, 3, 5]"),
        ("p[1, 2, 3, 0, 0, 0.5][5]", "0.5"),
        ("[[1, 2], [3, 4]][1][0]", "3"),
        ("not True or 1 < 2 and 2 >= 2", "True"),
        ("True xor True", "False"),
        ("False and missing", "False"),
        ('"a" == "a"', "True"),
        ("1e-3 != .001", "False"),
        ("f(b = 4, a = 1)", "14"),
        ("f(2)", "22"),
    ],
)
def test_expression(expression, value):
    assert execute(program("def f(a, b=2):", "return b + a * 10", "end", f"textmsg({expression})")) == [value]


def test_statements_and_scopes():
    lines = (
        "count = 0",
        "local row = [1, 2, 3]",
        "row[1] = 5.5",
        "def add(n):",
        "  local other = n",
        "  count = count + other",
        "end",
        "while True:",
        "  add(2)",
        "  if count == 4:",
        "    continue",
        "  elif count > 7 and",
        "    count < 100:",
        "    break",
        "  else:",
        "    pass",
        "  end",
        "end",
        "textmsg(count, row)",
    )
    assert execute(program(*lines)) == ["8[1, 5.5, 3]"]


def test_threads_run_beside_the_program_and_end_with_it():
    lines = (
        "global n = 0",
        "thread count(to):",
        "  while n < to:",
        "    n = n + 1",
        "    sync()",
        "  end",
        "end",
        "h = run count(3)",
        "join h",
        "textmsg(n)",
        "h = run count(1000)",
        "sync()",
        "kill h",
        "m = n",
        "sync()",
        "textmsg(m == n)",
        "run count(1000)",
    )
    assert execute(program(*lines)) == ["3", "True"]


@pytest.mark.parametrize(
    ("lines", "text"),
    [
        (("x = ",), "expected a value"),
        (("if 1 < 2", "end"), "expected ':'"),
        (("break",), "belongs in a loop"),
        (("x = $",), "unexpected character"),
        (("(" * 60 + "1" + ")" * 60,), "more than 40 levels"),
        (("x = 1 )",), "the end of the line"),
    ],
)
def test_invalid_program_is_refused_with_its_line(lines, text):
    with pytest.raises(ScriptError, match=re.escape(text)) as error:
        compile_script(program(*lines))
    assert error.value.line in (2, 3)


@pytest.mark.parametrize(
    ("lines", "text"),
    [
        (("while True:", "end"), "it does not wait"),
        (("def f(x):", "return f(x + 1)", "end", "f(1)"), "calls in each other"),
        (("thread t():", "while True:", "sync()", "end", "end", "while True:", "run t()", "end"), "threads"),
        (("x = [1]", "while True:", "x = [x, x]", "end"), "at most 100 items"),
        (('x = "ab"', "while True:", "x = str_cat(x, x)", "end"), "at most 2000 characters"),
        (("textmsg(y)",), "y has no value"),
        (("x = 1 / 0",), "zero"),
        (("x = [1, 2][2]",), "index 2 of a list with 2 items"),
        (("nothing_like_this(1)",), "nothing_like_this is unknown"),
        (("sync(1, 2, 3)",), "the arguments of sync do not fit"),
        (("x = True + 1",), "expected a number"),
        (("if [1]:", "end"), "a condition"),
    ],
)
def test_program_that_goes_too_far_ends_with_an_error(lines, text):
    def cat(machine, thread, one, other):
        return one + other

    began_s = time.perf_counter()
    with pytest.raises(ScriptError, match=text):
        execute(program(*lines), ticks=200, str_cat=cat)
    assert time.perf_counter() - began_s < 20.0


def test_numbers_stay_small_and_a_long_source_is_refused():
    lines = ("x = 3", "i = 0", "while i < 60:", "x = x * x", "i = i + 1", "end", "textmsg(x)")
    assert execute(program(*lines)) == ["inf"]
    with pytest.raises(ScriptError, match="characters"):
        compile_script("x" * (LONGEST_SOURCE + 1))


# ------------------------------------------------------------------ the controller


def test_movej_moves_all_joints_in_phase_at_the_speed_of_the_leading_one():
    arm = Simulated()
    start = arm.positions
    target = start + np.array([0.6, 0.3, 0.0, 0.0, -0.2, 0.0])
    arm.send(f"movej({target.tolist()}, a=2.0, v=0.5, t=0, r=0)")
    fastest, off = [], []

    def look():
        state = arm.controller.programs.arm(arm.now_s)
        fastest.append(abs(state.velocities).max())
        way = (state.positions - start) @ (target - start) / ((target - start) @ (target - start))
        off.append(abs(state.positions - start - way * (target - start)).max())

    arm.run(3.0, look)
    assert arm.positions == pytest.approx(target, abs=1e-12)
    assert max(fastest) == pytest.approx(0.5, abs=1e-9)
    assert max(off) < 1e-12
    assert [each.title for each in arm.of(KeyMessage)] == ["PROGRAM_XXX_STARTED", "PROGRAM_XXX_STOPPED"]
    assert arm.state is RuntimeState.STOPPED


@pytest.mark.parametrize("acceleration", [5.0, 0.1])  # the second alone would take 4 s
def test_a_motion_with_a_time_takes_it(acceleration):
    arm = Simulated()
    target = arm.positions + np.array([0.4, 0, 0, 0, 0, 0])
    arm.send(f"movej({target.tolist()}, a={acceleration}, v=0.1, t=2)")
    arm.run(1.95)
    assert 0.0 < target[0] - arm.positions[0] < 0.02
    arm.run(0.1)
    assert arm.positions == pytest.approx(target, abs=1e-12)


def test_a_thread_that_is_killed_gives_the_arm_to_stopj():
    arm = Simulated()
    start = arm.positions
    target = start + np.array([1.0, 0, 0, 0, 0, 0])
    arm.send(
        "thread move():",
        f"movej({target.tolist()}, a=5, v=1)",
        "end",
        "h = run move()",
        "sleep(0.5)",
        "kill h",
        "stopj(10)",
        "textmsg(is_steady())",
        "sleep(0.6)",
        "textmsg(is_steady())",
    )
    arm.run(2.0)
    assert [each.text for each in arm.of(PrimaryText)] == ["False", "True"]
    assert 0.2 < arm.positions[0] - start[0] < 0.6


def test_two_threads_cannot_move_the_arm():
    arm = Simulated()
    target = (arm.positions + np.array([1.0, 0, 0, 0, 0, 0])).tolist()
    arm.send("thread move():", f"movej({target})", "end", "run move()", "sync()", f"movej({target})")
    arm.run(0.5)
    (fault,) = arm.of(RuntimeFault)
    assert "another thread" in fault.text
    assert fault.line == 3


@pytest.mark.parametrize("kind", ["pose", "joints"])
def test_movel_moves_the_tool_on_a_straight_line_at_its_speed(kind):
    arm = Simulated()
    begin = arm.placed()
    goal = arm.goal(-0.1, 0.15, -0.1)
    way = np.array(goal[:3]) - begin[:3]
    direction = way / np.linalg.norm(way)
    target = f"p{goal}" if kind == "pose" else f"get_inverse_kin(p{goal})"
    arm.send(f"movel({target}, a=1.0, v=0.2)")
    speeds, off, turned = [], [], []

    def look():
        pose, speed = (arm.values(f"actual_TCP_{name}") for name in ("pose", "speed"))
        away = np.array(pose[:3]) - begin[:3]
        speeds.append(np.linalg.norm(speed[:3]))
        off.append(np.linalg.norm(away - away @ direction * direction))
        turned.append(np.abs(np.subtract(pose[3:], begin[3:])).max())

    arm.run(2.0, look)
    assert arm.placed() == pytest.approx(goal, abs=1e-9)
    assert max(speeds) == pytest.approx(0.2, rel=1e-3)
    assert (max(off), max(turned)) < (2e-6, 2e-5)
    assert arm.state is RuntimeState.STOPPED
    assert not arm.of(RuntimeFault)


def test_movel_stays_on_its_line_when_it_is_paused_and_stopped():
    arm = Simulated()
    begin, goal = arm.placed(), arm.goal(0.0, 0.2, 0.0)
    arm.send("thread move():", f"movel(p{goal}, a=1, v=0.2)", "end", "h = run move()", "sleep(1.8)")
    arm.run(0.4)
    arm.ask("pause")
    arm.run(0.5)
    paused = arm.placed()
    assert 0.03 < paused[1] - begin[1] < 0.1
    arm.run(0.3)
    assert arm.placed() == pytest.approx(paused)
    arm.ask("play")
    arm.run(0.4)
    assert arm.placed()[1] > paused[1] + 0.03
    arm.run(3.0)
    assert [*arm.placed()[[0, 2]]] == pytest.approx([*begin[[0, 2]]], abs=1e-6)
    assert arm.placed()[1] < goal[1]
    arm.send(f"movel(p{begin.tolist()}, a=5, v=0.2)")
    arm.run(0.2)
    arm.controller.programs.brake(0.5, arm.now_s, of_joints=False)  # 0.04 m from 0.2 m/s
    stopped = arm.placed()
    arm.run(0.39)
    assert arm.controller.programs.moving(arm.now_s)
    arm.run(0.02)
    assert stopped[1] - arm.placed()[1] == pytest.approx(0.04, rel=0.01)


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("movel(p[3, 0, 0, 0, 0, 0])", "cannot follow the line: its end cannot be reached: out of reach"),
        ("movej(p[3, 0, 0, 0, 0, 0])", "the pose cannot be reached: out of reach"),
        ("movel(p[1e300, 0, 0, 0, 0, 0])", "it must be less than 1e+06 m"),
        ("movej(p[1e300, 0, 0, 0, 0, 0])", "it must be less than 1e+06 m"),
        ("movel([0, 0, 0, 0, 0])", "a list of six numbers"),
        ("movel(get_actual_tcp_pose(), r=0.1)", "a blend radius is not simulated"),
        ("servoj([9, 0, 0, 0, 0, 0])", "outside the joint limits"),
        ("speedj([1, 0, 0, 0, 0, 0], t=9)", "outside the joint limits"),
        ("speedl([0.5, 0, 0, 0, 0, 0], t=9)", "too near a singular position"),
        ("servoc(get_actual_tcp_pose())", "servoc is unknown"),
    ],
)
def test_motion_that_cannot_be_ends_the_program_with_an_error(line, text):
    arm = Simulated()
    arm.send("sync()", line)
    arm.run(9.0)
    (fault,) = arm.of(RuntimeFault)
    assert text in fault.text
    assert fault.line == 3
    assert arm.state is RuntimeState.STOPPED
    assert not violations(arm.controller.joints, arm.positions)


def test_servoj_follows_targets_late_by_its_lookahead_time():
    arm = Simulated()
    start = arm.positions
    arm.send(
        "q = get_actual_joint_positions()",
        "i = 0",
        "while i < 100:",
        "  i = i + 1",
        "  q[0] = q[0] + 0.005",
        "  servoj(q, t=0.01, lookahead_time=0.1, gain=300)",
        "end",
        "stopj(2)",
    )
    late = []
    arm.run(1.0, lambda: late.append(0.5 * (arm.now_s - 100.0) - (arm.positions - start)[0]))
    assert late[-1] == pytest.approx(0.05, abs=0.01)
    arm.run(1.0)
    assert (arm.positions - start)[1:] == pytest.approx([0] * 5, abs=1e-9)
    assert arm.state is RuntimeState.STOPPED


def test_speeds_of_joints_and_tool_are_reached_and_end_with_a_stop():
    arm = Simulated()
    begin = arm.placed()
    arm.send("speedl([0, 0.1, 0, 0, 0, 0], a=0.5, t=1.0)", "stopl(1)", "speedj([0.2, 0, 0, 0, 0, 0], a=1)")
    arm.run(0.9)
    assert arm.values("actual_TCP_speed") == pytest.approx((0, 0.1, 0, 0, 0, 0), abs=1e-6)
    assert arm.placed() - begin == pytest.approx([0, 0.08, 0, 0, 0, 0], abs=2e-3)
    arm.run(0.4)
    fastest = []
    arm.run(0.6, lambda: fastest.append(arm.values("actual_qd")[0]))
    assert max(fastest) == pytest.approx(0.2, abs=1e-6)
    assert arm.state is RuntimeState.STOPPED


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("get_inverse_kin(get_forward_kin([0.3, -0.6, 0.8, 0.3, 0.7, 0.2]))[1] < 9", "True"),
        ("norm(get_inverse_kin(get_forward_kin()) - get_actual_joint_positions()) < 0.000001", "True"),
        (
            "norm(get_forward_kin([0,0,0,0,0,0], get_tcp_offset()) - get_forward_kin([0,0,0,0,0,0])) < 1e-9",
            "True",
        ),
        ("get_inverse_kin_has_solution(p[3, 0, 0, 0, 0, 0])", "False"),
        ("is_within_safety_limits(get_actual_tcp_pose())", "True"),
        ("is_within_safety_limits([9, 0, 0, 0, 0, 0])", "False"),
        ("pose_trans(p[1, 0, 0, 0, 0, 0], p[0, 2, 0, 0, 0, 0.5])", "p[1, 2, 0, 0, 0, 0.5]"),
        ("pose_trans(pose_inv(p[1, 2, 0, 0, 0, 0.5]), p[1, 2, 0, 0, 0, 1])", "p[0, 0, 0, 0, 0, 0.5]"),
        ("pose_sub(p[1, 2, 0, 0, 0, 0.5], p[0, 1, 0, 0, 0, 0.25])", "p[1, 1, 0, 0, 0, 0.25]"),
    ],
)
def test_functions_of_poses(expression, value):
    arm = Simulated()
    arm.send(f"textmsg({expression})")
    arm.run(0.05)
    assert not arm.of(RuntimeFault)
    assert [each.text for each in arm.of(PrimaryText)] == [value]


@pytest.mark.parametrize("action", ["stop", "pause"])
def test_watchdog_ends_a_motion_that_is_not_fed(action):
    arm = Simulated()
    start = arm.positions
    target = start + np.array([1.5, 0, 0, 0, 0, 0])
    arm.send(f'rtde_set_watchdog("input_int_register_24", 10, "{action}")', f"movej({target.tolist()}, v=1)")
    arm.run(0.5, lambda: arm.registers.write_inputs({"input_int_register_24": 1}, arm.now_s))
    assert arm.state is RuntimeState.PLAYING
    arm.run(0.08)
    assert arm.state is RuntimeState.PLAYING
    arm.run(0.12)
    rest = arm.positions
    assert not arm.controller.programs.moving(arm.now_s)
    arm.run(0.5)
    assert arm.positions == pytest.approx(rest)
    if action == "stop":
        assert arm.state is RuntimeState.STOPPED
        assert arm.ask("play") == "Failed to execute: play"
    else:
        assert arm.state is RuntimeState.PAUSED
        assert arm.ask("play") == "Starting program"
        arm.run(3.0)
        assert arm.positions == pytest.approx(target)


def test_registers_keep_their_values_and_have_their_types():
    arm = Simulated()
    arm.registers.write_inputs({"input_int_register_30": 7, "input_double_register_24": 0.5}, arm.now_s)
    arm.send(
        "write_output_integer_register(24, read_input_integer_register(30) + 1)",
        "write_output_float_register(25, read_input_float_register(24) * 4)",
        "write_output_boolean_register(40, True)",
        "write_output_integer_register(99, 1)",
    )
    arm.run(0.1)
    names = ("output_int_register_24", "output_double_register_25", "output_bit_registers32_to_63")
    assert [*arm.controller.values(names, arm.now_s).values()] == [8, 2.0, 1 << 8]
    assert "register 99 is unknown" in arm.of(RuntimeFault)[0].text


def test_dashboard_stops_and_plays_the_loaded_program():
    arm = Simulated(tour=demo_tour(PUMA))
    arm.run(0.5)
    assert arm.ask("running") == "Program running: true"
    assert arm.ask("stop") == "Stopped"
    assert arm.state is RuntimeState.STOPPING
    arm.run(0.5)
    assert arm.state is RuntimeState.STOPPED
    assert arm.ask("stop") == "Failed to execute: stop"
    assert arm.ask("programState") == "STOPPED demo"
    assert arm.ask("load other.urp") == "File not found: /programs/other.urp"
    rest = arm.positions
    assert arm.ask("play") == "Starting program"
    assert arm.positions == pytest.approx(rest)
    arm.run(1.0)
    assert math.dist(arm.positions, rest) > 0.01
    assert arm.ask("play") == "Failed to execute: play"
    assert arm.ask("pause") == "Pausing program"
    assert "could not understand" in arm.ask("dance")


def test_dashboard_ends_a_protective_stop_and_leaves_the_program_paused():
    arm = Simulated(tour=demo_tour(PUMA))
    arm.run(0.5)
    arm.controller.protective_stop(arm.now_s)
    arm.run(4.9)
    assert arm.ask("unlock protective stop") == dashboard.STOP_TOO_YOUNG
    assert arm.ask("safetystatus") == "Safetystatus: PROTECTIVE_STOP"
    assert arm.ask("play") == "Failed to execute: play"
    arm.run(0.2)
    rest = arm.positions
    assert arm.ask("unlock protective stop") == "Protective stop releasing"
    arm.run(0.5)
    assert arm.ask("safetystatus") == "Safetystatus: NORMAL"
    assert arm.ask("programState") == "PAUSED demo"
    assert arm.positions == pytest.approx(rest)
    assert arm.ask("close safety popup") == "closing safety popup"
    assert arm.ask("play") == "Starting program"


def test_dashboard_restarts_safety_and_powers_the_arm_on_brake_by_brake():
    arm = Simulated(tour=demo_tour(PUMA))
    arm.run(0.5)
    arm.controller.violate(arm.now_s)
    arm.run(0.5)
    modes = ("robot_mode", "safety_mode", "safety_status_bits", "runtime_state")
    assert [*arm.controller.values(modes, arm.now_s).values()] == [3, 8, 1 << 8 | 1 << 10, 1]
    # Answered alike, without an effect.
    assert arm.ask("power on") == "Powering on"
    arm.run(2.0)
    assert arm.ask("robotmode") == "Robotmode: POWER_OFF"
    assert arm.ask("restart safety") == "Restarting safety"
    assert (arm.ask("safetystatus"), arm.ask("robotmode")) == (
        "Safetystatus: NORMAL",
        "Robotmode: POWER_OFF",
    )
    assert arm.ask("power on") == "Powering on"
    assert arm.ask("robotmode") == "Robotmode: POWER_ON"
    arm.run(1.0)
    assert arm.ask("robotmode") == "Robotmode: IDLE"
    assert arm.ask("play") == "Failed to execute: play"
    assert arm.ask("brake release") == "Brake releasing"
    arm.run(1.0)
    assert arm.ask("robotmode") == "Robotmode: RUNNING"
    assert arm.state is RuntimeState.STOPPED
    assert arm.ask("power off") == "Powering off"
    # It gets its power on the way.
    assert arm.ask("brake release") == "Brake releasing"
    arm.run(2.0)
    assert arm.ask("robotmode") == "Robotmode: RUNNING"


def test_dashboard_executes_nothing_in_local_control():
    arm = Simulated(tour=demo_tour(PUMA))
    arm.run(0.1)
    arm.controller.remote = False
    assert arm.ask("is in remote control") == "false"
    assert arm.ask("stop") == dashboard.REMOTE_ONLY
    arm.controller.remote = True
    # A connection from the time of local control stays restricted.
    assert arm.ask("stop", remote=False) == dashboard.REMOTE_ONLY
    assert "could not understand" in arm.ask("is in remote control", version=ControllerVersion(3, 15, 0, 0))
    assert arm.state is RuntimeState.PLAYING


def test_a_secondary_program_cannot_move_the_arm_but_change_the_tool():
    arm = Simulated(tour=demo_tour(PUMA))
    arm.run(0.1)
    arm.controller.take_script(
        "sec tool():\n set_tcp(p[0,0,0.2,0,0,0])\n movej([0,0,0,0,0,0])\nend", arm.now_s
    )
    arm.run(0.1)
    assert arm.controller.values(("tcp_offset",), arm.now_s)["tcp_offset"] == (0, 0, 0.2, 0, 0, 0)
    assert "secondary" in arm.of(RuntimeFault)[0].text
    assert arm.state is RuntimeState.PLAYING


# --------------------------------------------------------- a program of UR's own

SOURCES = os.environ.get("UR_CLIENT_LIBRARY", "")
_OPERATORS = {"<": lt, "<=": le, ">": gt, ">=": ge, "==": eq}
_REPLACED = {
    "BEGIN_REPLACE": "",
    "JOINT_STATE_REPLACE": "1000000",
    "TIME_REPLACE": "1000",
    "SERVER_IP_REPLACE": "127.0.0.1",
    "SERVER_PORT_REPLACE": "50001",
    "SCRIPT_COMMAND_SERVER_PORT_REPLACE": "50004",
    "TRAJECTORY_SERVER_PORT_REPLACE": "50003",
    "SERVO_J_REPLACE": "lookahead_time=0.03, gain=2000",
}


def rendered(template, version):
    """Return a script's text for a version, as UR's client library prepares it."""

    def true(condition):
        _, sign, *numbers = re.split(r"\s+v?|\.", condition)
        return _OPERATORS[sign](version, tuple(map(int, numbers)))

    lines, branches = [], []
    for line in template.splitlines():
        if (tag := re.fullmatch(r"\s*{%\s*(\w+)\s*(.*?)\s*%}\s*", line)) is None:
            if all(shown for shown, _ in branches):
                lines.append(line)
        elif tag[1] == "if":
            branches.append((shown := true(tag[2]), shown))
        elif tag[1] == "endif":
            branches.pop()
        else:
            done = branches[-1][1]
            shown = not done and (tag[1] == "else" or true(tag[2]))
            branches[-1] = shown, done or shown
    text = "\n".join(lines)
    for name, value in _REPLACED.items():
        text = text.replace(f"{{{{{name}}}}}", value)
    return text


@pytest.mark.skipif(not SOURCES, reason="UR_CLIENT_LIBRARY does not name UR's client library")
@pytest.mark.parametrize("version", [(5, 9, 0), (5, 25, 1), (3, 15, 0)])
def test_program_of_the_client_library_runs_until_it_misses_its_socket(version):
    template = Path(SOURCES, "resources/external_control.urscript").read_text(encoding="utf-8")
    arm = Simulated()
    arm.send(*rendered(template, version).splitlines())
    arm.run(2.0)
    assert not arm.of(RuntimeFault)
    assert any("steptime" in each.text for each in arm.of(PrimaryText))
    # It asks the operator for the program at the other end, and waits.
    assert arm.of(Popup)
    assert arm.state is RuntimeState.PAUSED
