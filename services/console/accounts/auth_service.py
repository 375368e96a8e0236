"""The authentication service: signs users in and out, follows the accounts file, publishes events."""

import asyncio
import contextlib
import logging
import math
import time
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from robomesh import reason_codes as codes
from robomesh.schemas.robomesh_pb2 import Event
from services.console.accounts.file import (
    Account,
    AccountRole,
    AccountsFile,
    changing,
    check_account_name,
    now,
    open_to_others,
    read_accounts,
)
from services.console.accounts.passwords import Verifier, check_password
from services.console.accounts.refusal_events import PublishEvent, RefusalEvents
from services.console.accounts.sessions import Sessions, SignedIn
from services.console.accounts.sign_in_attempts import SignInLimits, network
from services.console.accounts.view_access import ViewTokens
from services.console.common.errors import AccountsError, SignInBusyError, SignInError

log = logging.getLogger(__name__)

_CHECK_EVERY_S = 0.5
_MOST_OF_NAME = 64
_ACTIONS = ("add", "role", "password", "disable", "enable", "remove")
# Rate-limit events of refused sign-ins; the next event has the number of those left out.


@dataclass
class AuthService:
    """A console's accounts, sessions, view tokens and sign-in limits.

    Args:
        publish_event: Publishes an event: severity, code, text, values.
    """

    path: Path
    site: str
    publish_event: PublishEvent
    sessions: Sessions = field(init=False)
    tokens: ViewTokens = field(init=False)
    _limits: SignInLimits = field(default_factory=SignInLimits)
    _verifier: Verifier = field(default_factory=Verifier)
    _version: tuple[int, ...] = ()
    _refusals: RefusalEvents = field(init=False)

    def __post_init__(self) -> None:
        """Read the accounts file.

        Raises:
            AccountsError: If it is invalid, or no account can sign in.
        """
        self._version = _version(self.path)
        found = read_accounts(self.path)
        if all(each.disabled for each in found.accounts.values()):
            raise AccountsError(
                f"{self.path}: no account can sign in: add one with "
                f"`robomesh accounts add {self.path} NAME --role admin`"
            )
        if open_to_others(self.path):
            log.warning("%s is readable by other users of this machine: run chmod 600 on it", self.path)
        self.sessions = Sessions(found.accounts, on_end=self._publish_end)
        self.tokens = ViewTokens(found.tokens, self.publish_event)
        self._refusals = RefusalEvents(self.publish_event, "account.refused")

    def close(self) -> None:
        """Stop the verifier's thread."""
        self._verifier.close()

    async def follow(self) -> None:
        """End expired sessions and apply changes of the file, until cancelled."""
        while True:
            await asyncio.sleep(_CHECK_EVERY_S)
            self.sessions.expire(time.monotonic())
            self.tokens.expire()
            self.reload()

    def reload(self, *, changed_by: SignedIn | None = None) -> None:
        """Reload the file if it has changed.

        A missing file has no accounts and no tokens; an invalid one changes nothing.
        """
        version = _version(self.path)
        if version == self._version:
            return
        self._version = version
        try:
            found = read_accounts(self.path) if version else AccountsFile()
        except AccountsError as error:
            log.error("%s; the last valid accounts apply", error)
            self.publish_event(
                Event.ERROR, "accounts.unreadable", f"{error}; the last valid accounts apply", {}
            )
            return
        self.sessions.apply_accounts(found.accounts, changed_by=changed_by)
        self.tokens.apply(found.tokens)

    # ------------------------------------------------------------------------- sessions

    async def sign_in(
        self, name: str, password: str, *, address: str, agent: str, before: SignedIn | None
    ) -> tuple[str, SignedIn]:
        """Verify a sign-in; return the new session and its token.

        Args:
            before: Earlier session of the same browser; it ends.

        Raises:
            SignInError: If the sign-in is refused, with the time to wait.
        """
        account = await self._verify(name, password, address)
        if before is not None:
            self.sessions.end(before, "replaced")
        now = time.monotonic()
        token, signed_in = self.sessions.open(
            account, address=address, agent=agent, now=now, at=datetime.now(UTC)
        )
        text = f"{account.name} signed in from {address} ({account.role.value})"
        self.publish_event(Event.INFO, "account.signed_in", text, _values(account.name, address))
        return token, signed_in

    async def unlock(self, user: SignedIn, password: str, *, address: str) -> str:
        """Verify the password again, to restore the right to command; return a new token.

        Raises:
            SignInError: Like `sign_in`.
        """
        await self._verify(user.account.name, password, address, session=user.id)
        text = f"{user.account.name} entered the password again at {address}"
        self.publish_event(Event.INFO, "account.unlocked", text, _values(user.account.name, address))
        return self.sessions.unlock(user, time.monotonic())

    async def _verify(self, name: str, password: str, address: str, *, session: str = "") -> Account:
        """Return the account if the password is right; time and error are the same for an unknown name.

        Args:
            session: Session in which the password is entered again; empty for a sign-in.
        """
        name = name[:_MOST_OF_NAME]  # bounds memory
        account = self.sessions.accounts.get(name)
        known, now = account is not None, time.monotonic()
        wait_s = self._limits.wait_s(name, address, now, known=known, session=session)
        if wait_s > 0:
            self._publish_refusal(name if known else "", address, f"has to wait {wait_s:.0f} s")
            raise SignInError(codes.ACCOUNT_WAIT(seconds=math.ceil(wait_s)), wait_s)
        self._limits.begin(name, address, now, known=known, session=session)
        hashed = account.hash if account is not None and not account.disabled else None
        try:
            right = await self._verifier.verify(hashed, password, address=network(address), name=name)
        except SignInBusyError:
            self._limits.withdraw(name, address, known=known, session=session)
            raise
        # The file may have changed during verification.
        if not right or account is None or self.sessions.accounts.get(name) != account:
            self._publish_refusal(name if known else "", address, "name or password wrong")
            raise SignInError(codes.ACCOUNT_PASSWORD_WRONG() if session else codes.ACCOUNT_WRONG())
        self._limits.succeed(name, address, session=session)
        return account

    def sign_out(self, user: SignedIn, *, everywhere: bool) -> None:
        """End a session, or all sessions of its account."""
        if everywhere:
            self.sessions.end_all(user.account.name, "signed_out")
        self.sessions.end(user, "signed_out")

    # ------------------------------------------------------------------------- accounts

    async def change_password(self, user: SignedIn, old: str, new: str, *, address: str) -> None:
        """Change a user's own password; every other session of the account ends.

        Raises:
            SignInError: If the old password is not accepted.
            AccountsError: If the new one is unacceptable, or cannot be written.
        """
        await self._verify(user.account.name, old, address, session=user.id)
        await self.set_account(user, "password", user.account.name, password=new)

    async def set_account(
        self, by: SignedIn, action: str, name: str, *, role: AccountRole | None = None, password: str = ""
    ) -> None:
        """Change the accounts file: `add`, `role`, `password`, `disable`, `enable`, `remove`.

        Raises:
            AccountsError: If the change is invalid, or the file cannot be written.
            SignInBusyError: If the queue is full.
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
        self.publish_event(Event.INFO, "account.changed", text, values)
        self.reload(changed_by=by if by.account.name == name else None)

    # --------------------------------------------------------------------------- events

    def _publish_end(self, signed_in: SignedIn) -> None:
        name = signed_in.account.name
        text = f"{name} at {signed_in.address} was signed out: {signed_in.ended}"
        values = _values(name, signed_in.address) | {"reason": signed_in.ended}
        self.publish_event(Event.INFO, "account.signed_out", text, values)

    def _publish_refusal(self, name: str, address: str, why: str) -> None:
        """Publish a refusal. `name` is empty for an unknown name, which may be a mistyped password."""
        text = f"sign-in as {name or 'an unknown name'} from {address} refused: {why}"
        self._refusals.publish(text, _values(name, address))


def change_account(
    path: Path,
    action: str,
    name: str,
    *,
    role: AccountRole | None = None,
    hashed: str = "",
    by_page: bool = False,
) -> None:
    """Change one account of a file.

    Args:
        hashed: Hash of the password, for `add` and `password`.
        by_page: Keep at least one administrator who can sign in; only the command line could restore one.

    Raises:
        AccountsError: If the change is invalid, or the file cannot be written.
    """
    with changing(path) as found:
        accounts = found.accounts
        account = accounts.get(name)
        if action == "add":
            if account is not None:
                raise AccountsError(codes.ACCOUNT_TAKEN(name=name))
            role = role or AccountRole.MONITOR
            accounts[name] = Account(name=name, role=role, hash=hashed, created=now())
            return
        if account is None:
            there_are = ", ".join(accounts) or "none"
            raise AccountsError(codes.ACCOUNT_NONE(name=name, accounts=there_are))
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
                raise AccountsError(codes.ACCOUNT_ACTION(action=action, actions=", ".join(_ACTIONS)))
        if name in accounts:
            accounts[name] = Account(**{**vars(account), **changes})
        admins = [each for each in accounts.values() if each.role is AccountRole.ADMIN and not each.disabled]
        if by_page and not admins:
            raise AccountsError(codes.ACCOUNT_LAST_ADMIN(name=name))


def _values(name: str, address: str) -> dict[str, str]:
    return {"account": name, "address": address}


def _version(path: Path) -> tuple[int, ...]:
    """Return a value that changes with the file; empty if there is no file."""
    with contextlib.suppress(OSError):
        found = path.stat()
        return found.st_ino, found.st_mtime_ns, found.st_size
    return ()
