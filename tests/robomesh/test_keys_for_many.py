"""Publications, replies and tokens on keys with wildcards are ignored."""

import asyncio

import zenoh

from robomesh.contract.access_rights import PROBE_ROBOT
from robomesh.contract.endpoints import client_config
from robomesh.contract.header import Header, pack
from robomesh.contract.ignored import PUBLICATION, Ignored
from robomesh.contract.keys import Key
from robomesh.requests.server import Request
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.last_values import last_values
from robomesh.wire.session import open_session
from tests.conftest import last_value
from tests.robomesh.test_session import joints, until

JOINTS = joints(7.0).SerializeToString()
STOP = schema.StopAnswer(stop_id=666).SerializeToString()


async def test_samples_replies_and_tokens_on_wildcard_keys_are_ignored(mesh):
    async with open_session(mesh) as gateway, open_session(mesh) as monitor:
        states = monitor.subscribe("robomesh/site/arm/joints", newest=10, history=False)
        with zenoh.open(client_config(mesh.connect)) as forger:
            numbers = iter(range(1, 10_000))
            async with asyncio.timeout(30.0):
                while not monitor.ignored.count:
                    head = pack(Header(1, next(numbers), 1))
                    forger.put("robomesh/site/ar$*/joints", JOINTS, attachment=head)
                    await asyncio.sleep(0.01)
            publisher = gateway.declare_publisher("site", "arm", "joints")
            await until(lambda: publisher.watched)
            publisher.put(joints(1.0))
            assert (await anext(states)).message() == joints(1.0)
            assert [*states.ages_s()] == [Key("site", "arm", "joints")]

            wildcard = "robomesh/site/*/joints"
            forger.declare_queryable(
                wildcard, lambda query: query.reply(wildcard, JOINTS, attachment=pack(Header(1, 1, 1)))
            )
            token = forger.liveliness().declare_token("robomesh/site/*/alive/gateway/f")
            present = forger.liveliness().declare_token("robomesh/site/arm/alive/player/f")
            async with asyncio.timeout(30.0):
                # The second token arrives after the first, on the same link.
                while not any(who.service == "player" for who in await monitor.present()):
                    await asyncio.sleep(0.01)
            assert [who.service for who in await monitor.present()] == ["player"]
            assert await last_values(monitor, "robomesh/*/*/joints") == {
                "robomesh/site/arm/joints": joints(1.0)
            }
            assert await last_value(monitor, "robomesh/site/arm/joints") == joints(1.0)
            token.undeclare()
            present.undeclare()


async def test_queryable_for_everything_does_not_answer_a_stop_for_its_owner(mesh):
    stopped = []

    async def stop(request: Request):
        stopped.append(request.key.robot)
        return schema.StopAnswer(stop_id=1)

    def forge(query):
        query.reply("robomesh/site/*/stop", STOP)

    async with open_session(mesh) as gateway, open_session(mesh) as operator:
        with zenoh.open(client_config(mesh.connect)) as forger:
            forger.declare_queryable("robomesh/site/**", forge, complete=True)
            gateway.answer("site", "arm", "stop", stop)
            answer = await operator.ask("robomesh/site/arm/stop", schema.StopRequest(), timeout_s=20.0)
            assert answer.stop_id == 1
            assert stopped == ["arm"]
            answers = await operator.ask_all("robomesh/*/*/stop", schema.StopRequest(), timeout_s=20.0)
            assert [each.key for each in answers] == ["robomesh/site/arm/stop"]


def test_probes_of_the_rules_are_not_reported_as_wrong_names():
    ignored = Ignored()
    assert ignored.key(PUBLICATION, f"robomesh/site/{PROBE_ROBOT}$*/joints") is None
    assert (ignored.count, ignored.examples) == (0, {})
    assert ignored.key(PUBLICATION, "robomesh/site/ar$*/joints") is None
    assert ignored.count == 1
