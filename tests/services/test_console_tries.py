"""Who tries passwords too often waits, and nobody else does."""

from unittest.mock import patch

from services.console.accounts import passwords
from tests.conftest import run
from tests.services.signing_in import PASSWORD, Client, guarded
from tests.services.test_console import page

__all__ = ["page"]  # a fixture


def test_who_tries_too_often_waits_and_is_told_how_long(mesh, page, tmp_path):
    async def main():
        async with guarded(mesh, page, tmp_path) as (client, _, _):
            told = [await client.sign_in("li", "not the password") for _ in range(4)]
            assert [status for status, _, _ in told] == [401, 401, 401, 429]
            _, headers, answer = told[-1]
            assert answer["error"] == "wait"
            assert int(headers["retry-after"]) == answer["seconds"] >= 1
            # The right password waits too: otherwise waiting would tell which one is right.
            assert (await client.sign_in("li"))[0] == 429
            assert (await client.sign_in("zhao"))[0] == 200

    run(main())


def test_tries_at_the_door_keep_nobody_inside_from_giving_the_password_again(mesh, page, tmp_path):
    async def main():
        async with guarded(mesh, page, tmp_path) as (client, _, _):
            await client.sign_in("li")
            stranger = Client(client.address)
            told = [(await stranger.sign_in("li", "not the password"))[0] for _ in range(4)]
            assert told == [401, 401, 401, 429]
            status, headers, _ = await client.post("/account/unlock", {"password": PASSWORD})
            client.keep(headers)
            assert status == 200
            told = [(await client.post("/account/unlock", {"password": "wrong"}))[0] for _ in range(4)]
            assert told == [401, 401, 401, 429]
            assert (await stranger.sign_in("zhao"))[0] == 200

    run(main())


def test_what_nobody_had_time_to_look_at_is_no_wrong_try(mesh, page, tmp_path):
    async def main():
        async with guarded(mesh, page, tmp_path) as (client, _, _):
            with patch.object(passwords, "_MOST_WAITING", 0):
                assert {(await client.sign_in("li"))[0] for _ in range(12)} == {503}
            assert (await client.sign_in("li"))[0] == 200

    run(main())


def test_who_names_another_address_each_time_is_the_same_stranger(mesh, page, tmp_path):
    async def main():
        async with guarded(mesh, page, tmp_path) as (client, _, _):
            told = []
            for number in range(12):
                body = {"name": f"nobody{number}", "password": "not the password"}
                answer = await client.post(
                    "/account/sign-in", body, **{"X-Forwarded-For": f"10.0.0.{number}"}
                )
                told.append(answer[0])
            assert told[:10] == [401] * 10
            assert 429 in told

    run(main())
