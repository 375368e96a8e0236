"""Names in the files of compose and systemd: commands, options, roles and site files exist."""

import re
import shlex
import tomllib
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from services.command_line.commands import COMMANDS, load
from services.site_file import site as site_file

ROOT = Path(__file__).parents[1]
COMPOSE = (ROOT / "compose.yaml", *sorted((ROOT / "deploy").glob("*/*.yaml")))
UNITS = sorted((ROOT / "deploy" / "systemd").glob("*.service"))
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]


def services(file):
    return YAML(typ="safe").load(file.read_text())["services"].items()


CONTAINERS = [
    pytest.param(file, service, id=f"{file.parent.name}-{file.stem}-{name}")
    for file in COMPOSE
    for name, service in services(file)
]


def check_words(words):
    name, *rest = words
    assert name in COMMANDS, f"robomesh {name} is no command"
    command = load(name)
    while getattr(command, "commands", None):
        command = command.commands[rest.pop(0)]
    known = {option for each in command.params for option in (*each.opts, *each.secondary_opts)}
    for word in rest:
        if word.startswith("--"):
            assert word in known, f"robomesh {name} has no {word}"
    return name


@pytest.mark.parametrize(("file", "service"), CONTAINERS)
def test_a_container_runs_a_command_that_there_is_in_the_image_of_its_role(file, service):
    command = check_words(service["command"])
    role = {"simulate": "simulator"}.get(command, command)
    assert service["image"] == f"robomesh-{role}"
    assert role in EXTRAS
    if "build" in service:
        assert service["build"]["args"] == {"ROLE": role}
    if "healthcheck" in service:
        shell, program, *words = service["healthcheck"]["test"]
        assert (shell, program) == ("CMD", "robomesh")
        assert check_words(words) == "alive"
        assert words[1].rpartition("/")[2] == role


@pytest.mark.parametrize(("file", "service"), CONTAINERS)
def test_a_container_has_no_rights_and_a_limit(file, service):
    assert service["read_only"] is True
    assert service["user"] == "10001"
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert service["mem_limit"]
    assert service["pids_limit"]


KEPT = {
    "gateway": lambda site: site.audit.folder,
    "recorder": lambda site: site.recorder.folder,
    "console": lambda site: site.define.folder,
    "watch": lambda site: site.watch.folder,
}


@pytest.mark.parametrize(
    ("file", "service"),
    [each for each in CONTAINERS if each.values[1]["command"][0] in KEPT],
)
def test_what_a_role_keeps_is_in_a_volume_that_is_there_in_the_image(file, service):
    mounts = dict(each.split(":", 1) for each in service["volumes"])
    (source,) = (each for each, target in mounts.items() if target.endswith("/site.toml:ro"))
    folder = str(
        KEPT[service["command"][0]](site_file.load(file.parent / source.replace("${SITE}", "shanghai")))
    )
    (volume,) = (each for each, target in mounts.items() if target == folder)
    assert volume in YAML(typ="safe").load(file.read_text())["volumes"]
    # Made there for the user of the image: a volume takes its owner from it.
    assert folder in re.search(r"mkdir -p (.*) && chown", (ROOT / "Dockerfile").read_text())[1].split()


@pytest.mark.parametrize(("file", "service"), CONTAINERS)
def test_what_a_container_of_ours_mounts_is_there(file, service):
    for volume in service["volumes"]:
        source = volume.partition(":")[0]
        if source.startswith("./") and "${SITE}" not in source and "/keys/" not in source:
            made_by_make_keys = source.endswith("/console")
            assert made_by_make_keys or (file.parent / source).exists(), source


def test_the_user_of_the_containers_is_that_of_the_image():
    assert re.search(r"^USER 10001$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_a_unit_runs_a_command_that_there_is_for_every_role(unit):
    (line,) = re.findall(r"^ExecStart=(.*)$", unit.read_text(), re.MULTILINE)
    program, *words = shlex.split(line)
    assert program == "/opt/robomesh/bin/robomesh"
    for role in (
        *("router", "gateway", "kinematics", "recorder", "player"),
        *("renderer", "console", "watch", "store"),
    ):
        check_words([role if word == "%i" else word for word in words])


@pytest.mark.parametrize(
    "file", sorted((ROOT / "deploy").rglob("site.toml")), ids=lambda file: file.parent.name
)
def test_a_site_file_of_ours_can_be_read(file):
    site = site_file.load(file)
    if file.parent.parent.name == "three-sites":
        assert site.site == file.parent.name
        assert site.keys.folder == file.parent / "keys"
