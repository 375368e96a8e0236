"""Generator of the library's shape files: `python -m robots.library.build_shapes`.

The files are committed. To change them, change this script and run it.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

from robots.library import pt_arm, puma_arm
from robots.library.parts import Piece, geometry_of
from robots.shapes.files.three_ds.write import write_3ds
from robots.shapes.files.vrml.write import write_vrml

LIBRARY = Path(__file__).parent


def _pt(size: float, height: float, length: float, tool: float) -> Mapping[str, Callable[[], list[Piece]]]:
    return {
        "base.wrl": lambda: pt_arm.base(size, height),
        "column.3ds": lambda: pt_arm.column(size),
        "upper_arm.wrl": lambda: pt_arm.upper_arm(size, length),
        "forearm.3ds": lambda: pt_arm.forearm(size, length),
        "wrist.wrl": lambda: pt_arm.wrist(size),
        "flange.3ds": lambda: pt_arm.flange(size, tool),
    }


# Sizes in mm are those of each robot's D-H rows.
ROBOTS: Mapping[str, Mapping[str, Callable[[], list[Piece]]]] = {
    "pt500": _pt(0.84, 300.0, 250.0, 100.0),
    "pt600": _pt(1.0, 350.0, 300.0, 120.0),
    "puma560": {
        "base.3ds": puma_arm.base,
        "column.wrl": puma_arm.column,
        "upper_arm.3ds": puma_arm.upper_arm,
        "forearm.wrl": puma_arm.forearm,
        "wrist.3ds": puma_arm.wrist,
        "wrist_cage.wrl": puma_arm.wrist_cage,
        "flange.3ds": puma_arm.flange,
    },
}


def shape_file(robot: str, name: str) -> bytes:
    """Return the content of one of the library's shape files."""
    geometry = geometry_of(ROBOTS[robot][name]())
    return write_vrml(geometry).encode() if name.endswith(".wrl") else write_3ds(geometry)


def main() -> None:
    """Write every shape file of the library."""
    for robot, files in ROBOTS.items():
        folder = LIBRARY / robot / "meshes"
        folder.mkdir(exist_ok=True)
        for name in files:
            (folder / name).write_bytes(shape_file(robot, name))
            print(f"{robot}/meshes/{name}")


if __name__ == "__main__":
    main()
