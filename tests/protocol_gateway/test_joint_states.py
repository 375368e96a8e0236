from foxglove_schemas_protobuf.JointState_pb2 import JointState
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from hypothesis import given
from hypothesis import strategies as st

from protocol_gateway.seam import JointsReceived
from protocol_gateway.telemetry.state_messages import JointStatesMessage, timestamp

NAMES = ("waist", "elbow")
_NUMBERS = st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * len(NAMES))


@given(st.lists(st.tuples(_NUMBERS, st.none() | _NUMBERS, st.integers(0, 2**62)), min_size=1, max_size=4))
def test_a_reused_message_equals_a_new_one(units):
    message = JointStatesMessage(NAMES)
    for positions, velocities, wall_ns in units:
        expected = JointStates(
            timestamp=timestamp(wall_ns),
            joints=[
                JointState(name=name, position=position, velocity=velocity)
                for name, position, velocity in zip(NAMES, positions, velocities or (None, None), strict=True)
            ],
        )
        filled = message.fill(JointsReceived(positions, velocities), wall_ns)
        assert filled.SerializeToString() == expected.SerializeToString()
