"""Site files: what is read, and what is said of a wrong one."""

from pathlib import Path

import pytest

from robots.errors import DescriptionError
from services import site
from services.errors import ListenError, SiteFileError
from services.listen import check_reach, split_address

ROBOT = '[[robot]]\nname = "arm"\nmodel = "pt600"\n'


def load(folder: Path, text: str) -> site.Site:
    path = folder / "site.toml"
    path.write_text(text, encoding="utf-8")
    return site.load(path)


def test_without_a_file_the_demo_runs():
    demo = site.load(None)
    assert (demo.site, [robot.name for robot in demo.robot]) == ("demo", ["pt600"])
    assert demo.robot[0].simulated
    assert demo.robot[0].can_be_stopped


def test_paths_are_taken_from_the_files_own_folder(tmp_path):
    found = load(tmp_path, 'site = "hall"\n[recorder]\nfolder = "tapes"\n')
    assert found.recorder.folder == tmp_path / "tapes"
    assert found.audit.folder == tmp_path / "audit"


def test_a_controller_of_the_plant_is_read_only_until_its_stop_is_proven(tmp_path):
    text = f'site = "hall"\n{ROBOT}controller = "tcp://10.0.0.7:5400"\n'
    assert not load(tmp_path, text).robot[0].can_be_stopped
    assert load(tmp_path, text + "stop_proven = true\n").robot[0].can_be_stopped


def test_codes_are_numbers(tmp_path):
    found = load(tmp_path, f'site = "hall"\n{ROBOT}codes = {{ 2 = "ABSOLUTE.DEG", 101 = "COMMAND:home" }}\n')
    assert found.robot[0].codes == {2: "ABSOLUTE.DEG", 101: "COMMAND:home"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "site is missing"),
        ('site = "Hall"', "site = 'Hall': site 'Hall' cannot be used: lower-case"),
        ('site = "hall"\nrobots = 1', "robots is not a key"),
        (f'site = "hall"\n{ROBOT}{ROBOT}', "two robots are named 'arm'"),
        (f'site = "hall"\n{ROBOT}controller = "10.0.0.7"', "robot.arm.controller = '10.0.0.7': should be"),
        (f'site = "hall"\n{ROBOT}stale_after_s = 0', "robot.arm.stale_after_s = 0"),
        (f'site = "hall"\n{ROBOT}check = "require"', "would do nothing yet"),
        (f'site = "hall"\n{ROBOT}stop_proven = "yes"', "robot.arm.stop_proven = 'yes'"),
        (f'site = "hall"\n{ROBOT}accept_unknown = ["link"]', "robot.arm.accept_unknown"),
        (
            'site = "hall"\n[renderer]\nsize = [333, 200]',
            "renderer.size.0 = 333: Input should be a multiple of 2",
        ),
        ('site = "hall"\n[renderer]\nfps = nan', "renderer.fps"),
        ("site = ", "not TOML"),
    ],
)
def test_what_is_wrong_is_named_with_what_would_be_right(tmp_path, text, words):
    with pytest.raises(SiteFileError) as raised:
        load(tmp_path, text)
    assert words in str(raised.value)
    assert str(tmp_path / "site.toml") in str(raised.value)


def test_an_unknown_model_is_refused_before_anything_starts(tmp_path):
    with pytest.raises(DescriptionError, match=r"pt60.*did you mean"):
        load(tmp_path, 'site = "hall"\n[[robot]]\nname = "arm"\nmodel = "pt60"\n')


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(SiteFileError, match=r"none\.toml: cannot be read"):
        site.load(tmp_path / "none.toml")


@pytest.mark.parametrize("text", ["", "host", ":1", "host:", "host:x", "host:70000"])
def test_what_is_no_address_is_refused(text):
    with pytest.raises(ListenError, match="HOST:PORT is right"):
        split_address(text)


def test_beyond_loopback_needs_tls_or_a_word_taken_for_it():
    assert check_reach("it", "127.0.0.1", secured=False, insecure=False) is None
    assert check_reach("it", "::1", secured=False, insecure=False) is None
    assert check_reach("it", "0.0.0.0", secured=True, insecure=False) is None
    assert "anybody who can reach it" in (check_reach("it", "0.0.0.0", secured=False, insecure=True) or "")
    for host in ("0.0.0.0", "10.0.0.7", "plant.example"):
        with pytest.raises(ListenError, match="insecure = true"):
            check_reach("it", host, secured=False, insecure=False)
