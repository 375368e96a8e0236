"""Requests that are repeated while the service that answers them is present.

A busy machine or a slow line may lose an answer, so a request is worth several attempts. If no
service is there to answer, as for a mistyped site, it is refused after the first one.
"""

import contextlib
from collections.abc import Awaitable, Callable
from typing import TypeVar

from robomesh import reason_codes as codes
from robomesh.contract import keys, topics
from robomesh.errors import BrokenAnswerError, NoAnswerError, RefusedError
from robomesh.wire.session import Session

Answer = TypeVar("Answer")


async def ask_repeatedly(
    session: Session,
    key: str,
    ask: Callable[[float], Awaitable[Answer]],
    timeouts_s: tuple[float, ...],
    *,
    repeat_after: tuple[type[Exception], ...] = (NoAnswerError,),
) -> Answer:
    """Send a request until it is answered, once for each timeout.

    Args:
        key: Key of the request.
        ask: Sends the request, with a timeout [s].
        repeat_after: Errors after which the request is repeated.

    Raises:
        RefusedError: If it is refused, or no service of the robot answers requests on this key.
        NoAnswerError: If the last attempt has no answer.
    """
    for number, timeout_s in enumerate(timeouts_s[:-1]):
        try:
            return await ask(timeout_s)
        except repeat_after as error:
            silent = isinstance(error, NoAnswerError) and not isinstance(error, BrokenAnswerError)
            if number == 0 and silent:
                await _check_present(session, key)
    return await ask(timeouts_s[-1])


async def _check_present(session: Session, key: str) -> None:
    """Refuse a request if the live services are known and none of them owns its key."""
    asked = keys.parse_expression(key)
    owners = {role.value for role in topics.request(asked.topic).owners}
    with contextlib.suppress(NoAnswerError):
        if not any(
            who.site == asked.site and who.robot == asked.robot and who.service in owners
            for who in await session.present()
        ):
            place = asked.site if asked.robot == keys.WHOLE_SITE else f"{asked.site}/{asked.robot}"
            raise RefusedError(codes.NO_SERVICE(services=" or ".join(sorted(owners)), place=place))
