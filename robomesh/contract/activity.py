"""Words for what a robot does, as its controller and its gateway report it."""

from robomesh.contract.enum_names import enum_word
from robomesh.schemas.robomesh_pb2 import ControllerState

# In these states, a robot does not move by itself even if a program runs.
_RESTS = frozenset({ControllerState.HOLDING, ControllerState.STOPPED, ControllerState.FAULT})


def activity_words(state: ControllerState) -> str:
    """Return what a robot does, in lower case: "idle", "moving", "running, waits 0.4 s"."""
    activity = enum_word(ControllerState.Activity, state.activity)
    if not state.HasField("program") or state.HasField("stop") or state.activity in _RESTS:
        return activity
    if state.program.held:
        return "holding"
    if state.program.HasField("wait_s"):
        return f"running, waits {state.program.wait_s:g} s"
    return f"running, {activity}" if activity in ("moving", "homing") else "running"
