"""Failed sign-ins delay further attempts by the same client, and by no other."""

import asyncio
from unittest.mock import patch

from argon2 import PasswordHasher

from services.console.accounts import passwords, sign_in_queue
from tests.services.signing_in import PASSWORD, Client, guarded
from tests.services.test_console import page

__all__ = ["page"]  # a fixture


async def test_too_many_attempts_wait_for_a_stated_time(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        answers = [await client.sign_in("li", "not the password") for _ in range(4)]
        assert [status for status, _, _ in answers] == [401, 401, 401, 429]
        _, headers, answer = answers[-1]
        assert (answer["error"], answer["refusal"]["code"]) == ("wait", "account.wait")
        assert answer["refusal"]["values"] == {"seconds": str(answer["seconds"])}
        assert int(headers["retry-after"]) == answer["seconds"] >= 1
        # The right password has to wait, too: otherwise the wait would reveal it.
        assert (await client.sign_in("li"))[0] == 429
        assert (await client.sign_in("zhao"))[0] == 200


async def test_failed_sign_ins_do_not_block_a_password_within_a_session(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        await client.sign_in("li")
        stranger = Client(client.address)
        statuses = [(await stranger.sign_in("li", "not the password"))[0] for _ in range(4)]
        assert statuses == [401, 401, 401, 429]
        status, headers, _ = await client.post("/account/unlock", {"password": PASSWORD})
        client.keep(headers)
        assert status == 200
        statuses = [(await client.post("/account/unlock", {"password": "wrong"}))[0] for _ in range(4)]
        assert statuses == [401, 401, 401, 429]
        assert (await stranger.sign_in("zhao"))[0] == 200


async def test_an_unverified_attempt_is_not_a_failure(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        with patch.object(sign_in_queue, "MOST_OF_NAME", 0):
            refused = [await client.sign_in("li") for _ in range(12)]
            assert {status for status, _, _ in refused} == {503}
            assert {each["refusal"]["code"] for _, _, each in refused} == {"account.busy"}
        assert (await client.sign_in("li"))[0] == 200


async def test_a_forged_address_does_not_evade_the_limit(mesh, page, tmp_path):
    async with guarded(mesh, page, tmp_path) as (client, _, _):
        statuses = []
        for number in range(12):
            body = {"name": f"nobody{number}", "password": "not the password"}
            answer = await client.post("/account/sign-in", body, **{"X-Forwarded-For": f"10.0.0.{number}"})
            statuses.append(answer[0])
        assert statuses[:10] == [401] * 10
        assert 429 in statuses


async def test_a_flood_from_one_address_does_not_block_another(mesh, page, tmp_path):
    """Use a real argon2 hash in each attempt; 127.0.0.2 is another address of the same machine."""

    async with guarded(mesh, page, tmp_path, listen="0.0.0.0:0", insecure=True) as (client, _, _):
        port = client.address.rpartition(":")[2]
        stranger, here = Client(f"127.0.0.2:{port}"), Client(f"127.0.0.1:{port}")
        with patch.object(passwords, "_hasher", PasswordHasher):
            flood = [asyncio.create_task(stranger.sign_in(f"nobody{n}", "wrong one")) for n in range(10)]
            await asyncio.sleep(0)
            tries = [await here.sign_in("li") for _ in range(2)]
        assert [status for status, _, _ in tries] == [200, 200]
        assert {(await each)[0] for each in flood} == {401}
