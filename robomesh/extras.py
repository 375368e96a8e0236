"""The extras of this distribution, which an installation may lack, and how to install them."""

from importlib.util import find_spec
from pathlib import Path

# Module -> extra that brings it.
EXTRAS = {
    "argon2": "keys",
    "av": "renderer",
    "cascadio": "step",
    "coal": "robots",
    "collada": "meshes",
    "cryptography": "keys",
    "cv2": "renderer",
    "ezdxf": "dxf",
    "fast_simplification": "meshes",
    "foxglove": "foxglove",
    "matplotlib": "plots",
    "moderngl": "renderer",
    "pinocchio": "robots",
    "rerun": "rerun",
    "rosbags": "ros2",
    "ruckig": "simulator",
    "starlette": "console",
    "tomlkit": "console",
    "trimesh": "robots",
    "uvicorn": "console",
    "websockets": "console",
}
# What `./dev add` brings in a checkout; it has the other extras.
ADDED_IN_CHECKOUT = {"dxf", "foxglove", "plots", "rerun", "ros2", "step"}
_CHECKOUT = (Path(__file__).resolve().parents[1] / "dev").is_file()


def is_missing(module: str) -> bool:
    """Return whether a module is not installed."""
    return find_spec(module) is None


def missing(module: str, extra: str = "", distribution: str = "robomesh") -> str:
    """Return a sentence on a missing module, with the command that installs it.

    Args:
        extra: The extra that brings it; empty: as in the table.
        distribution: The distribution that has the extra; another one than robomesh may need none.
    """
    if distribution == "robomesh":
        extra = extra or EXTRAS[module]
    command = install_command(extra, distribution)
    return f"this needs the package {module}, which is not installed: {command}"


def install_command(extra: str, distribution: str = "robomesh") -> str:
    """Return the command that installs an extra of a distribution; empty: the distribution."""
    if distribution != "robomesh":
        return f"pip install '{distribution}[{extra}]'" if extra else f"pip install {distribution}"
    if _CHECKOUT and extra in ADDED_IN_CHECKOUT:
        return f"./dev add {extra}"
    return f"pip install 'robomesh[{extra}]'"
