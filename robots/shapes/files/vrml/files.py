"""The files of a VRML scene: the main file, and those that it names by Inline and EXTERNPROTO."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

from robots.schema.errors import ShapeError
from robots.shapes.files.vrml.parser import Proto, Scene, parse_vrml
from robots.shapes.files.vrml.source import Count, Source, load
from robots.shapes.polygons import Effort

_MOST_FILES = 2000


@dataclass
class Files:
    """The files of a scene; each is read once.

    Attributes:
        within: Only files below this folder are read, others count as missing; None: no restriction.
        scenes: The files that have been read, by path.
        missing: Names of files that were not found, each once.
        outside: Names, among those, of files that are not below `within`.
        looked_up: Paths at which files were looked for, each once.
        effort: Work budget for the concave faces of all files.
    """

    within: Path | None = None
    scenes: dict[Path, Scene] = field(default_factory=dict)
    missing: dict[str, None] = field(default_factory=dict)
    outside: dict[str, None] = field(default_factory=dict)
    looked_up: dict[Path, None] = field(default_factory=dict)
    effort: Effort = field(default_factory=Effort)
    _count: Count = field(default_factory=Count)

    def scene(self, path: Path, progress: Callable[[float], None] | None = None) -> Scene:
        """Return a file's scene, after reading it and the files of its EXTERNPROTOs.

        Raises:
            ShapeError: If one of the files cannot be read.
        """
        unlinked = self._read(path, progress)
        while unlinked:
            proto = unlinked.pop()
            for address in proto.urls or []:
                file_name, _, name = address.partition("#")
                found = self.find(proto.source, [file_name])
                if found is None:
                    proto.reason_missing = f"{file_name!r}: {self.reason_missing(file_name)}"
                    continue
                unlinked += self._read(found)
                protos = self.scenes[found].protos
                target = protos.get(name) if name else next(iter(protos.values()), None)
                if target is not None:
                    proto.target = target
                    break
                proto.reason_missing = f"{file_name!r} contains no PROTO {name}".rstrip()
            _refuse_cycle(proto)
        return self.scenes[path]

    def _read(self, path: Path, progress: Callable[[float], None] | None = None) -> list[Proto]:
        """Read a file unless it has been read already; return its EXTERNPROTOs, none in that case."""
        if path in self.scenes:
            return []
        if len(self.scenes) >= _MOST_FILES:
            raise ShapeError(path, f"is one file too many: a scene may use {_MOST_FILES}")
        source = load(path)
        source.count = self._count
        self.effort.read(len(source.text))
        scene = self.scenes[path] = parse_vrml(source, progress)
        return list(scene.externals)

    def find(self, source: Source, addresses: Sequence[str]) -> Path | None:
        """Return the first existing file of those that a file names.

        If there is none, return None and add the first address to `missing`.
        """
        for name in (name for address in addresses for name in _names(address)):
            try:
                path = (source.path.parent / name).resolve()
                if self.within is not None and not path.is_relative_to(self.within.resolve()):
                    self.outside[addresses[0][:200]] = None
                    continue
                self.looked_up[path] = None
                if path.is_file():
                    return path
            except (OSError, ValueError):  # the name is too long or has a zero byte
                continue
        if addresses and addresses[0]:
            self.missing[addresses[0][:200]] = None
        return None

    def reason_missing(self, address: str) -> str:
        """Return the reason in words why `find` did not find a file."""
        if self.within is not None and address[:200] in self.outside:
            return f"no such file in the folder {self.within.resolve().name!r}; other folders are not read"
        return "no such file"

    def warnings(self) -> Iterator[str]:
        """Yield the warnings of all files; those of files other than the first with the file's name."""
        for number, scene in enumerate(self.scenes.values()):
            for warning in scene.source.warnings:
                yield warning if number == 0 else f"{scene.source.path.name}, {warning}"


def _names(address: str) -> list[str]:
    """Return the file names that an address may mean: exporters write backslashes, and %20 for blanks."""
    plain = address.strip().removeprefix("file://").removeprefix("file:")
    if not plain or "://" in plain:
        return []
    names = [plain, plain.replace("\\", "/")]
    return list(dict.fromkeys([*names, *(unquote(name) for name in names)]))


def _refuse_cycle(start: Proto) -> None:
    """Raise ShapeError if a PROTO contains itself, which is possible only through other files."""
    seen: set[int] = set()
    pending = [start]
    while pending:
        proto = pending.pop()
        for used in [*proto.uses, *([proto.target] if proto.target is not None else [])]:
            if used is start:
                raise start.source.error(start.position, f"EXTERNPROTO {start.name} contains itself")
            if id(used) not in seen:
                seen.add(id(used))
                pending.append(used)
