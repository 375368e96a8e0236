"""`robomesh keys`, and a whole site that runs with its keys."""

import json
import logging
import re
import stat
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime, timedelta
from itertools import chain

import pytest
import zenoh

from robomesh.contract.access_rights import PROBE_ROBOT
from robomesh.contract.certificate_identity import read_identity
from robomesh.contract.endpoints import router_config
from robomesh.contract.topics import Role
from robots.descriptions.description import library_names
from services.command_line import main
from services.command_line.site import up
from services.pki import Folder, site_keys
from services.pki.errors import KeysError
from services.router.router import read_access
from services.site_file.site import load
from services.site_file.started_robots import may_start
from tests.ports import free_port
from tests.site import ONE_ARM, robomesh, running_site, site_file, wait_until


def a_site(folder):
    return site_file(
        folder,
        name="hall",
        robots=ONE_ARM,
        router=f"tcp/127.0.0.1:{free_port()}",
        console=f"127.0.0.1:{free_port()}",
    )


@pytest.fixture
def site(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return a_site(tmp_path)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a site with keys, for tests that do not change it."""
    path = a_site(tmp_path_factory.mktemp("made"))
    assert keys("init", str(path)) == 0
    return path.parent


def keys(*arguments):
    return main.run(["keys", *arguments])


def records(capsys):
    return {row["name"]: row for row in map(json.loads, capsys.readouterr().out.splitlines())}


def test_init_creates_a_certificate_for_each_service_and_enables_tls_once(site, capsys):
    before = site.read_text()
    assert keys("init", str(site)) == 0
    assert 'folder = "keys" is added' in capsys.readouterr().out
    assert site.read_text() == before + '\n[keys]\nfolder = "keys"\n'
    read = load(site)
    assert read.listened[0].startswith("tls/127.0.0.1:")
    for service in (
        "router",
        "gateway",
        "started",
        "kinematics",
        "recorder",
        "player",
        "renderer",
        "console",
        "store",
    ):
        assert read.tls_of(service).certificate == site.parent / "keys" / f"{service}.pem"
    written = {file: file.read_bytes() for file in (site.parent / "keys").rglob("*.*")}
    assert keys("init", str(site)) == 0
    assert "0 new certificates" in capsys.readouterr().out
    assert {file: file.read_bytes() for file in written} == written


def test_init_adds_a_new_robot_to_the_gateways_certificate(site, capsys):
    keys("init", str(site))
    site.write_text(site.read_text() + ONE_ARM.replace('"arm"', '"arm-2"'))
    capsys.readouterr()
    assert keys("init", str(site)) == 0
    assert "1 new certificates: gateway.hall" in capsys.readouterr().out
    keys("list", "--json")
    listed = records(capsys)
    assert listed["gateway.hall"]["robots"] == ["arm", "arm-2"]
    # Robots that the page may start are added ahead; other robots of the site are not.
    assert set(listed["started.hall"]["robots"]) == set(library_names())


def test_started_robots_are_added_to_the_rules_without_the_authoritys_key(site, tmp_path):
    keys("init", str(site))
    folder = Folder(tmp_path / "keys")
    folder.authority_key.unlink()
    started = up._Started(load(site), site, load(site).listened[0])
    file = tmp_path / "robots" / "started.toml"
    file.parent.mkdir()

    def rights():
        started.wanted()
        control = read_access(folder.access)["access_control"]
        (policy,) = (each for each in control["policies"] if each["subjects"] == ["started.hall"])
        rules = (rule for rule in control["rules"] if rule["id"] in policy["rules"])
        answered = (rule["key_exprs"] for rule in rules if "declare_queryable" in rule["messages"])
        return {each for each in chain(*answered) if each.endswith("/stop")}

    def stops(*names):
        return {f"robomesh/hall/{name}/stop" for name in ("-", "matrix-probe", *library_names(), *names)}

    assert rights() == stops()
    file.write_text('site = "hall"' + ONE_ARM.replace('"arm"', '"mine"'))
    assert rights() == stops("mine")
    assert keys("init", str(site)) == 0
    assert rights() == stops("mine")
    # Rights stay until the next init, so that the end of a robot does not make routers reopen.
    file.unlink()
    assert rights() == stops("mine")
    assert keys("init", str(site)) == 0
    assert rights() == stops()


def test_the_first_start_of_a_saved_robot_does_not_change_the_rules(site, tmp_path):
    keys("init", str(site))
    saved = tmp_path / "robots" / "mine" / "robot.toml"
    saved.parent.mkdir(parents=True)
    saved.write_text("")
    # Started robots cannot have names that the site file refuses.
    for other in ("replay-x", PROBE_ROBOT, "No"):
        (saved.parent.parent / other).mkdir()
        (saved.parent.parent / other / "robot.toml").write_text("")
    assert may_start(load(site)) == tuple(sorted(("mine", *library_names())))
    started = up._Started(load(site), site, load(site).listened[0])
    started.entitle_ahead()
    rules = Folder(tmp_path / "keys").access.stat()
    started.wanted()
    assert Folder(tmp_path / "keys").access.stat() == rules, "the router would reopen during the site's start"
    for name in ("mine", library_names()[0]):
        (tmp_path / "robots" / "started.toml").write_text(
            'site = "hall"' + ONE_ARM.replace('"arm"', f'"{name}"')
        )
        assert [key[0] for key in started.wanted()] == [name]
    assert Folder(tmp_path / "keys").access.stat() == rules


def test_started_robots_keep_running_when_the_rules_cannot_be_written(site, tmp_path, monkeypatch, caplog):
    caplog.set_level(logging.INFO)
    keys("init", str(site))
    folder = Folder(tmp_path / "keys")
    started = tmp_path / "robots" / "started.toml"
    started.parent.mkdir()
    started.write_text('site = "hall"' + ONE_ARM.replace('"arm"', '"mine"'))
    site_keys.entitle(folder, ["mine"])

    def full(*_):
        raise KeysError(f"{folder.principals}: cannot be written: no space left on device")

    monkeypatch.setattr(site_keys, "save", full)
    following = up._Started(load(site), site, load(site).listened[0])
    assert [key[0] for key in following.wanted()] == ["mine"]
    assert "no space left on device; started robots run" in caplog.text
    caplog.clear()
    # The routers would refuse the gateway of this one.
    started.write_text(started.read_text() + ONE_ARM.replace('"arm"', '"new"'))
    assert [key[0] for key in following.wanted()] == ["mine"]
    assert "no space left on device; robots that were started before keep running" in caplog.text


def test_init_does_not_append_a_second_keys_section(site, capsys):
    site.write_text(text := site.read_text() + "\n[keys]\n")
    assert keys("init", str(site)) == 2
    assert '[keys] has no folder: write folder = "keys" below it' in capsys.readouterr().err
    assert site.read_text() == text


def test_a_bundle_has_the_routers_addresses(site):
    keys("init", str(site))
    keys("issue", "li", "--role", "operator")
    file = Folder(site.parent / "keys").person("li")
    assert read_identity(file).routers == load(site).listened
    site.write_text(site.read_text().replace("[router]\n", '[router]\npublic = ["tls/hall.example:7447"]\n'))
    keys("init", str(site))
    keys("renew", "li")
    assert read_identity(file).routers == ("tls/hall.example:7447",)


def test_secrets_are_readable_by_their_owner_only(site):
    keys("init", str(site))
    keys("issue", "li", "--role", "operator")
    keys("issue", "--guest", "elsewhere")
    folder = site.parent / "keys"
    for path in (folder, *folder.rglob("*")):
        assert stat.S_IMODE(path.stat().st_mode) == (0o700 if path.is_dir() else 0o600), path


def test_issue_renew_revoke_and_list_print_their_result(site, capsys):
    keys("init", str(site))
    assert keys("issue", "li", "--role", "operator", "--days", "5") == 0
    assert keys("issue", "mo", "--role", "monitor") == 0
    capsys.readouterr()
    keys("list", "--json")
    first = records(capsys)
    assert keys("renew") == 0
    # A timer does not renew a certificate of five days forever.
    assert "li.hall" not in capsys.readouterr().out
    assert keys("renew", "li") == 0
    assert capsys.readouterr().out.endswith("1 renewed\n")
    assert keys("revoke", "mo") == 0
    capsys.readouterr()
    keys("list", "--json")
    then = records(capsys)
    assert then["li.hall"]["expires"] >= first["li.hall"]["expires"]
    lives = [datetime.fromisoformat(then["li.hall"][at]) for at in ("issued", "expires")]
    assert lives[1] - lives[0] < timedelta(days=6)
    assert then["li.hall"]["serial"] != first["li.hall"]["serial"]
    assert then["mo.hall"]["revoked"]
    rules = Folder(site.parent / "keys").access.read_text()
    assert "li.hall" in rules
    assert "mo.hall" not in rules
    assert keys("list") == 0
    assert "mo.hall                     monitor    revoked 20" in capsys.readouterr().out


def test_issue_for_an_existing_name_reports_the_earlier_certificate(site, capsys):
    keys("init", str(site))
    capsys.readouterr()
    keys("issue", "li", "--role", "operator")
    first = capsys.readouterr().out
    assert "moves under a lease stops" in first
    assert "had a certificate" not in first
    keys("issue", "li", "--role", "operator")
    again = capsys.readouterr().out
    assert "li.hall had a certificate, until" in again
    assert "robomesh keys renew li.hall" in again
    assert "moves under a lease stops" not in again


def test_keys_are_found_by_site_file_or_folder_or_own_bundle_and_printed(tmp_path, monkeypatch, capsys):
    for name in ("keys", "other", "third"):
        site_keys.prepare(Folder(tmp_path / name), name, robots=[], border="open", routers=[])
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    monkeypatch.delenv("ROBOMESH_KEYS", raising=False)
    assert keys("list") == 2
    assert "no keys found" in capsys.readouterr().err
    monkeypatch.setenv("ROBOMESH_KEYS", str(tmp_path / "third" / "people" / "li.pem"))
    assert keys("list") == 0
    assert f"keys in {tmp_path / 'third'}\n" in capsys.readouterr().out
    (work / "keys").symlink_to(tmp_path / "keys")
    assert keys("list") == 0
    assert "keys in keys\n" in capsys.readouterr().out
    (work / "hall.toml").write_text('site = "hall"\n[keys]\nfolder = "../other"\n')
    assert keys("list") == 0
    assert "keys in ../other\n" in capsys.readouterr().out
    (work / "b.toml").write_text('site = "b"\n[keys]\nfolder = "../third"\n')
    assert keys("revoke", "recorder") == 2
    assert "site files here name ../third and ../other: choose one with --folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("issue", "li"), "a name and --role are needed"),
        (("issue", "li", "--role", "boss"), "--role boss: there are gateway, kinematics"),
        (("issue", "li.wang", "--role", "operator"), "li.wang.hall is not valid: names are letters, digits"),
        (("issue", "gateway", "--role", "operator"), "gateway.hall is gateway already"),
        (("issue", "two", "--role", "gateway"), "a gateway needs its robots: --robots a,b"),
        (("issue", "li", "--role", "operator", "--robots", "a"), "--robots is for gateways"),
        (("issue", "--guest", "hall"), "hall is this site"),
        (("issue", "--guest", "Hall"), "site 'Hall' cannot be used"),
        (("issue", "li", "--guest", "there"), "--guest takes no name, --role or --robots"),
        (("revoke", "nobody"), "nobody has no certificate of this site"),
        (("renew", "nobody"), "nobody has no certificate of this site"),
        (("accept", "site.toml"), "site.toml: not a bundle of a key"),
        (("accept", "not-there.pem"), "not-there.pem: cannot be read"),
        (("accept", "keys/router.pem"), "hall is this site"),
        (("issue", "authority", "--role", "watch"), "authority.hall is the authority's own name"),
        (("issue", "spare", "--role", "router"), "spare.hall: other sites recognise a router by its name"),
        (("list", "--folder", "elsewhere"), "elsewhere/principals.toml does not exist"),
    ],
)
def test_an_invalid_request_is_refused_in_one_line(made, monkeypatch, capsys, arguments, text):
    monkeypatch.chdir(made)
    assert keys(*arguments) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1


def test_without_the_authoritys_key_rules_are_written_but_nothing_is_issued(site, capsys):
    keys("init", str(site))
    keys("issue", "li", "--role", "operator")
    folder = Folder(site.parent / "keys")
    folder.authority_key.unlink()
    assert keys("issue", "mo", "--role", "monitor") == 2
    assert "the authority's key is needed to sign; restore it first" in capsys.readouterr().err
    assert keys("revoke", "li") == 0
    assert site_keys.principals_of(folder).find("li").revoked is not None


def test_an_invalid_list_is_reported_with_its_file_and_key(site, capsys):
    keys("init", str(site))
    listed = Folder(site.parent / "keys").principals
    listed.write_text(listed.read_text().replace('role = "watch"', 'role = "king"'))
    capsys.readouterr()
    assert keys("list") == 2
    assert "principals.toml: principal." in (error := capsys.readouterr().err)
    assert "'king'" in error


def test_a_time_without_zone_is_reported(site, capsys):
    keys("init", str(site))
    listed = Folder(site.parent / "keys").principals
    listed.write_text(re.sub(r"(expires = \S+)Z", r"\1", listed.read_text(), count=1))
    capsys.readouterr()
    assert keys("list") == 2
    assert re.search(r"principals\.toml: principal\.0\.expires = .*timezone", capsys.readouterr().err)


def test_init_repairs_an_init_that_was_killed_before_it_wrote_the_list(site):
    keys("init", str(site))
    folder = Folder(site.parent / "keys")
    whole = site_keys.principals_of(folder)
    folder.principals.unlink()
    folder.access.unlink()
    assert keys("init", str(site)) == 0
    again = site_keys.principals_of(folder)
    assert [each.name for each in again.entries] == [each.name for each in whole.entries]
    known = json.dumps(read_access(folder.access)["access_control"]["subjects"])
    assert all(each.name in known and each.serial for each in again.entries)


def test_a_revoked_name_is_not_issued_while_its_certificate_is_valid(made, monkeypatch, capsys):
    monkeypatch.chdir(made)
    assert keys("issue", "wang", "--role", "operator", "--days", "90") == 0
    assert keys("issue", "wang", "--role", "operator", "--days", "1") == 0  # the first stays valid
    keys("revoke", "wang")
    capsys.readouterr()
    for role in ("operator", "monitor"):
        assert keys("issue", "wang", "--role", role) == 2
        assert "would be admitted again; issue wang-2 in its place" in (error := capsys.readouterr().err)
    listed = site_keys.principals_of(Folder(made / "keys")).find("wang")
    assert listed.good_until - listed.expires > timedelta(days=88)
    assert f"is valid until {listed.good_until:%Y-%m-%d %H:%M} UTC" in error
    assert keys("renew", "wang") == 2
    assert keys("issue", "wang-2", "--role", "operator") == 0


def test_a_revoked_name_is_issued_after_its_certificates_have_expired(made):
    folder = Folder(made / "keys")
    site_keys.issue(folder, "zhou", Role.OPERATOR, lifetime=timedelta(seconds=-60))
    site_keys.revoke(folder, "zhou")
    assert site_keys.issue(folder, "zhou", Role.MONITOR).revoked is None


def test_a_revoked_guest_is_refused_with_a_new_file_and_with_its_sites_file(tmp_path):
    here, there = Folder(tmp_path / "here"), Folder(tmp_path / "there")
    for folder in (here, there):
        site_keys.prepare(folder, folder.path.name, robots=[], border="open", routers=[])
    site_keys.issue_guest(here, "there")
    site_keys.issue_guest(there, "here")
    site_keys.revoke(here, "router.there")
    with pytest.raises(KeysError, match="only a new authority excludes the old certificate"):
        site_keys.issue_guest(here, "there")
    with pytest.raises(KeysError, match="would be admitted again"):
        site_keys.accept(here, there.guest("here").read_bytes())
    assert "router.there" not in here.access.read_text()


def test_concurrent_changes_of_the_authority_are_all_kept(made):
    folder = Folder(made / "keys")
    site_keys.issue(folder, "thief", Role.OPERATOR)
    several = [f"p{number}" for number in range(12)]
    with ThreadPoolExecutor(4) as pool:
        done = [pool.submit(site_keys.issue, folder, name, Role.MONITOR) for name in several]
        done.append(pool.submit(site_keys.revoke, folder, "thief"))
        for each in done:
            each.result()
    principals, rules = site_keys.principals_of(folder), folder.access.read_text()
    assert all(principals.find(name) and f'"{name}.hall"' in rules for name in several)
    assert "thief.hall" not in rules


@pytest.mark.parametrize("connect", ["beijing", "beijing=tls/10.0.0.1:7447"])
def test_a_link_to_a_site_that_did_not_admit_us_is_refused_with_advice(site, connect):
    keys("init", str(site))
    text = site.read_text().replace("[router]\n", f'[router]\nconnect = ["{connect}"]\n')
    site.write_text(text)
    with pytest.raises(Exception, match="robomesh keys issue --guest OURS at site beijing"):
        _ = load(site).links


@pytest.mark.long
@pytest.mark.slow
def test_doctor_tries_every_certificate_and_finds_deviations_of_a_router(site, capsys):
    keys("init", str(site))
    keys("issue", "mo", "--role", "monitor")
    folder, endpoint = Folder(site.parent / "keys"), load(site).listened[0]
    keys("issue", "li", "--role", "operator")
    rules = folder.access.read_text()
    spoiled = rules
    for right, wrong in (
        ('"robomesh/*/*/command/li.hall"', '"robomesh/*/*/command/*"'),
        ('"robomesh/*/*/stop"', '"robomesh/**/stop"'),
        ('"robomesh/hall/matrix-probe/joints"', '"robomesh/hall/*/joints"'),
    ):
        assert right in spoiled
        spoiled = spoiled.replace(right, wrong)
    key = "robomesh/hall/matrix-probe"
    by_hand = read_access(folder.access)["access_control"]
    by_hand["rules"].append(
        {
            "id": "by-hand",
            "permission": "allow",
            "flows": ["ingress"],
            "messages": ["put", "delete", "query"],
            "key_exprs": ["robomesh/hall/arm/joints", "robomesh/hall/arm/lease/request/li.hall"],
        }
    )
    by_hand["policies"].append({"subjects": ["mo.hall"], "rules": ["by-hand"]})
    changed = dict(read_access(folder.access)) | {"access_control": by_hand}
    for text, status, found in (
        (rules, 0, ["certificates tried: all as the table says"]),
        (
            spoiled,
            1,
            [
                f"WRONG: li.hall can ask {key}/command/nobody.hallx, and should not",
                f"WRONG: mo.hall can ask {key}/command/stop, and should not",
                f"WRONG: gateway.hall can publish {key}$*/joints, and should not",
                f"WRONG: started.hall can answer {key}$*/joints, and should not",
            ],
        ),
        (
            json.dumps(changed),
            1,
            [
                "WRONG: mo.hall can publish robomesh/hall/arm/joints, and should not",
                "WRONG: mo.hall can delete robomesh/hall/arm/joints, and should not",
                # A lease request would be granted, so the rules are compared instead of trying it.
                "allow mo.hall ingress query robomesh/hall/arm/lease/request/li.hall: not a rule",
            ],
        ),
    ):
        folder.access.write_text(text)
        with zenoh.open(router_config((endpoint,), (), folder.tls_of("router"), read_access(folder.access))):
            capsys.readouterr()
            assert main.run(["doctor", "--security", "--connect", endpoint]) == status
            printed = capsys.readouterr().out
            assert [line for line in found if line not in printed] == []


@pytest.mark.processes
def test_a_site_with_keys_runs_over_tls(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    site_keys.prepare(Folder(tmp_path / "keys"), "test", robots=[], border="open", routers=[])
    assert keys("issue", "mo", "--role", "monitor") == 0
    more = '[keys]\nfolder = "keys"\n'
    with running_site(tmp_path, robots="", more=more, services=["recorder"]) as site:
        router = site.router.replace("tcp/", "tls/")
        mo = str(tmp_path / "keys" / "people" / "mo.pem")

        def services():
            listed = robomesh("list", "--json", "--connect", router, "--keys", mo)
            assert listed.returncode == 0, listed.stderr
            return {row["service"] for row in json.loads(listed.stdout)["services"]}

        # The page is served before the router has given a new monitor all that is known.
        wait_until(lambda: {"router", "console", "recorder"} <= services())
