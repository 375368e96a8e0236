"""Accounts without a console: file, passwords, sessions, and limits of attempts."""

import stat
from datetime import UTC, datetime
from types import SimpleNamespace

import pytest

from services.command_line import main as command_line
from services.console.accounts import passwords
from services.console.accounts.auth_service import change_account
from services.console.accounts.file import Account, AccountRole, read_accounts
from services.console.accounts.passwords import check_password, hash_password, verify
from services.console.accounts.sessions import (
    COMMANDS_AFTER_PASSWORD_S,
    COMMANDS_UNTOUCHED_S,
    IDLE_S,
    LASTS_S,
    MOST_OF_ACCOUNT,
    Sessions,
)
from services.console.accounts.sign_in_attempts import Attempts, SignInLimits
from services.console.common.errors import AccountsError
from services.errors import SiteFileError
from services.site_file import site
from tests.services.signing_in import PASSWORD, cheap_hasher, hashed

AT = datetime(2026, 11, 21, 8, 0, tzinfo=UTC)


def account(name="li", role=AccountRole.OPERATOR, **values):
    return Account(name=name, role=role, hash=hashed(), created=AT, **values)


# ------------------------------------------------------------------------------ the file


def test_a_file_is_read_as_it_was_written_and_is_its_owners_alone(tmp_path):
    path = tmp_path / "accounts.toml"
    change_account(path, "add", "li", role=AccountRole.OPERATOR, hashed=hashed())
    change_account(path, "add", "zhao", hashed=hashed())
    change_account(path, "disable", "zhao")
    accounts = read_accounts(path).accounts
    assert [(a.name, a.role.value, a.disabled) for a in accounts.values()] == [
        ("li", "operator", False),
        ("zhao", "monitor", True),
    ]
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    change_account(path, "remove", "li")
    assert list(read_accounts(path).accounts) == ["zhao"]


ROW = 'name = "li"\nrole = "operator"\nhash = "$argon2id$x"\ncreated = 2026-11-21T08:00:00Z\n'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[[account", "not TOML"),
        ("[account]\n" + ROW, r"\[\[account\]\] and \[\[token\]\] tables"),
        ('site = "s"\n', r"\[\[account\]\] and \[\[token\]\] tables"),
        (f"[[account]]\n{ROW}[[account]]\n{ROW}", "two accounts are named 'li'"),
        ("[[account]]\n" + ROW.replace('"li"', '"li.shanghai"'), "account name 'li.shanghai' is invalid"),
        ("[[account]]\n" + ROW.replace('"li"', '"' + "x" * 33 + '"'), "use at most 32 "),
        ("[[account]]\n" + ROW.replace("operator", "king"), "there are monitor, operator, engineer, admin"),
        ("[[account]]\n" + ROW.replace("$argon2id$x", "secret in clear"), "should be argon2id"),
        ("[[account]]\n" + ROW.replace("2026-11-21T08:00:00Z", '"today"'), "a time with its zone"),
        ("[[account]]\n" + ROW + "disabled = 1\n", "true or false"),
        ("[[account]]\n" + ROW + "admin = true\n", "admin is not a key"),
    ],
)
def test_a_wrong_file_is_refused_with_its_place_and_never_with_a_secret(tmp_path, text, says):
    path = tmp_path / "accounts.toml"
    path.write_text(text)
    with pytest.raises(AccountsError, match=says) as refused:
        read_accounts(path)
    assert str(path) in str(refused.value)
    assert "secret in clear" not in str(refused.value)


def test_a_change_that_cannot_be_leaves_the_file_as_it_was(tmp_path):
    path = tmp_path / "accounts.toml"
    change_account(path, "add", "chen", role=AccountRole.ADMIN, hashed=hashed())
    before = path.read_text()
    for action, name, values, code in (
        ("add", "chen", {"hashed": hashed()}, "account.taken"),
        ("remove", "nobody", {}, "account.no_account"),
        ("crown", "chen", {}, "account.action"),
        ("remove", "chen", {"by_page": True}, "account.last_admin"),
        ("disable", "chen", {"by_page": True}, "account.last_admin"),
        ("role", "chen", {"by_page": True, "role": AccountRole.OPERATOR}, "account.last_admin"),
    ):
        with pytest.raises(AccountsError) as refused:
            change_account(path, action, name, **values)
        assert refused.value.reason.code == code
    assert path.read_text() == before


def test_a_site_file_names_accounts_and_certificate_beside_itself(tmp_path):
    path = tmp_path / "site.toml"
    tls = 'tls = { certificate = "c.pem", key = "tls/k.pem" }'
    path.write_text(f'site = "s"\n[console]\naccounts = "who.toml"\n{tls}\n')
    console = site.load(path).console
    assert (console.accounts, console.url[:8]) == (tmp_path / "who.toml", "https://")
    assert console.tls is not None
    assert (console.tls.certificate, console.tls.key) == (tmp_path / "c.pem", tmp_path / "tls" / "k.pem")
    path.write_text('site = "s"\n[console]\ntls = { certificate = "c.pem" }\n')
    with pytest.raises(SiteFileError, match=r"console\.tls\.key is missing"):
        site.load(path)


# ------------------------------------------------------------------------- the passwords


@pytest.mark.parametrize(
    ("password", "code"),
    [
        ("tiny pw", "account.short"),
        ("Password123", "account.common"),
        ("P@ssw0rd2026!", "account.common"),
        ("aaaaaaaaaaaaaa", "account.repeats"),
        ("abababababab", "account.repeats"),
        ("1234567890", "account.run"),
        ("qwertyuiop", "account.run"),
        ("98765432101", "account.common"),
        ("5829104736", "account.common"),
        ("shanghai2026", "account.common"),
        ("li!!!!!!!!!!2345", "account.common"),
        ("with\0control", "account.control"),
        ("four words and more " * 20, "account.long"),
    ],
)
def test_passwords_that_are_tried_first_are_refused_without_being_repeated(password, code):
    with pytest.raises(AccountsError) as refused:
        check_password(password, name="li", site="shanghai")
    assert refused.value.reason.code == code
    assert password not in f"{refused.value} {refused.value.reason}"


@pytest.mark.parametrize(
    "password", [PASSWORD, "correct horse battery", "三台机器人在大厅里面", "Tr0ub4dor&3x!"]
)
def test_a_few_words_in_any_language_are_a_password(password):
    assert check_password(password, name="li", site="shanghai") == password


@pytest.mark.slow
def test_a_password_is_kept_as_argon2id_and_only_itself_is_right():
    kept = hash_password(PASSWORD)
    assert kept.startswith("$argon2id$v=19$m=65536,t=3")
    assert verify(kept, PASSWORD)
    assert not verify(kept, PASSWORD + " ")
    assert not verify(None, "nobody signs in with this")
    assert not verify("$argon2id$broken", PASSWORD)


# -------------------------------------------------------------------------- the sessions


@pytest.fixture
def sessions():
    return Sessions({"li": account()})


def opened(sessions, now=0.0, who=None):
    return sessions.open(who or account(), address="10.0.0.9", agent="a browser", now=now, at=AT)


class Page:
    in_control = False

    def __init__(self):
        self.notified = []

    def rights_changed(self):
        self.notified.append(1)


def watched(signed_in, *, in_control=False):
    """Open a page of a session."""
    page = Page()
    page.in_control = in_control
    signed_in.pages.add(page)
    return page


def test_a_session_with_a_page_open_lasts_for_days_and_no_longer_than_a_week(sessions):
    token, signed_in = opened(sessions)
    watched(signed_in)
    for hour in range(160):
        sessions.expire(hour * 3600.0)
    assert sessions.find(token, 160 * 3600.0) is signed_in
    assert sessions.find(token, LASTS_S + 1) is None
    assert signed_in.ended == "expired"


def test_a_session_without_pages_ends_within_the_hour(sessions):
    token, signed_in = opened(sessions)
    assert sessions.find(token, IDLE_S - 1) is signed_in
    assert sessions.find(token, 2 * IDLE_S - 2) is signed_in
    assert sessions.find(token, 3 * IDLE_S) is None
    assert signed_in.ended == "idle"


def test_the_right_to_command_is_suspended_without_activity(sessions):
    token, signed_in = opened(sessions)
    page = watched(signed_in)
    sessions.touched(signed_in, 1000.0)
    sessions.expire(1000.0 + COMMANDS_UNTOUCHED_S - 1)
    assert signed_in.may_command
    sessions.expire(1000.0 + COMMANDS_UNTOUCHED_S + 1)
    assert (signed_in.may_command, signed_in.resting, len(page.notified)) == (False, True, 1)
    # Activity alone restores nothing: another person may be at the page.
    sessions.touched(signed_in, 1000.0 + COMMANDS_UNTOUCHED_S + 2)
    assert not signed_in.may_command
    fresh = sessions.unlock(signed_in, 5000.0)
    assert (signed_in.may_command, len(page.notified)) == (True, 2)
    assert sessions.find(token, 5000.0) is None
    assert sessions.find(fresh, 5000.0) is signed_in


def test_the_right_to_command_rests_half_a_day_after_the_password_however_often_it_is_touched(sessions):
    _, signed_in = opened(sessions)
    watched(signed_in)
    for now in range(0, int(COMMANDS_AFTER_PASSWORD_S) + 601, 600):
        sessions.touched(signed_in, float(now))
    assert signed_in.resting


def test_whoever_is_in_control_keeps_it_however_long_nothing_is_touched(sessions):
    _, signed_in = opened(sessions)
    page = watched(signed_in, in_control=True)
    for hour in range(24):
        sessions.expire(hour * 3600.0)
    assert signed_in.may_command
    page.in_control = False
    sessions.expire(24 * 3600.0)
    assert not signed_in.may_command


def test_an_account_has_so_many_sessions_and_the_least_used_goes(sessions):
    tokens = [opened(sessions, now=float(n))[0] for n in range(MOST_OF_ACCOUNT)]
    sessions.find(tokens[0], 100.0)
    opened(sessions, now=101.0)
    assert sessions.find(tokens[1], 102.0) is None
    assert sessions.find(tokens[0], 102.0) is not None
    assert len(list(sessions)) == MOST_OF_ACCOUNT


def test_an_account_that_was_removed_and_added_is_another_account(sessions):
    token, signed_in = opened(sessions)
    other = Account(name="li", role=AccountRole.ADMIN, hash=hashed(), created=AT.replace(hour=9))
    sessions.apply_accounts({"li": other})
    assert (sessions.find(token, 1.0), signed_in.ended) == (None, "removed")


# ------------------------------------------------------------------------------ attempts


def test_waiting_grows_from_a_second_and_ends_at_the_longest():
    tries, now, waits = Attempts(free=3, longest_s=60.0), 0.0, []
    for _ in range(12):
        tries.begin("li", now)
        waits.append(tries.wait_s("li", now))
        now += waits[-1]
    assert waits == [0, 0, 1, 2, 4, 8, 16, 32, 60, 60, 60, 60]
    assert tries.wait_s("zhao", now) == 0
    # After this time it is forgotten.
    tries.begin("li", now + 4000)
    assert tries.wait_s("li", now + 4000) == 0


def test_one_account_is_no_key_to_trying_others_from_the_same_address():
    limits = SignInLimits()
    for n in range(12):
        limits.begin(f"name{n}", "10.0.0.9", 0.0, known=True)
        limits.begin("own", "10.0.0.9", 0.0, known=True)
        limits.succeed("own", "10.0.0.9")
    assert limits.wait_s("another", "10.0.0.9", 0.1, known=True) > 0
    assert limits.wait_s("another", "10.0.0.10", 0.1, known=True) == 0


def test_addresses_of_one_ipv6_network_wait_together():
    limits = SignInLimits()
    for n in range(10):
        limits.begin(f"name{n}", f"2001:db8::{n + 1}", 0.0, known=False)
    assert limits.wait_s("li", "2001:db8::ffff", 0.1, known=True) > 0
    assert limits.wait_s("li", "2001:db8:0:1::1", 0.1, known=True) == 0


def test_a_flood_of_unknown_names_makes_no_real_one_forgotten_and_takes_no_memory():
    limits = SignInLimits()
    for _ in range(5):
        limits.begin("li", "10.0.0.9", 0.0, known=True)
    for n in range(20_000):
        limits.begin(f"x{n}", f"10.{n >> 16}.{n >> 8 & 255}.{n & 255}", 0.0, known=False)
    assert limits.wait_s("li", "10.9.9.9", 0.1, known=True) > 0
    assert len(limits._unknown._tries) == len(limits._addresses._tries) == 4096


# ------------------------------------------------------------------------ the command line


def commanded(capsys, monkeypatch, *arguments, line=""):
    monkeypatch.setattr(passwords, "_hasher", cheap_hasher)
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: False, readline=lambda: line))
    status = command_line.run(["accounts", *map(str, arguments)])
    printed = capsys.readouterr()
    return status, printed.out + printed.err


def test_accounts_are_kept_from_the_command_line_with_passwords_from_standard_input(
    tmp_path, capsys, monkeypatch
):
    site = tmp_path / "site.toml"
    site.write_text('site = "shanghai"\n[console]\naccounts = "who.toml"\n')

    def do(*arguments, line=""):
        return commanded(capsys, monkeypatch, *arguments, line=line)

    assert do("add", site, "li", "--role", "operator", line=PASSWORD + "\n")[0] == 0
    kept = read_accounts(tmp_path / "who.toml").accounts["li"]
    assert verify(kept.hash, PASSWORD)
    assert do("role", site, "li", "admin")[0] == 0
    status, text = do("list", site, "--json")
    assert (status, '"role": "admin"' in text, "argon2" in text) == (0, True, False)
    assert do("passwd", site, "li", line="another few words\n")[0] == 0
    assert do("disable", tmp_path / "who.toml", "li")[0] == 0
    assert read_accounts(tmp_path / "who.toml").accounts["li"].disabled
    assert do("remove", site, "li")[0] == 0
    for arguments, line, says in (
        (("add", site, "wang"), "short\n", "too short"),
        (("add", site, "wang"), "shanghai2026\n", "easy to guess"),
        (("add", site, "wang"), "", "no password on standard input"),
        (("add", site, "Wang Li"), PASSWORD, "is invalid"),
        (("add", site, "wang", "--role", "king"), PASSWORD, "there are monitor, operator, engineer, admin"),
        (("passwd", site, "wang"), PASSWORD, "no account 'wang'"),
        (("list", tmp_path / "nowhere.toml"), "", "no such file"),
    ):
        status, text = do(*arguments, line=line)
        assert (status, says in text, text.count("\n")) == (2, True, 1), (arguments, text)
        assert PASSWORD not in text
