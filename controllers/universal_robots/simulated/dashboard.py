"""Commands of the dashboard server, and their answers: one line each. No I/O.

The words are those of the controllers, as UR's manual and clients give them. A connection that was opened in
local control stays restricted until it is opened again.
"""

from collections.abc import Callable, Mapping

from controllers.universal_robots.interfaces.modes import RobotMode, RuntimeState, SafetyMode, name_of
from controllers.universal_robots.interfaces.rtde_messages import ControllerVersion
from controllers.universal_robots.simulated.controller import UrController

GREETING = "Connected: Universal Robots Dashboard Server"
REMOTE_ONLY = (
    "Command is not allowed due to safety reasons, please switch robot to Remote Control mode and "
    "reconnect to port 29999"
)
STOP_TOO_YOUNG = (
    "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop before "
    "unlocking"
)
LONGEST_COMMAND = 1000
"""Characters."""

_RUNS = frozenset({RuntimeState.PLAYING, RuntimeState.PAUSED})


def answer(
    command: str, controller: UrController, version: ControllerVersion, *, remote: bool, now_s: float
) -> str:
    """Execute a command; return its answer.

    Args:
        remote: The connection was opened in remote control.
    """
    command = command.strip()
    if version.major < 5 and command == "is in remote control":
        return f"could not understand: '{command}'"
    if (question := _QUESTIONS.get(command)) is not None:
        return question(controller, version)
    if command == "quit":
        return "Disconnected"
    order = _ORDERS.get(command)
    if order is None and not command.startswith("load "):
        return f"could not understand: '{command[:80]}'"
    if version.major >= 5 and not (remote and controller.remote):
        return REMOTE_ONLY
    return _load(command[5:], controller) if order is None else order(controller, now_s)


def _load(name: str, controller: UrController) -> str:
    if name.removesuffix(".urp") == controller.programs.loaded != "":
        return f"Loading program: /programs/{name}"
    return f"File not found: /programs/{name[:80]}"


def _play(controller: UrController, now_s: float) -> str:
    normal = controller.safety_mode is SafetyMode.NORMAL and controller.robot_mode is RobotMode.RUNNING
    if normal and controller.programs.play(now_s):
        return "Starting program"
    return "Failed to execute: play"


def _stop(controller: UrController, now_s: float) -> str:
    if controller.programs.state not in _RUNS:
        return "Failed to execute: stop"
    controller.programs.stop(now_s)
    return "Stopped"


def _pause(controller: UrController, now_s: float) -> str:
    if controller.programs.state is not RuntimeState.PLAYING:
        return "Failed to execute: pause"
    controller.programs.pause(now_s)
    return "Pausing program"


def _unlock(controller: UrController, now_s: float) -> str:
    return "Protective stop releasing" if controller.unlock(now_s) else STOP_TOO_YOUNG


def _done(act: Callable[[UrController, float], None], words: str) -> Callable[[UrController, float], str]:
    """Return an order with a fixed answer, also where it has no effect."""

    def order(controller: UrController, now_s: float) -> str:
        act(controller, now_s)
        return words

    return order


def _program_state(controller: UrController, version: ControllerVersion) -> str:
    state = controller.programs.state
    word = {RuntimeState.PLAYING: "PLAYING", RuntimeState.PAUSED: "PAUSED"}.get(state, "STOPPED")
    return f"{word} {controller.programs.loaded or 'null'}"


_QUESTIONS: Mapping[str, Callable[[UrController, ControllerVersion], str]] = {
    "running": lambda controller, _: f"Program running: {str(controller.programs.state in _RUNS).lower()}",
    "robotmode": lambda controller, _: f"Robotmode: {controller.robot_mode.name}",
    "safetymode": lambda controller, _: f"Safetymode: {name_of(SafetyMode, controller.safety_mode)}",
    "safetystatus": lambda controller, _: f"Safetystatus: {name_of(SafetyMode, controller.safety_mode)}",
    "programState": _program_state,
    "get loaded program": lambda controller, _: (
        f"Loaded program: /programs/{controller.programs.loaded}.urp"
        if controller.programs.loaded
        else "No program loaded"
    ),
    "is in remote control": lambda controller, _: str(controller.remote).lower(),
    "PolyscopeVersion": lambda _, version: f"URSoftware {version} (simulated)",
    "version": lambda _, version: str(version),
    "get serial number": lambda controller, _: "20200000000",
    "get robot model": lambda controller, _: "UR5",
}
_ORDERS: Mapping[str, Callable[[UrController, float], str]] = {
    "play": _play,
    "stop": _stop,
    "pause": _pause,
    "unlock protective stop": _unlock,
    "close safety popup": lambda controller, now_s: "closing safety popup",
    "restart safety": _done(UrController.restart_safety, "Restarting safety"),
    "power on": _done(UrController.power_on, "Powering on"),
    "power off": _done(UrController.power_off, "Powering off"),
    "brake release": _done(UrController.release_brakes, "Brake releasing"),
}
