"""Rights of pages: the topic table's rights, limited by the account's role."""

from google.protobuf.message import DecodeError

from robomesh import reason_codes as codes
from robomesh.contract import keys, topics
from robomesh.contract.topics import Role
from robomesh.errors import KeyNameError, RefusedError, UnknownTopicError
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import StopRequest
from services.console.accounts.file import Account, AccountRole
from services.console.accounts.sessions import SignedIn

PASSWORD_AGAIN = codes.PASSWORD_AGAIN()


def operator_name(account: str, site: str) -> str:
    """Return an account's operator name, under which its pages act."""
    return f"{account}.{site}"


def lacks_right(account: Account, what: str) -> Reason:
    """Return why a monitor account may not send a request, or an operator not an engineer's."""
    if account.may_command:
        return codes.NEEDS_ENGINEER(account=account.name, role=account.role.value, what=what)
    return codes.NEEDS_OPERATOR(account=account.name, role=account.role.value, what=what)


def parse_request(text: str) -> tuple[keys.Key, topics.Request]:
    """Parse the key of a page's request; return it with its row of the table.

    Raises:
        RefusedError: If it is not a request of the table, or has a wildcard.
    """
    try:
        key = keys.parse_key(text)
        row = topics.request(key.topic)
        if row.in_name:
            topics.check_operator(key.last_chunk)
    except (KeyNameError, UnknownTopicError) as error:
        raise RefusedError(codes.INVALID(error.reason)) from None
    if Role.CONSOLE not in row.askers:
        raise RefusedError(codes.CONSOLE_NO_RIGHT(request=row.name))
    return key, row


def check_right(row: topics.Request, key: keys.Key, user: SignedIn, site: str) -> None:
    """Check that an account may send a request now.

    Raises:
        RefusedError: With the missing right.
    """
    if user.ended:
        raise RefusedError(codes.SIGNED_OUT())
    account, everybody = user.account, Role.MONITOR in row.askers
    if row.administrators and account.role is not AccountRole.ADMIN:
        raise RefusedError(codes.ACCOUNT_NOT_ADMIN(account=account.name))
    may = account.may_command if Role.OPERATOR in row.askers else account.may_change_cells
    if not everybody and not may:
        what = row.name.removesuffix("/*")
        raise RefusedError(lacks_right(account, what))
    check_own_name(row, key, operator_name(account.name, site), user=account.name)
    if not everybody and user.resting:
        raise RefusedError(PASSWORD_AGAIN)


def check_own_name(row: topics.Request, key: keys.Key, own: str, *, user: str = "this page") -> None:
    """Check that a request with an operator's name uses the page's own.

    Raises:
        RefusedError: If it uses another name.
    """
    chunk = key.last_chunk
    if row.in_name and chunk != own:
        raise RefusedError(codes.OWN_NAME_ONLY(who=user, own=own, name=chunk))


def in_own_name(row: topics.Request, payload: bytes, operator: str) -> bytes:
    """Put the page's own name into a stop request; return other payloads unchanged."""
    if row.request is not StopRequest:
        return payload
    try:
        stop = StopRequest.FromString(payload)
    except DecodeError:
        return payload  # the gateway accepts a stop with an invalid payload
    stop.by = operator
    return stop.SerializeToString()
