"""Links between routers: rights of two sites, a hub, a slow border, two routers of one site."""

import asyncio
import json
from datetime import timedelta
from itertools import product

import pytest
import zenoh

from robomesh.contract.endpoints import Link, bundle, client_config, router_config
from robomesh.contract.keys import robot_key
from robomesh.contract.topics import Role
from services.pki import certificates, site_keys
from services.router.rolling_restart import neighbours, wait_for_turn
from services.router.router import read_access
from tests.ports import free_port
from tests.services.test_router_rules import attached, names, prepared, routing, settings_of, until


def one_link(endpoint, file):
    config = client_config((endpoint,), bundle(file))
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    return config


async def linked_sites(tmp_path, border="open", sites=()):
    """Yield folders and endpoints of two sites; the second links to the first as its guest."""
    here, at_here = prepared(tmp_path, "here", border)
    there, at_there = prepared(tmp_path, "there")
    site_keys.issue_guest(here, "there")
    assert site_keys.accept(there, here.guest("there").read_bytes(), sites=sites) == "here"
    link = Link(endpoint=at_here, tls=there.tls_of_link("here"), site="here")
    return (here, at_here), (there, at_there), link


async def test_two_sites_meet_and_each_speaks_for_itself_alone(tmp_path):
    from robomesh.schemas.robomesh_pb2 import CommandAnswer, CommandRequest

    def deeds_answer():
        return CommandAnswer(accepted=True)

    def command():
        return CommandRequest(command=CommandRequest.HOME)

    (here, at_here), (there, at_there), link = await linked_sites(tmp_path)
    site_keys.issue(there, "li", Role.OPERATOR)
    async with (
        routing(settings_of(here, at_here), settings_of(there, at_there, link)),
        attached(at_here, here.service("gateway")) as ours,
        attached(at_there, there.person("li")) as li,
    ):
        asked = []

        async def answer(request):
            asked.append(request.chunk)
            return deeds_answer()

        ours.answer("here", "arm", "command/*", answer)

        async def sees():
            return {("here", "router"), ("there", "router")} <= await names(li)

        await until(sees)
        await li.ask(robot_key("here", "arm", "command/li.there"), command(), timeout_s=20.0)
        assert asked == ["li.there"]


async def test_a_gateway_of_another_site_neither_answers_nor_shows_itself_for_our_robot(tmp_path):
    (here, at_here), (there, at_there), link = await linked_sites(tmp_path)
    site_keys.issue(here, "li", Role.OPERATOR)
    own, foreign = [], []
    keys = [f"robomesh/here/arm/{each}" for each in ("command/li.here", "lease/request/li.here", "stop")]

    def queryables(session, queries):
        def answer(query):
            queries.append(str(query.key_expr))
            query.reply(str(query.key_expr), b"")

        return [session.declare_queryable(each, answer) for each in keys]

    async with routing(settings_of(here, at_here), settings_of(there, at_there, link)):
        with (
            zenoh.open(one_link(at_here, here.service("gateway"))) as ours,
            zenoh.open(one_link(at_here, here.person("li"))) as li,
            # The other site's gateway, and its router itself, which its own rules do not bind.
            zenoh.open(one_link(at_there, there.service("gateway"))) as its_gateway,
            zenoh.open(one_link(at_there, there.service("router"))) as its_router,
        ):
            kept, heard, token = [], set(), "robomesh/here/arm/alive/gateway/"
            kept += queryables(ours, own)
            kept.append(ours.liveliness().declare_token(f"{token}own"))
            for state in ("lease", "controller", "joints"):
                kept.append(
                    li.declare_subscriber(
                        f"robomesh/*/arm/{state}",
                        lambda sample: heard.add((str(sample.key_expr), bytes(sample.payload))),
                    )
                )
            for session in (its_gateway, its_router):
                kept += queryables(session, foreign)
                kept.append(session.liveliness().declare_token(f"{token}foreign"))

            async def crossed():
                for site, state in product(("here", "there"), ("lease", "controller", "joints")):
                    for session in (its_gateway, its_router):
                        session.put(f"robomesh/{site}/arm/{state}", b"foreign")
                return {(f"robomesh/there/arm/{state}", b"foreign") for state in ("lease", "joints")} <= heard

            await until(crossed)
            for key in keys:
                answers = [each.ok for each in li.get(key, target=zenoh.QueryTarget.ALL, timeout=40.0)]
                assert len(answers) == 1
            assert (own, foreign) == (keys, [])
            assert not [key for key, _ in heard if key.startswith("robomesh/here/")]
            tokens = li.liveliness().get(f"{token}*", timeout=40.0)
            assert [str(each.ok.key_expr) for each in tokens] == [f"{token}own"]


async def test_a_slow_border_lets_thinned_joints_and_the_far_view_out_and_nothing_that_is_fast(tmp_path):
    small, fast = (
        ("joints/slow", "video/far", "controller", "events"),
        ("joints", "video/top", "frames", "image/x"),
    )

    (here, at_here), (there, at_there), link = await linked_sites(tmp_path, "slow")
    async with routing(settings_of(here, at_here), settings_of(there, at_there, link)):
        heard = set()
        with (
            zenoh.open(one_link(at_there, there.service("recorder"))) as far,
            zenoh.open(one_link(at_here, here.service("router"))) as near,
        ):
            for topic in (*small, *fast):
                far.declare_subscriber(
                    f"robomesh/*/*/{topic}", lambda sample: heard.add(str(sample.key_expr))
                )

            async def all_small():
                for topic in (*fast, *small):
                    near.put(f"robomesh/here/arm/{topic}", b"")
                return {f"robomesh/here/arm/{topic}" for topic in small} <= heard

            await until(all_small)
            assert heard == {f"robomesh/here/arm/{topic}" for topic in small}


async def test_a_hub_brings_everybody_but_us(tmp_path):
    (here, at_here), (hub, at_hub), _ = await linked_sites(tmp_path)
    site_keys.issue_guest(hub, "here")
    site_keys.accept(here, hub.guest("here").read_bytes(), sites=("*",))
    link = Link(endpoint=at_hub, tls=here.tls_of_link("there"), site="there")
    async with routing(settings_of(hub, at_hub), settings_of(here, at_here, link)):
        heard = set()
        with (
            zenoh.open(one_link(at_here, here.service("recorder"))) as ours,
            zenoh.open(one_link(at_hub, hub.service("router"))) as bad,
        ):
            ours.declare_subscriber("robomesh/*/arm/joints", lambda sample: heard.add(str(sample.key_expr)))
            keys = [f"robomesh/{site}/arm/joints" for site in ("here", "third", "there")]

            async def others():
                for key in keys:
                    bad.put(key, b"")
                return set(keys[1:]) <= heard

            await until(others)
            assert heard == set(keys[1:])


@pytest.mark.parametrize("name", ["gateway.there", "router-2.there"])
async def test_a_neighbour_that_shows_one_of_our_own_names_is_cut_off_and_our_own_router_is_not(
    tmp_path, caplog, name
):
    caplog.set_level("INFO")

    (here, at_here), (there, at_there), link = await linked_sites(tmp_path)
    # The other site's authority can sign any name.
    other = certificates.read_authority(here.authority_key.read_bytes(), here.authority.read_bytes())
    made = certificates.issue(
        other, name, "router", now=site_keys.now(), lifetime=timedelta(days=1), serves=True
    )
    forged = here.service("forged")
    forged.write_bytes(made.key + made.certificate + here.authority.read_bytes())
    site_keys.issue(there, "router-2", Role.ROUTER)
    second = f"tls/127.0.0.1:{free_port()}"
    own = bundle(there.service("router-2"))
    with (
        zenoh.open(router_config((at_here,), (), bundle(forged))) as imposter,
        zenoh.open(router_config((second,), (), own)) as ours,
    ):
        async with routing(settings_of(there, at_there, second, link)):

            async def cut():
                return f"has a certificate of {name}" in caplog.text

            await until(cut)

            async def alone():
                return not list(imposter.info.links())

            async def with_ours():
                return "router.there" in {link.auth_identifier for link in ours.info.links()}

            await until(alone)
            await until(with_ours)
            assert "follows the new rules" not in caplog.text, "nothing has changed"


async def test_of_two_routers_of_a_site_the_second_waits_until_the_first_serves_again(tmp_path):
    folder, first = prepared(tmp_path)
    site_keys.issue(folder, "router-2", Role.ROUTER)
    second = f"tls/127.0.0.1:{free_port()}"
    tls = {first: folder.tls_of("router"), second: bundle(folder.service("router-2"))}
    configs = {
        first: router_config((first,), (), tls[first], read_access(folder.access)),
        second: router_config((second,), (first,), tls[second], read_access(folder.access)),
    }

    routers = {endpoint: zenoh.open(config) for endpoint, config in configs.items()}
    try:

        async def linked():
            return all(list(each.info.routers_zid()) for each in routers.values())

        await until(linked)
        early, late = sorted(routers, key=lambda endpoint: str(routers[endpoint].info.zid()))
        others = {endpoint: neighbours(routers[endpoint], tls[endpoint]) for endpoint in routers}
        assert others[early] == {str(routers[late].info.zid())}
        await wait_for_turn(routers[early], tls[early], others[early], settled_s=0.0)
        waiting = asyncio.create_task(wait_for_turn(routers[late], tls[late], others[late], settled_s=0.0))
        routers[early].close()

        async def gone():
            return not list(routers[late].info.routers_zid())

        await until(gone)
        assert not waiting.done()
        routers[early] = zenoh.open(configs[early])
        await waiting
        assert str(routers[early].info.zid()) in neighbours(routers[late], tls[late])
    finally:
        for each in routers.values():
            each.close()
