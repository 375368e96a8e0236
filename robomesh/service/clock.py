"""Clock offset and round trip between this process and another, and the time on each hop.

Uses NTP's four times: asked (our clock), received and answered (the other clock), arrived (our clock). The
round trip excludes the owner's time between receiving and answering. With Zenoh's instrumentation each node
on the way stamps the request and its answer; half the sum of the time there and back is the time between
two neighbours, so the difference of their clocks cancels out.

Source: RFC 5905, sections 8 (offset and delay) and 10 (the sample with the least delay is the best).
"""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import zenoh

from robomesh import reason_codes as codes
from robomesh.contract.keys import WHOLE_SITE, robot_key
from robomesh.contract.messages import PROTOBUF, decode
from robomesh.contract.topics import Priority
from robomesh.errors import MessageError, NoAnswerError
from robomesh.requests.replies import query
from robomesh.requests.server import Request, RequestServer
from robomesh.schemas.robomesh_pb2 import ClockAnswer, ClockRequest
from robomesh.wire.session import Session

_KEPT = 8


@dataclass(frozen=True, slots=True)
class Reading:
    """The result of one clock request.

    Attributes:
        offset_s: The other clock minus ours [s], within half the round trip.
        round_trip_s: Time there and back, without the owner's processing [s].
        hops: Zenoh ids of two neighbours on the way, and the time from one to the other [s].
    """

    offset_s: float
    round_trip_s: float
    hops: tuple[tuple[str, str, float], ...] = ()


@dataclass
class Clock:
    """The newest readings of one clock."""

    readings: deque[Reading] = field(default_factory=lambda: deque(maxlen=_KEPT))

    @property
    def best(self) -> Reading | None:
        """The reading with the shortest round trip, which is the most exact; None: no reading."""
        return min(tuple(self.readings), key=lambda reading: reading.round_trip_s, default=None)


def answer_clock(session: Session, site: str, *, wall_ns: Callable[[], int] = time.time_ns) -> RequestServer:
    """Answer clock requests on this process's key.

    Args:
        wall_ns: The clock to report [ns since the Unix epoch].
    """

    async def answer(request: Request) -> ClockAnswer:
        # Answered on the event loop, so that a hanging service shows; `received` is before the wait for it.
        waited_ns = round((time.monotonic() - request.received_s) * 1e9)
        answered = ClockAnswer()
        now_ns = wall_ns()
        answered.received.FromNanoseconds(now_ns - waited_ns)
        answered.answered.FromNanoseconds(now_ns)
        return answered

    return session.answer(site, WHOLE_SITE, f"clock/{session.identity}", answer)


async def read_clock(
    session: Session, site: str, identity: str, *, timeout_s: float = 1.0, hops: bool = False
) -> Reading:
    """Read another process's clock once.

    Args:
        identity: The process's id, as in its presence key.
        hops: Let each node on the way stamp the request.

    Raises:
        NoAnswerError: If no answer arrived in time.
    """

    def read(reply: zenoh.Reply) -> tuple[int, zenoh.Sample] | None:
        return None if reply.ok is None else (time.time_ns(), reply.ok)

    key = robot_key(site, WHOLE_SITE, f"clock/{identity}")
    request = ClockRequest()
    asked_ns = time.time_ns()
    request.asked.FromNanoseconds(asked_ns)
    replies = await query(
        session.zenoh_session,
        key,
        read,
        priority=Priority.INTERACTIVE_HIGH,
        timeout_s=timeout_s,
        payload=request.SerializeToString(),
        encoding=PROTOBUF,
        timestamp_instrumentation=_INSTRUMENTED if hops else None,
    )
    for arrived_ns, sample in replies:
        try:
            answer = decode(ClockAnswer, sample.payload.to_bytes())
        except MessageError:
            continue
        received_ns, answered_ns = answer.received.ToNanoseconds(), answer.answered.ToNanoseconds()
        reading = reading_of(asked_ns, received_ns, answered_ns, arrived_ns)
        return Reading(reading.offset_s, reading.round_trip_s, hops_of(_stamps(sample)))
    raise NoAnswerError(codes.NO_ANSWER(key=key, seconds=timeout_s))


def reading_of(asked_ns: int, received_ns: int, answered_ns: int, arrived_ns: int) -> Reading:
    """Return offset and round trip from the four times; a round trip is never negative."""
    offset_ns = ((received_ns - asked_ns) + (answered_ns - arrived_ns)) / 2
    round_trip_ns = (arrived_ns - asked_ns) - (answered_ns - received_ns)
    return Reading(offset_ns * 1e-9, max(round_trip_ns, 0) * 1e-9)


def hops_of(stamps: list[tuple[str, float]]) -> tuple[tuple[str, str, float], ...]:
    """Return pairs of neighbours and the time between them [s], from the stamps there and back.

    Args:
        stamps: Node and its clock's time [s], in the order of the route; nodes stamp several times.

    Returns:
        The hops, from the caller outwards; empty if the answer took another route.
    """
    visits: list[tuple[str, float, float]] = []  # node, time of arrival, time of departure
    for node, at_s in stamps:
        if visits and visits[-1][0] == node:
            visits[-1] = (node, visits[-1][1], at_s)
        else:
            visits.append((node, at_s, at_s))
    nodes = [node for node, _, _ in visits]
    if len(visits) < 3 or nodes != nodes[::-1]:
        return ()
    hops = []
    for number in range(len(visits) // 2):
        (near, _, left), (far, arrived, _) = visits[number], visits[number + 1]
        (_, _, left_back), (_, back, _) = visits[-number - 2], visits[-number - 1]
        hops.append((near, far, max((arrived - left + back - left_back) / 2, 0.0)))
    return tuple(hops)


def _stamps(sample: zenoh.Sample) -> list[tuple[str, float]]:
    stack = sample.timestamp_stack
    stamps = []
    for record in stack.records if stack is not None else ():
        at = record.timestamp()
        if isinstance(at, zenoh.Timestamp):
            stamps.append((str(at.get_id()), at.get_time().timestamp()))
    return stamps


_INSTRUMENTED = (
    zenoh.TimestampInstrumentationBuilder().set_send(True).set_route(True).set_receive(True).build()
)
