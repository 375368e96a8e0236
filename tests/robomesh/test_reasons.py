"""Codes of refusals: the table, and their encoding on the mesh."""

import asyncio
import string

import pytest
import zenoh

from robomesh import reason_codes as codes
from robomesh.contract.endpoints import client_config
from robomesh.contract.messages import TEXT
from robomesh.errors import BusyError, QuotaError, RefusedError
from robomesh.reasons import MOST_PARAMETER_BYTES, Code, Reason, pairs_of, reason_of, to_parameters
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session

TABLE = [each for each in vars(codes).values() if isinstance(each, Code)]


def sent(reason, when=""):
    """Return a reason as the other end reads it."""
    return reason_of(pairs_of(to_parameters(reason, when)), reason.text)


def test_codes_are_unique_dotted_words():
    names = [each.name for each in TABLE]
    assert len(names) == len(set(names)) > 100
    assert set("".join(names)) <= set(string.ascii_lowercase + "._")
    assert {each.name for each in TABLE if each.problem.endswith(".")} == set()


def test_sentence_has_problem_advice_values_and_causes():
    reason = codes.LINK_DOWN(codes.LINK_FAILED(where="10.0.0.7:5400", detail="refused"))
    assert str(reason) == "the link to the controller is down (cannot connect to 10.0.0.7:5400: refused)"
    assert str(codes.COMMAND_WAITED(waited=1.26, seconds=1.0)).startswith("it waited 1.3 s in the gateway")
    with pytest.raises(KeyError, match="holder"):
        codes.LEASE_HELD()


@pytest.mark.parametrize(
    "reason",
    [
        codes.LEASE_HELD(holder="li"),
        codes.LEASE_NONE(),
        codes.LINK_DOWN(codes.LINK_REFUSED(where="10.0.0.7:5400", detail="a&b=c;d%20 ÷ 操作员")),
        codes.COMMAND_CHANGED(codes.ROBOT_OTHER_MOVED(name="left")),
    ],
)
def test_other_end_reads_the_sent_reason(reason):
    found = sent(reason, "again_s=0.500")
    assert (found.code, found.text) == (reason.code, reason.text)
    assert found.values == reason.values
    assert [(each.code, each.values) for each in found.causes] == [
        (each.code, each.values) for each in reason.causes
    ]


def test_parameters_that_do_not_fit_are_omitted_but_never_the_code():
    reason = codes.STOP_LATCHED(id=7, by="操" * 200, reason="x" * 200)
    written = to_parameters(reason, "again_s=0.500")
    assert len(written.encode()) <= MOST_PARAMETER_BYTES
    assert sent(reason).values == {"id": "7", "reason": "x" * 200}
    causes = Reason("a")
    for _ in range(500):
        causes = Reason("b", causes=(causes,))
    assert len(to_parameters(causes)) <= MOST_PARAMETER_BYTES
    assert sent(Reason("x" * 1000)).code == "x" * 85
    # One of several causes would say less than the sentence.
    assert sent(codes.SEVERAL(codes.ROBOT_MOVED(), codes.ROBOT_NOT_HOMED())).causes == ()


def test_value_is_one_line_without_control_characters():
    reason = codes.ALARM_UNKNOWN(id="a\x1b[2J\nb\u202e" + "x" * 2000)
    assert reason.text.startswith("no alarm 'a [2J b<U+202E>xxx")
    assert len(reason.values["id"]) == 800


@pytest.mark.parametrize(
    "parameters", ["", "busy", "quota=0.5", "%", "&&&=", "code=", "cause.code=x", "\ud800"]
)
def test_encoding_without_a_code_has_no_reason(parameters):
    assert reason_of(pairs_of(parameters), "") is None


async def refusals(session, error):
    """Return the refusal that our client receives."""

    async def refuse(_):
        raise error

    server = session.answer("site", "arm", "stop", refuse)
    try:
        with pytest.raises(RefusedError) as refused:
            await session.ask("robomesh/site/arm/stop", schema.StopRequest(), timeout_s=5)
    finally:
        server.close()
    return refused.value


async def test_refusal_keeps_its_code_over_a_router(mesh):
    reason = codes.STOP_LATCHED(id=7, by="li " * 60, reason="%&=;" * 60)
    async with open_session(mesh) as session:
        found = await refusals(session, RefusedError(reason, text=f"Not sent: {reason}."))
        assert (type(found), str(found)) == (RefusedError, f"Not sent: {reason}.")
        assert (found.reason.code, found.reason.values["id"]) == ("stop.latched", "7")
        # The session still works: more than 255 bytes would have ended it.
        found = await refusals(session, BusyError(codes.BUSY()))
        assert (type(found), found.reason.code) == (BusyError, "request.busy")
        over = codes.OVER_QUOTA(asker="li", quota="checks_a_minute", most=120, seconds=9.0)
        found = await refusals(session, QuotaError(over, again_s=9.0))
        assert (type(found), found.again_s, found.reason.code) == (QuotaError, 9.0, "quota.rate")
        assert found.reason.values["quota"] == "checks_a_minute"


async def test_older_client_gets_the_encodings_that_it_knows(mesh):
    """Check a client that does not request codes and compares the whole encoding."""
    errors = iter(
        [BusyError(codes.BUSY()), QuotaError(codes.BUSY(), again_s=0.25), RefusedError(codes.BUSY())]
    )

    async def refuse(_):
        raise next(errors)

    def asked(plain):
        return [
            (str(reply.err.encoding), reply.err.payload.to_string())
            for _ in range(3)
            for reply in plain.get("robomesh/site/arm/stop", timeout=40.0)
        ]

    async with open_session(mesh) as session:
        session.answer("site", "arm", "stop", refuse)
        with zenoh.open(client_config(mesh.connect, mesh.tls)) as plain:
            found = await asyncio.to_thread(asked, plain)
        assert [encoding for encoding, _ in found] == [
            f"{TEXT};busy",
            f"{TEXT};quota=0.250",
            f"{TEXT};code=request.busy",
        ]
        assert {text for _, text in found} == {str(codes.BUSY())}


@pytest.mark.parametrize(
    ("encoding", "kind"), [("busy", BusyError), ("quota=0.250", QuotaError), ("quota=nan", RefusedError)]
)
async def test_older_owners_encodings_are_understood(mesh, encoding, kind):
    def refuse(query):
        with query:
            query.reply_err(b"no", encoding=f"{TEXT};{encoding}")

    async with open_session(mesh) as session:
        with zenoh.open(client_config(mesh.connect, mesh.tls)) as plain:
            plain.declare_queryable("robomesh/site/arm/stop", refuse)
            with pytest.raises(kind, match=r"^no$"):
                await session.ask("robomesh/site/arm/stop", schema.StopRequest(), timeout_s=0.2)
