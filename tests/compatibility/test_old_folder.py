"""The folder of a site of an earlier version starts under this version, and nothing is lost."""

import json
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest

from tests.compatibility.earlier import PASSWORD, unpack
from tests.ports import free_port
from tests.site import lean, robomesh, running_file, wait_until

pytestmark = [pytest.mark.long, pytest.mark.processes]

LATER = 4102444800.0  # 2100-01-01: the alarm stays shelved, whenever the test runs


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return unpack("site-2026-11-22.tar.xz", tmp_path_factory.mktemp("earlier") / "plant")


@pytest.fixture(scope="module")
def audit_before(folder):
    return {path.name: path.read_text().splitlines() for path in (folder / "audit" / "plant").glob("*.jsonl")}


@pytest.fixture(scope="module")
def began_s():
    return time.time()


@pytest.fixture(scope="module")
def site(folder, audit_before, began_s):
    router, console = f"tls/127.0.0.1:{free_port()}", f"127.0.0.1:{free_port()}"
    file = folder / "site.toml"
    text = file.read_text().replace("tls/127.0.0.1:27447", router).replace("127.0.0.1:28080", console)
    file.write_text(text)
    alarms = folder / "watch" / "plant.json"
    kept = json.loads(alarms.read_text())
    for alarm in kept["alarms"]:
        if alarm["shelved_until"]:
            alarm["shelved_until"] = LATER
    alarms.write_text(json.dumps(kept))
    with running_file(file, router, console, **lean(["recorder", "watch"])) as running:
        yield running


@pytest.fixture
def command(site):
    def run(*arguments, person="li", timeout_s=60.0):
        keys = site.folder / "keys" / "people" / f"{person}.pem"
        return site.command(*arguments, "--keys", str(keys), timeout_s=timeout_s)

    return run


def printed(done):
    """Return the JSON that a command printed, one object a line."""
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_its_robots_run_and_so_does_the_one_that_was_started_from_the_page(command):
    def links():
        (found,) = printed(command("list", "--json"))
        return {robot["robot"]: robot["link"] for robot in found["robots"]}

    wait_until(lambda: links() == {"arm": "up", "mine": "up"})
    assert command("send", "mine", "home").returncode == 0


def test_its_latched_stop_is_latched_until_the_holder_resets_it(command):
    refused = command("send", "arm", "home", "--json")
    assert refused.returncode == 1
    assert "stop 1 is latched" in refused.stdout
    assert command("send", "arm", "reset").returncode == 0
    # The controller reports a moment later that it is no longer stopped.
    wait_until(lambda: command("send", "arm", "home").returncode == 0)


def test_its_audit_log_goes_on_and_is_unbroken(folder, audit_before, command, site):
    for name, before in audit_before.items():
        after = (folder / "audit" / "plant" / name).read_text().splitlines()
        assert after[: len(before)] == before
        assert len(after) > len(before)
        checked = robomesh("audit", "verify", str(folder / "audit" / "plant" / name), "--json")
        assert json.loads(checked.stdout)["ok"], checked.stdout
    entries = printed(command("audit", "list", "plant/arm", "--json"))
    assert [entry["number"] for entry in entries[:2]] == [1, 2]
    assert {"ACQUIRE", "HOME", "MOVE_ABSOLUTE", "STOP"} <= {entry["request"] for entry in entries}


def test_its_alarms_are_there_as_they_were(command, began_s):
    (listed,) = printed(command("alarms", "list", "--json"))
    alarms = {alarm["id"]: alarm for alarm in listed["alarms"]}
    shelved = alarms["arm:link"]
    assert (shelved["state"], shelved["by"], shelved["reason"]) == ("SHELVED", "li.plant", "a fixture")
    # On a busy machine the controller's link may be silent for a while, which raises the alarm again.
    assert shelved["since"] == pytest.approx(1795474796.54, abs=0.01) or shelved["since"] > began_s


def test_its_recording_is_listed_counted_and_exported(command, tmp_path, site):
    found = printed(command("recordings", "list", "--json"))
    recordings = found[0].get("recordings", found)
    assert [(each["robot"], each["name"]) for each in recordings] == [("arm", "trial")]
    (info,) = printed(command("recordings", "info", "trial", "--json"))
    counts = {topic["topic"].rpartition("/")[2]: topic["messages"] for topic in info["topics"]}
    assert counts["joints"] == 821
    table = tmp_path / "trial.csv"
    assert command("recordings", "export", "trial", str(table)).returncode == 0
    assert len(table.read_text().splitlines()) == counts["joints"] + 1


def test_its_accounts_sign_in_and_a_disabled_one_does_not(site):
    address = site.console.rstrip("/")

    def sign_in(name, password=PASSWORD):
        body = json.dumps({"name": name, "password": password}).encode()
        headers = {"Origin": address, "Content-Type": "application/json"}
        try:
            with urllib.request.urlopen(
                urllib.request.Request(f"{address}/account/sign-in", body, headers), timeout=60.0
            ) as answer:
                return answer.status
        except urllib.error.HTTPError as error:
            with error:
                return error.code

    assert sign_in("li") == 200
    assert sign_in("chen") == 200
    assert sign_in("li", "three legs in a hall") in (401, 403)
    assert sign_in("zhao") in (401, 403)


def test_its_certificates_are_valid_and_keep_their_rights(site, command):
    listed = printed(robomesh("keys", "list", "--folder", str(site.folder / "keys"), "--json"))
    names = {entry["name"]: entry["role"] for entry in listed}
    assert names["li.plant"] == "operator"
    assert names["zhao.plant"] == "monitor"
    assert command("send", "arm", "home", person="zhao").returncode != 0


def test_its_defined_robot_can_be_opened(site):
    saved = Path(site.folder / "robots" / "mine" / "robot.toml")
    checked = robomesh("robot", "check", str(saved), "--json")
    assert checked.returncode in (0, 1), checked.stderr
    assert json.loads(checked.stdout)["problems"] == []
