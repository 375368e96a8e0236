"""Import of a robot.toml: all files that its shapes consist of are copied."""

from pathlib import Path

from robots.descriptions.importing import import_robot

ROBOT = """
name = "one"
[base]
mesh = "{base}"
[[joint]]
name = "waist"
a = 0.0
alpha = 0.0
d = 0.0
limits = [-1.0, 1.0]
max_speed = 1.0
max_acceleration = 1.0
max_jerk = 1.0
link = {{ mesh = "{link}" }}
"""
VRML = "#VRML V2.0 utf8\n"
BOX = f"{VRML}Shape {{ geometry Box {{ }} }}"
OBJ = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n"
MTL = "newmtl red\nKd 1 0 0\nmap_Kd wood.png\n"


def write(folder: Path, files: dict[str, str]) -> None:
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)


def test_files_that_a_shape_names_are_copied_with_it(tmp_path: Path) -> None:
    files = {
        "meshes/base.wrl": f'{VRML}Inline {{ url "parts/a.wrl" }} EXTERNPROTO P [ ] "../lib.wrl#P" P {{ }}',
        "meshes/parts/a.wrl": f'{VRML}Inline {{ url "b.wrl" }}',
        "meshes/parts/b.wrl": BOX,
        "lib.wrl": f"{VRML}PROTO P [ ] {{ Shape {{ geometry Sphere {{ }} }} }}",
        "arm/a.obj": OBJ,
        "arm/a.mtl": MTL,
        "arm/wood.png": "a picture",
    }
    write(tmp_path, files | {"robot.toml": ROBOT.format(base="meshes/base.wrl", link="arm/a.obj")})
    robot = import_robot(str(tmp_path / "robot.toml"))
    assert robot.files == {name: content.encode() for name, content in files.items()}
    assert robot.notes == ()


def test_files_that_cannot_be_copied_are_reported(tmp_path: Path) -> None:
    write(
        tmp_path,
        {
            "out/part.wrl": BOX,
            "out/base.wrl": f'{VRML}Inline {{ url "part.wrl" }} Inline {{ url "none.wrl" }}',
            "robot/a.wrl": f'{VRML}Inline {{ url "../out/part.wrl" }}',
            "robot/meshes/part.wrl": f"{VRML}Shape {{ geometry Cone {{ }} }}",
            "robot/robot.toml": ROBOT.format(base="../out/base.wrl", link="a.wrl"),
        },
    )
    robot = import_robot(str(tmp_path / "robot" / "robot.toml"))
    # A shape outside the folder is copied into it, together with the files that it names.
    assert sorted(robot.files) == ["a.wrl", "meshes/base.wrl", "meshes/part.wrl"]
    assert robot.values["base"]["mesh"] == "meshes/base.wrl"
    assert robot.notes == (
        "meshes/base.wrl names 'none.wrl', which does not exist",
        "a.wrl names '../out/part.wrl', which is outside of the robot's folder; it is not copied",
    )


def test_two_files_of_one_name_are_reported(tmp_path: Path) -> None:
    inline = f'{VRML}Inline {{ url "part.wrl" }}'
    write(
        tmp_path,
        {
            "one/base.wrl": inline,
            "one/part.wrl": BOX,
            "two/arm.wrl": inline,
            "two/part.wrl": f"{VRML}Shape {{ geometry Cone {{ }} }}",
            "robot/robot.toml": ROBOT.format(base="../one/base.wrl", link="../two/arm.wrl"),
        },
    )
    (note,) = import_robot(str(tmp_path / "robot" / "robot.toml")).notes
    assert note == "meshes/arm.wrl names 'part.wrl', and so does another mesh for another file; one is copied"
