"""Rooms of the page: a folder of `web/src` imports only from the layers below its own, and stays small."""

import re
from collections import Counter, defaultdict
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path, PurePosixPath

SOURCE = Path(__file__).parents[1] / "web" / "src"
# From the top; folders of one layer do not import each other, nor do features.
LAYERS = (
    ("app",),
    ("features",),
    ("panels", "scene", "video"),
    ("ui",),
    ("mesh/services",),
    ("mesh/control",),
    ("mesh/state",),
    ("mesh/console",),
    ("i18n",),
    ("gen",),
)
MOST_MODULES = 12
IMPORT = re.compile(r'\b(?:from |import |import\(|URL\()"(\.[^"]+)"')


def home(path):
    """Return the layer of a module, counted from the bottom, and its part of that layer."""
    for level, folders in enumerate(reversed(LAYERS)):
        for folder in folders:
            if path.is_relative_to(folder):
                return level, path.parts[1] if folder == "features" else folder
    raise AssertionError(f"{path} is in no layer")


@cache
def imports():
    """Return the modules that each module imports, as paths below `web/src`."""
    found = {}
    for file in SOURCE.rglob("*.ts*"):
        if "gen" in file.relative_to(SOURCE).parts:
            continue
        names = IMPORT.findall(file.read_text("utf-8"))
        found[PurePosixPath(file.relative_to(SOURCE).as_posix())] = {
            PurePosixPath((file.parent / name).resolve().relative_to(SOURCE).as_posix()) for name in names
        }
    return found


def test_imports_go_down_only():
    wrong = [
        f"{module} imports {other}"
        for module, others in imports().items()
        for other in others
        if home(other)[0] > home(module)[0]
        or (home(other)[0] == home(module)[0] and home(other)[1] != home(module)[1])
    ]
    assert wrong == []


def test_no_rooms_import_each_other_in_a_circle():
    rooms = defaultdict(set)
    for module, others in imports().items():
        rooms[module.parent] |= {other.parent for other in others} - {module.parent}
    TopologicalSorter(rooms).prepare()


def test_a_room_has_few_modules():
    count = Counter(module.parent for module in imports())
    assert count
    assert {str(room): many for room, many in count.items() if many > MOST_MODULES} == {}
