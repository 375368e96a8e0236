"""Site files: values, and the errors of invalid ones."""

from math import radians
from pathlib import Path

import pytest

from robomesh.errors import ListenError
from robomesh.listen_address import check_reach, split_address
from robots.descriptions import description
from robots.kinematics.joints import joints_of
from services.cells.descriptions import cells_of
from services.errors import SiteFileError
from services.site_file import site
from services.site_file.started_robots import read_started, robot_to_start, write_started
from services.site_file.tables.router import OTHER_PARTS, RoutedSite, read_routed
from services.site_file.validation_errors import problem_text
from tests.robots.boxes import one_joint_arm

ROBOT = '[[robot]]\nname = "arm"\nmodel = "pt600"\n'


def load(folder: Path, text: str) -> site.Site:
    path = folder / "site.toml"
    path.write_text(text, encoding="utf-8")
    return site.load(path)


def test_without_a_file_the_demo_runs():
    demo = site.load(None)
    assert (demo.site, [robot.name for robot in demo.robot]) == ("demo", ["pt600"])
    assert demo.robot[0].simulated
    assert demo.robot[0].proof_of_stop


def test_paths_are_taken_from_the_files_own_folder(tmp_path):
    found = load(tmp_path, 'site = "hall"\n[recorder]\nfolder = "tapes"\n')
    assert found.recorder.folder == tmp_path / "tapes"
    assert found.audit.folder == tmp_path / "audit"


def test_the_view_recorded_by_default_is_rendered(tmp_path):
    assert load(tmp_path, 'site = "hall"\n').recorded_views == ("free",)
    assert load(tmp_path, 'site = "hall"\n[renderer]\nviews = ["top"]\n').recorded_views == ("top",)
    assert load(tmp_path, 'site = "hall"\n[recorder]\nviews = ["far"]\n').recorded_views == ("far",)


def test_a_controller_of_the_plant_is_read_only_until_its_stop_is_proven(tmp_path):
    text = f'site = "hall"\n{ROBOT}controller = "tcp://10.0.0.7:5400"\n'
    assert not load(tmp_path, text).robot[0].proof_of_stop
    assert load(tmp_path, text + "stop_proven = true\n").robot[0].proof_of_stop


def test_codes_are_numbers(tmp_path):
    found = load(tmp_path, f'site = "hall"\n{ROBOT}codes = {{ 2 = "ABSOLUTE.DEG", 101 = "COMMAND:home" }}\n')
    assert found.robot[0].codes == {2: "ABSOLUTE.DEG", 101: "COMMAND:home"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "site is missing"),
        ('site = "Hall"', "site = 'Hall': site 'Hall' cannot be used: lower-case"),
        ('site = "define"', "the console has a page with that name, #/define"),
        ('site = "hall"\nrobots = 1', "robots is not a key"),
        (f'site = "hall"\n{ROBOT}{ROBOT}', "two robots are named 'arm'"),
        (
            'site = "hall"\n[[robot]]\nname = "matrix-probe"\nmodel = "pt600"',
            "reserved for testing rights",
        ),
        (
            'site = "hall"\n[[robot]]\nname = "replay-1"\nmodel = "pt600"',
            "reserved for replays",
        ),
        ('site = "hall"\n[quotas]\nviews = 0', "quotas.views = 0: should be greater than or equal to 1"),
        (
            'site = "hall"\n[recorder]\nviews = ["side"]',
            "views = 'side': the renderer has no such view; it has front, top, left, free, close, far",
        ),
        (
            f'site = "hall"\n{ROBOT}modell = "pt600"',
            "robot.arm.modell is not a key that a site file has: is model meant?",
        ),
        (
            'site = "hall"\n[console]\nlisten = 8080',
            'console.listen = 8080: should be text in quotes, as in "8080"',
        ),
        (
            'site = "hall"\n[[robot]]\nname = "arm"\nmodel = "pt9"',
            "robot arm: model = 'pt9': pt9: no such robot",
        ),
        (f'site = "hall"\n{ROBOT}controller = "10.0.0.7"', "robot.arm.controller = '10.0.0.7': should be"),
        (f'site = "hall"\n{ROBOT}controller = "tcp://10.0.0.7:0"', "should be 'simulated' or tcp://"),
        (f'site = "hall"\n{ROBOT}codes = {{ x = "TIME" }}', "a code is a number"),
        (f'site = "hall"\n{ROBOT}codes = {{ 1 = "COMMAND:dance" }}', "is neither a type"),
        ('site = "hall"\n[router]\nlisten = []', "router.listen = []"),
        (f'site = "hall"\n{ROBOT}stale_after_s = 0', "robot.arm.stale_after_s = 0"),
        (f'site = "hall"\n{ROBOT}stop_proven = "yes"', "robot.arm.stop_proven = 'yes'"),
        (f'site = "hall"\n{ROBOT}accept_unknown = ["link"]', "robot.arm.accept_unknown"),
        (
            f'site = "hall"\n{ROBOT}recover = ["power"]',
            "robot.arm.recover: 'power' is none of 'unlock_protective_stop', 'close_safety_popup'",
        ),
        (f'site = "hall"\n{ROBOT}recover = 7', "robot.arm.recover = 7: 7 is none of"),
        (
            'site = "hall"\n[renderer]\nsize = [333, 200]',
            "renderer.size.0 = 333: should be a multiple of 2",
        ),
        ('site = "hall"\n[renderer]\nfps = nan', "renderer.fps"),
        ("site = ", "not TOML"),
    ],
)
def test_an_invalid_value_is_named_with_what_would_be_right(tmp_path, text, words):
    with pytest.raises(SiteFileError) as raised:
        load(tmp_path, text)
    assert words in str(raised.value)
    assert str(tmp_path / "site.toml") in str(raised.value)


LEGACY = 'legacy_clients = {{ listen = "127.0.0.1:5401"{} }}\n'


def test_old_client_programs_attach_where_the_file_says(tmp_path):
    commanders = ', commanders = ["10.0.0.8", { address = "::ffff:10.0.0.9", operator = "li" }], most = 64'
    found = load(tmp_path, f'site = "hall"\n{ROBOT}{LEGACY.format(commanders)}').robot[0].legacy_clients
    assert (found.listen, found.most) == ("127.0.0.1:5401", 64)
    assert {each.address: each.name for each in found.commanders} == {
        "10.0.0.8": "10.0.0.8",
        "10.0.0.9": "li",
    }
    assert load(tmp_path, f'site = "hall"\n{ROBOT}').robot[0].legacy_clients is None


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (", most = 0", "legacy_clients.most = 0: should be greater than or equal to 1"),
        (", most = 5000", "legacy_clients.most = 5000: should be less than or equal to 1000"),
        (', commanders = ["li"]', "'li': should be an IP address, as in 10.0.0.9"),
        (', commanders = [{ address = "10.0.0.9", operator = "a/b" }]', "operator = 'a/b'"),
        (
            ', commanders = [{ address = "10.0.0.9", operator = "li" }, "10.0.0.9"]',
            "10.0.0.9 commands as li and as 10.0.0.9: give it one name",
        ),
        (", port = 5401", "legacy_clients.port is not a key"),
    ],
)
def test_wrong_settings_of_old_client_programs_are_named(tmp_path, more, words):
    with pytest.raises(SiteFileError) as raised:
        load(tmp_path, f'site = "hall"\n{ROBOT}{LEGACY.format(more)}')
    assert words in str(raised.value)
    assert "robot.arm.legacy_clients" in str(raised.value)


def test_remote_legacy_clients_need_insecure(tmp_path):
    text = f'site = "hall"\n{ROBOT}legacy_clients = {{ listen = "0.0.0.0:5401"'
    with pytest.raises(SiteFileError, match="insecure = true"):
        load(tmp_path, text + " }\n")
    found = load(tmp_path, text + ", insecure = true }\n").robot[0].legacy_clients
    assert "any machine that reaches it" in (found.warning("robot arm: legacy_clients") or "")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[console]\nlisten = "0.0.0.0:8080"\n', "the console would listen on 0.0.0.0"),
        (
            '[console]\nlisten = "0.0.0.0:8080"\ntls = { certificate = "a", key = "b" }\n',
            "without accounts: give",
        ),
        ('[router]\nlisten = ["tcp/0.0.0.0:7447"]\n', "the router (tcp/0.0.0.0:7447) would listen on"),
    ],
)
def test_an_insecure_address_is_refused_before_anything_starts(tmp_path, text, words):
    with pytest.raises(SiteFileError, match="insecure = true") as raised:
        load(tmp_path, f'site = "hall"\n{text}')
    assert str(raised.value).startswith(f"{tmp_path / 'site.toml'}: ")
    assert words in str(raised.value)
    assert "\n" not in str(raised.value)
    assert load(tmp_path, f'site = "hall"\n{text}insecure = true\n').site == "hall"


ARM_2 = ROBOT.replace("arm", "arm-2")
ATTACH = LEGACY.format("")
PLANT = 'controller = "tcp://10.0.0.7:5400"\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (ROBOT + ATTACH + ARM_2 + ATTACH, "robot arm's legacy_clients and to robot arm-2's legacy_clients"),
        (ROBOT + PLANT + ARM_2 + PLANT, "robot arm's controller and to robot arm-2's controller"),
        (ROBOT + ATTACH + ARM_2 + 'controller = "tcp://localhost:5401"\n', "robot arm-2's controller"),
        (ROBOT + ATTACH + '[console]\nlisten = "0.0.0.0:5401"\n', "the console and to robot arm's"),
        (ROBOT + ATTACH + '[router]\nlisten = ["tcp/127.0.0.1:5401#so_sndbuf=1"]\n', "the router and to"),
        ('[console]\nlisten = "127.0.0.1:7447"\n', "the router and to the console"),
        ('[console]\nlisten = "8080"\n', "'8080' is not an address"),
    ],
)
def test_an_address_that_is_given_twice_is_refused(tmp_path, text, words):
    with pytest.raises(SiteFileError) as raised:
        load(tmp_path, f'site = "hall"\n{text}')
    assert words in str(raised.value)
    assert str(raised.value).startswith(f"{tmp_path / 'site.toml'}: ")


def test_addresses_that_only_look_alike_are_taken(tmp_path):
    text = f"""site = "hall"
{ROBOT}controller = "tcp://10.0.0.7:5401"
{ATTACH}
{ARM_2}legacy_clients = {{ listen = "127.0.0.1:0" }}
[[robot]]
name = "arm-3"
model = "pt600"
legacy_clients = {{ listen = "127.0.0.1:0" }}
[router]
listen = ["tcp/127.0.0.1:7447", "tcp/[::1]:7447", "quic/127.0.0.1:5401"]
"""
    assert len(load(tmp_path, text).robot) == 3


def test_an_unknown_model_is_refused_before_anything_starts(tmp_path):
    with pytest.raises(SiteFileError, match=r"robot arm: model = .pt60.*did you mean"):
        load(tmp_path, 'site = "hall"\n[[robot]]\nname = "arm"\nmodel = "pt60"\n')


def test_limits_of_a_urdfs_joints_can_be_stated(tmp_path):
    one_joint_arm(tmp_path, 'lower="-180" upper="180" velocity="180"')
    text = 'site = "hall"\n[[robot]]\nname = "arm"\nmodel = "arm.urdf"\n'
    stated = load(tmp_path, f"{text}limits = {{ j1 = [-90, 90] }}\nmax_speed = {{ j1 = 45.0 }}\n")
    joints = joints_of(description.load(stated.robot[0].described))
    assert (joints.doubts, joints.upper[0], joints.max_speed[0]) == ({}, radians(90), radians(45))
    assert cells_of(stated)["arm"].robots[0].model == stated.robot[0].described
    with pytest.raises(SiteFileError, match=r"robot arm: .*joint 'j2': the URDF has no such movable joint"):
        load(tmp_path, f"{text}max_speed = {{ j2 = 45.0 }}\n")


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(SiteFileError, match=r"none\.toml: cannot be read"):
        site.load(tmp_path / "none.toml")


@pytest.mark.parametrize("text", ["", "host", ":1", "host:", "host:x", "host:70000"])
def test_an_invalid_address_is_refused(text):
    with pytest.raises(ListenError, match="must be HOST:PORT"):
        split_address(text)


def test_beyond_loopback_needs_tls_or_insecure():
    assert check_reach("it", "127.0.0.1", secured=False, insecure=False) is None
    assert check_reach("it", "::1", secured=False, insecure=False) is None
    assert check_reach("it", "0.0.0.0", secured=True, insecure=False) is None
    assert "any machine that reaches it" in (check_reach("it", "0.0.0.0", secured=False, insecure=True) or "")
    for host in ("0.0.0.0", "10.0.0.7", "plant.example"):
        with pytest.raises(ListenError, match="insecure = true"):
            check_reach("it", host, secured=False, insecure=False)


# ------------------------------------------------------------------- started robots


def started(folder: Path, text: str) -> tuple[site.Robot, ...]:
    found = load(folder, f'site = "hall"\n{ROBOT}')
    (folder / "robots").mkdir(exist_ok=True)
    (folder / "robots" / "started.toml").write_text(text, encoding="utf-8")
    return read_started(found)


def test_robots_that_were_started_are_read_with_paths_from_their_own_folder(tmp_path):
    text = 'site = "hall"\n[[robot]]\nname = "mine"\nmodel = "mine/robot.toml"\n'
    (robot,) = started(tmp_path, text)
    assert (robot.name, robot.model) == ("mine", f"{tmp_path}/robots/mine/robot.toml")
    assert robot.simulated


def test_started_robots_are_read_back(tmp_path):
    hall = load(tmp_path, f'site = "hall"\n{ROBOT}')
    assert read_started(hall) == ()
    saved = tmp_path / "robots" / "mine"
    saved.mkdir(parents=True)
    (saved / "robot.toml").write_text("")
    both = (robot_to_start(hall, "mine"), robot_to_start(hall, "pt500"))
    write_started(hall, both)
    found = read_started(hall)
    assert [(robot.name, robot.model) for robot in found] == [
        ("mine", f"{saved}/robot.toml"),
        ("pt500", "pt500"),
    ]
    write_started(hall, found)
    assert read_started(hall) == found
    write_started(hall, ())
    assert read_started(hall) == ()
    assert sorted(path.name for path in (tmp_path / "robots").iterdir()) == ["mine", "started.toml"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("site = [", "not TOML"),
        ("", "site: Field required"),
        ('site = "other"', "should be 'hall'"),
        (
            'site = "hall"\n[[robot]]\nname = "arm"\nmodel = "pt500"',
            "site file has a robot with that name",
        ),
        ('site = "hall"\n[[robot]]\nname = "b"', "robot.0.model: Field required"),
        (
            'site = "hall"\n[[robot]]\nname = "b"\nmodel = "pt500"\ncontroller = "tcp://10.0.0.7:5400"',
            "only simulated robots",
        ),
    ],
)
def test_an_invalid_list_of_started_robots_is_reported(tmp_path, text, words):
    with pytest.raises(SiteFileError, match=r"started\.toml") as caught:
        started(tmp_path, text)
    assert words in str(caught.value)


def test_a_router_reads_the_same_values_as_other_services(tmp_path):
    path = tmp_path / "site.toml"
    path.write_text(
        'site = "plant"\n[router]\nlisten = ["tcp/127.0.0.1:7450"]\naccess = "rules.json5"\n'
        'connect = ["tcp/127.0.0.2:7447"]\n[keys]\nfolder = "keys"\n[metrics]\nlisten = "127.0.0.1:9101"\n'
        '[[robot]]\nname = "arm"\nmodel = "pt600"\n'
    )
    read, whole = read_routed(path), site.load(path)
    assert read is not None
    assert (read.site, read.router, read.keys, read.metrics) == (
        whole.site,
        whole.router,
        whole.keys,
        whole.metrics,
    )
    assert set(site.Site.model_fields) == set(RoutedSite.model_fields) | OTHER_PARTS


@pytest.mark.parametrize("more", ['[rooter]\nlisten = ["tcp/127.0.0.1:7450"]', "[router]\nlisten = 3", "[[["])
def test_read_routed_leaves_errors_to_load(tmp_path, more):
    path = tmp_path / "site.toml"
    path.write_text(f'site = "plant"\n{more}\n')
    assert read_routed(path) is None
    with pytest.raises(SiteFileError):
        site.load(path)


def test_the_text_of_a_models_own_error_does_not_depend_on_pydantics_wording():
    own = {"type": "value_error", "msg": "Wrong: 7", "ctx": {"error": ValueError("should be 8")}}
    assert problem_text(own) == "should be 8"
    assert problem_text({"type": "int_type", "msg": "Input should be an integer"}) == "should be an integer"
