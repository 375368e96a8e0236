"""Words for what a robot does."""

import pytest

from robomesh.contract.activity import activity_words
from robomesh.schemas.robomesh_pb2 import ControllerState, StopState

Program = ControllerState.Program


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (ControllerState(activity=ControllerState.IDLE), "idle"),
        (ControllerState(activity=ControllerState.ACTIVITY_UNKNOWN), "unknown"),
        (ControllerState(activity=ControllerState.IDLE, program=Program(wait_s=0.4)), "running, waits 0.4 s"),
        (ControllerState(activity=ControllerState.IDLE, program=Program()), "running"),
        (ControllerState(activity=ControllerState.MOVING, program=Program()), "running, moving"),
        (ControllerState(activity=ControllerState.IDLE, program=Program(held=True)), "holding"),
        (ControllerState(activity=ControllerState.HOLDING, program=Program(wait_s=9)), "holding"),
        (ControllerState(activity=ControllerState.FAULT, program=Program()), "fault"),
        (ControllerState(activity=ControllerState.MOVING, program=Program(), stop=StopState(id=1)), "moving"),
    ],
)
def test_a_running_program_is_named_until_something_holds_the_arm(state, words):
    assert activity_words(state) == words
