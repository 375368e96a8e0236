"""Requests over the mesh to one robot: stops, leases, commands and programs."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from google.protobuf.message import Message

from protocol_gateway.authority.audit_entry import MESH, Entry, Outcome, entry_of
from protocol_gateway.execution.clocks import read_clocks
from protocol_gateway.execution.control import Control
from protocol_gateway.execution.deadlines import set_deadline
from protocol_gateway.execution.jog_runner import JogRunner
from protocol_gateway.execution.program_runner import ProgramRunner
from protocol_gateway.seam.text_limits import LONGEST_SENTENCE, LONGEST_TEXT
from robomesh import reason_codes as codes
from robomesh.contract.topics import check_operator
from robomesh.errors import KeyNameError, RefusedError
from robomesh.reasons import Reason
from robomesh.requests.server import Handler, Request, RequestServer
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.texts import one_line
from robomesh.wire.session import Session

# Request names in the audit log where the request itself could not be read.
_LEASE, _COMMAND, _JOG = "LEASE", "COMMAND", "JOG_KEEP_ALIVE"


class MeshRequests:
    """Server of one robot's requests over the mesh.

    Args:
        audit: Writes an entry without waiting for the disk.
    """

    def __init__(
        self,
        session: Session,
        site: str,
        robot: str,
        *,
        control: Control,
        programs: ProgramRunner,
        jogs: JogRunner,
        audit: Callable[[Entry], None],
    ) -> None:
        self._control, self._programs, self._jogs, self._audit = control, programs, jogs, audit
        self._stops = session.answer(
            site, robot, "stop", self._answer_stop, recall=control.answer_to_repeated_stop
        )

        def answer(name: str, handler: Handler, what: str) -> RequestServer:
            refused = partial(self._record_refused, what)
            return session.answer(site, robot, name, handler, on_refused=refused)

        self._servers = (
            answer("lease/request/*", self._answer_lease, _LEASE),
            answer("command/*", self._answer_command, _COMMAND),
            answer("jog/*", self._answer_keep_alive, _JOG),
        )
        self._turned_away = 0

    def close(self) -> None:
        """Stop answering."""
        for each in (self._stops, *self._servers):
            each.close()

    def record_counted(self) -> None:
        """Write the numbers of repeated stops and of requests without a place into the audit log."""
        if (repeated := self._stops.take_repeated()) is not None:
            count, newest, answer = repeated
            assert isinstance(answer, schema.StopAnswer)
            by, reason = _by_and_reason(newest)
            self._control.record_repeated_stops(count, answer.stop_id, by=by, reason=reason, source=MESH)
        turned_away = sum(each.turned_away for each in (self._stops, *self._servers))
        if more := turned_away - self._turned_away:
            self._turned_away = turned_away
            self._record_refused("REQUESTS", "", codes.TURNED_AWAY(), repeated=more - 1)

    async def _answer_stop(self, request: Request) -> schema.StopAnswer:
        message = request.message
        assert isinstance(message, schema.StopRequest)
        by, reason = _by_and_reason(message)
        return self._control.stop(by=by, reason=reason, source=MESH, page=message.page)

    async def _answer_lease(self, request: Request) -> schema.LeaseAnswer:
        message = request.message
        assert isinstance(message, schema.LeaseRequest)
        message.reason, message.to = one_line(message.reason), one_line(message.to)
        return await self._control.lease(message, operator=self._operator(_LEASE, request), source=MESH)

    async def _answer_command(self, request: Request) -> schema.CommandAnswer:
        message = request.message
        assert isinstance(message, schema.CommandRequest)
        operator = self._operator(_COMMAND, request)
        set_deadline(message, request, read_clocks())
        if message.HasField("recover"):
            message.recover.reason = one_line(message.recover.reason, LONGEST_TEXT).strip()
        if message.command == schema.CommandRequest.RUN_PROGRAM:
            return await self._programs.run(message, operator=operator, source=MESH)
        if message.command == schema.CommandRequest.JOG:
            return await self._jogs.begin(message, operator=operator, source=MESH)
        return await self._control.commands([message], operator=operator, source=MESH)

    async def _answer_keep_alive(self, request: Request) -> schema.JogAnswer:
        message = request.message
        assert isinstance(message, schema.JogRequest)
        operator = self._operator(_JOG, request)
        try:
            return self._jogs.keep_alive(message, operator=operator)
        except RefusedError as error:
            self._record_refused(_JOG, operator, error.reason)
            raise

    def _operator(self, what: str, request: Request) -> str:
        """Return the name of the operator who sends a request.

        Raises:
            RefusedError: If the name is invalid. Shortened or corrected, it could be another operator's.
        """
        name = request.chunk
        try:
            if len(name) > LONGEST_TEXT:
                raise KeyNameError(codes.OPERATOR_TOO_LONG(name=one_line(name, 40), most=LONGEST_TEXT))
            return check_operator(name)
        except KeyNameError as error:
            reason = codes.INVALID(error.reason)
            self._record_refused(what, name, reason)
            raise RefusedError(reason) from None

    def _record_refused(self, request: str, name: str, why: Reason, *, repeated: int = 0) -> None:
        """Audit a request that was rejected before evaluation: unreadable, or with an invalid operator."""
        entry = entry_of(
            request,
            time_ns=time.time_ns(),
            operator=one_line(name, 40),
            source=MESH,
            outcome=Outcome.REFUSED,
            text=one_line(why.text, LONGEST_SENTENCE),
            why=why,
        )
        self._audit(replace(entry, repeated=repeated))


def _by_and_reason(message: Message) -> tuple[str, str]:
    """Return the sender and the reason of a stop, which is never refused because of its texts."""
    assert isinstance(message, schema.StopRequest)
    return one_line(message.by).strip() or "somebody", one_line(message.reason).strip()
