"""Print the rooms: packages with their modules and imports; a circle of rooms is an error.

    ./dev run python tests/check_rooms.py [--json]

A room is a folder with an `__init__.py`. Imports for type checking only do not count.
"""

import argparse
import json
import sys
from collections import defaultdict
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp

ROOT = Path(__file__).parents[1]
PACKAGES = ("robomesh", "robots", "renderer", "protocol_gateway", "controllers", "services")
MOST_MODULES = 12
MOST_ROOMS = 20


def rooms() -> tuple[dict[str, int], dict[str, set[str]]]:
    """Return the number of modules of each room, and the rooms that each one imports."""
    graph = grimp.build_graph(*PACKAGES, exclude_type_checking_imports=True, cache_dir=None)
    found = {
        each: each if (ROOT / each.replace(".", "/")).is_dir() else each.rpartition(".")[0]
        for each in graph.modules
    }
    modules: dict[str, int] = defaultdict(int)
    imports: dict[str, set[str]] = {}
    for module, room in found.items():
        modules[room] += module != room
        imports.setdefault(room, set()).update(
            found[each] for each in graph.find_modules_directly_imported_by(module) if found[each] != room
        )
    return modules, imports


def circles(imports: dict[str, set[str]]) -> list[list[str]]:
    """Return the pairs of rooms that import each other, or else one longer circle of rooms."""
    pairs = [[a, b] for a in sorted(imports) for b in sorted(imports[a]) if a < b and a in imports[b]]
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        return pairs or [error.args[1]]
    return []


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    modules, imports = rooms()
    imported_by = {room: {each for each in imports if room in imports[each]} for room in modules}
    found = circles(imports)
    if arguments.json:
        rows = {
            room: {"modules": modules[room], "imports": sorted(imports[room])} for room in sorted(modules)
        }
        print(json.dumps({"rooms": rows, "circles": found}))
    else:
        for room in sorted(modules):
            others = len(imports[room] | imported_by[room])
            wide = " wide" if modules[room] > MOST_MODULES or others > MOST_ROOMS else ""
            print(
                f"{room:45} {modules[room]:3} modules, imports {len(imports[room]):3}, "
                f"imported by {len(imported_by[room]):3}{wide}"
            )
        pairs = sum(map(len, imports.values()))
        print(f"{len(modules)} rooms, {sum(modules.values())} modules, {pairs} arrows, {len(found)} circles")
    if found:
        sys.exit("\n".join("rooms in a circle: " + " <-> ".join(each) for each in found))


if __name__ == "__main__":
    main()
