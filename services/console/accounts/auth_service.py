"""The desk: signs people in and out, follows the accounts file, and says so on the mesh."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from robomesh.schemas.robomesh_pb2 import Event
from services.console.accounts.file import (
    Account,
    AccountRole,
    Accounts,
    changing,
    check_account_name,
    open_to_others,
    read_accounts,
)
from services.console.accounts.passwords import Verifier, check_password
from services.console.accounts.sessions import Sessions, SignedIn
from services.console.accounts.sign_in_attempts import SignInLimits, network
from services.console.errors import AccountsError, SignInBusyError
from services.errors import ServiceError

log = logging.getLogger(__name__)

_LOOK_EACH_S = 0.5
_MOST_OF_NAME = 64
# Of what is told of refused sign-ins: a flood of them is counted, not told one by one.
_REFUSALS_TOLD_EACH_S = 1.0

Tell = Callable[[Event.Severity, str, str, Mapping[str, str]], None]


class SignInError(ServiceError):
    """A sign-in that was refused.

    Attributes:
        wait_s: How long until the next try [s]; 0: the name or the password was wrong.
    """

    def __init__(self, text: str, wait_s: float = 0.0) -> None:
        super().__init__(text)
        self.wait_s = wait_s


@dataclass
class Desk:
    """Accounts, sessions and limits of a console.

    Args:
        tell: Publishes an event: severity, code, text, values.
    """

    path: Path
    site: str
    tell: Tell
    sessions: Sessions = field(init=False)
    _limits: SignInLimits = field(default_factory=SignInLimits)
    _verifier: Verifier = field(default_factory=Verifier)
    _version: tuple[int, ...] = ()
    _refusals: int = 0
    _refusal_told_at: float = -_REFUSALS_TOLD_EACH_S

    def __post_init__(self) -> None:
        """Reads the file.

        Raises:
            AccountsError: If it is wrong, or nobody could sign in.
        """
        self._version = _version(self.path)
        accounts = read_accounts(self.path)
        if not any(not each.disabled for each in accounts.values()):
            raise AccountsError(
                f"{self.path}: no account can sign in: add one with "
                f"`robomesh accounts add {self.path} NAME --role admin`"
            )
        if open_to_others(self.path):
            log.warning("%s can be read by others of this machine: chmod 600 is right", self.path)
        self.sessions = Sessions(accounts, on_end=self._tell_end)

    def close(self) -> None:
        """Ends the verifying thread."""
        self._verifier.close()

    async def follow(self) -> None:
        """Ends what is over and takes up changes of the file, until it is cancelled."""
        while True:
            await asyncio.sleep(_LOOK_EACH_S)
            self.sessions.look(time.monotonic())
            self.take_up()

    def take_up(self, *, changed_by: SignedIn | None = None) -> None:
        """Reads the file again where it has changed.

        One that is gone has no accounts; a wrong one changes none.
        """
        version = _version(self.path)
        if version == self._version:
            return
        self._version = version
        try:
            accounts: Accounts = read_accounts(self.path) if version else {}
        except AccountsError as error:
            log.error("%s; the accounts stay as they were", error)
            self.tell(Event.ERROR, "accounts.unreadable", f"{error}; the accounts stay as they were", {})
            return
        self.sessions.take_up(accounts, changed_by=changed_by)

    # ------------------------------------------------------------------------- sessions

    async def sign_in(
        self, name: str, password: str, *, address: str, agent: str, before: SignedIn | None
    ) -> tuple[str, SignedIn]:
        """A new session and its token.

        Args:
            before: Who was signed in at that browser; ended.

        Raises:
            SignInError: If it is refused, with the time to wait.
            SignInBusyError: If too many are being looked at.
        """
        account = await self._proven(name, password, address)
        if before is not None:
            self.sessions.end(before, "replaced")
        now = time.monotonic()
        token, signed_in = self.sessions.open(
            account, address=address, agent=agent, now=now, at=datetime.now(UTC)
        )
        text = f"{account.name} signed in from {address} ({account.role.value})"
        self.tell(Event.INFO, "account.signed_in", text, _values(account.name, address))
        return token, signed_in

    async def unlock(self, who: SignedIn, password: str, *, address: str) -> str:
        """The password again, for the right to command: a new token.

        Raises:
            SignInError, SignInBusyError: As for a sign-in.
        """
        await self._proven(who.account.name, password, address, session=who.id)
        text = f"{who.account.name} gave the password again at {address}"
        self.tell(Event.INFO, "account.unlocked", text, _values(who.account.name, address))
        return self.sessions.unlock(who, time.monotonic())

    async def _proven(self, name: str, password: str, address: str, *, session: str = "") -> Account:
        """The account whose password that is; as slow and as talkative for a name that nobody has.

        Args:
            session: In which it is given again; empty: at the door.
        """
        name = name[:_MOST_OF_NAME]  # what is remembered of it is bounded
        account = self.sessions.accounts.get(name)
        known, now = account is not None, time.monotonic()
        wait_s = self._limits.wait_s(name, address, now, known=known, session=session)
        if wait_s > 0:
            self._tell_refusal(name if known else "", address, f"has to wait {wait_s:.0f} s")
            raise SignInError("too many tries", wait_s)
        self._limits.begin(name, address, now, known=known, session=session)
        hashed = account.hash if account is not None and not account.disabled else None
        try:
            right = await self._verifier.verify(hashed, password, address=network(address), name=name)
        except SignInBusyError:
            self._limits.withdraw(name, address, known=known, session=session)
            raise
        # The file may have changed meanwhile.
        if not right or account is None or self.sessions.accounts.get(name) != account:
            self._tell_refusal(name if known else "", address, "name or password wrong")
            raise SignInError("the name or the password is wrong")
        self._limits.succeed(name, address, session=session)
        return account

    def sign_out(self, who: SignedIn, *, everywhere: bool) -> None:
        """Ends a session, or all of its account."""
        if everywhere:
            self.sessions.end_all(who.account.name, "signed_out")
        self.sessions.end(who, "signed_out")

    # ------------------------------------------------------------------------- accounts

    async def change_password(self, who: SignedIn, old: str, new: str, *, address: str) -> None:
        """A new password of one's own; every other session of the account ends.

        Raises:
            SignInError, SignInBusyError: If the old one is wrong.
            AccountsError: If the new one is none, or cannot be written.
        """
        await self._proven(who.account.name, old, address, session=who.id)
        await self.set_account(who, "password", who.account.name, password=new)

    async def set_account(
        self, by: SignedIn, action: str, name: str, *, role: AccountRole | None = None, password: str = ""
    ) -> None:
        """Changes the accounts file: `add`, `role`, `password`, `disable`, `enable`, `remove`.

        Raises:
            AccountsError: If that cannot be, or the file cannot be written.
            SignInBusyError: If too many passwords wait.
        """
        check_account_name(name)
        hashed = ""
        if action in ("add", "password"):
            checked = check_password(password, name=name, site=self.site)
            asker = {"address": network(by.address), "name": by.account.name}
            hashed = await self._verifier.hash(checked, **asker)
        await asyncio.to_thread(
            change_account, self.path, action, name, role=role, hashed=hashed, by_page=True
        )
        text = f"{by.account.name}: account {name}: {action}{f' {role.value}' if role else ''}"
        values = _values(by.account.name, by.address) | {"changed": name, "action": action}
        self.tell(Event.INFO, "account.changed", text, values)
        self.take_up(changed_by=by if by.account.name == name else None)

    # --------------------------------------------------------------------------- events

    def _tell_end(self, signed_in: SignedIn) -> None:
        name = signed_in.account.name
        text = f"{name} at {signed_in.address} was signed out: {signed_in.ended}"
        values = _values(name, signed_in.address) | {"reason": signed_in.ended}
        self.tell(Event.INFO, "account.signed_out", text, values)

    def _tell_refusal(self, name: str, address: str, why: str) -> None:
        """`name` is empty where nobody has it: it may be a password in the wrong field."""
        self._refusals += 1
        now = time.monotonic()
        if now - self._refusal_told_at < _REFUSALS_TOLD_EACH_S:
            return
        more = f" (and {self._refusals - 1} more refusals)" if self._refusals > 1 else ""
        text = f"sign-in as {name or 'somebody unknown'} from {address} refused: {why}{more}"
        self.tell(Event.WARNING, "account.refused", text, _values(name, address))
        self._refusals, self._refusal_told_at = 0, now


def change_account(
    path: Path,
    action: str,
    name: str,
    *,
    role: AccountRole | None = None,
    hashed: str = "",
    by_page: bool = False,
) -> None:
    """Changes one account of a file.

    Args:
        hashed: Of the password, for `add` and `password`.
        by_page: The last administrator who can sign in may not go: only the command line could mend that.

    Raises:
        AccountsError: If that cannot be, or the file cannot be written.
    """
    with changing(path) as accounts:
        account = accounts.get(name)
        if action == "add":
            if account is not None:
                raise AccountsError(f"there is an account {name} already", "taken")
            role = role or AccountRole.MONITOR
            accounts[name] = Account(name=name, role=role, hash=hashed, created=_now())
            return
        if account is None:
            there_are = ", ".join(accounts) or "none"
            raise AccountsError(f"there is no account {name!r}: there are {there_are}", "no_account")
        changes: dict[str, object]
        match action:
            case "role" if role is not None:
                changes = {"role": role}
            case "password":
                changes = {"hash": hashed}
            case "disable" | "enable":
                changes = {"disabled": action == "disable"}
            case "remove":
                changes = {}
                del accounts[name]
            case _:
                raise AccountsError(
                    f"action {action!r}: there are add, role, password, disable, enable, remove"
                )
        if name in accounts:
            accounts[name] = Account(**{**vars(account), **changes})
        admins = [each for each in accounts.values() if each.role is AccountRole.ADMIN and not each.disabled]
        if by_page and not admins:
            text = f"{name} is the last administrator who can sign in: make another one first"
            raise AccountsError(text, "last_admin")


def _now() -> datetime:
    return datetime.now(UTC).replace(microsecond=0)


def _values(name: str, address: str) -> dict[str, str]:
    return {"account": name, "address": address}


def _version(path: Path) -> tuple[int, ...]:
    """What tells one state of the file from another; empty: there is none."""
    with contextlib.suppress(OSError):
        found = path.stat()
        return found.st_ino, found.st_mtime_ns, found.st_size
    return ()
