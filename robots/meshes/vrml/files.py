"""The files of a scene: the one that is read, and those that it names by Inline and EXTERNPROTO."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

from robots.errors import MeshError
from robots.meshes.vrml.parser import Proto, Scene, parse_vrml
from robots.meshes.vrml.source import Count, Source, load

_MOST_FILES = 2000


@dataclass
class Files:
    """Files that have been read, by path; each is read once.

    Attributes:
        within: Files elsewhere count as missing; none: any place will do.
        missing: Files that are not there, as they are named, each once.
        outside: Those of them that are not looked for: they lie elsewhere.
        asked: Where files were looked for, found there or not, each once.
    """

    within: Path | None = None
    scenes: dict[Path, Scene] = field(default_factory=dict)
    missing: dict[str, None] = field(default_factory=dict)
    outside: dict[str, None] = field(default_factory=dict)
    asked: dict[Path, None] = field(default_factory=dict)
    _count: Count = field(default_factory=Count)

    def scene(self, path: Path, progress: Callable[[float], None] | None = None) -> Scene:
        """A file's scene; the files of its EXTERNPROTOs are read too.

        Raises:
            MeshError: If one of them cannot be read.
        """
        unlinked = self._read(path, progress)
        while unlinked:
            proto = unlinked.pop()
            for address in proto.urls or []:
                where, _, name = address.partition("#")
                found = self.find(proto.source, [where])
                if found is None:
                    proto.trouble = f"{where!r}: {self.trouble(where)}"
                    continue
                unlinked += self._read(found)
                protos = self.scenes[found].protos
                target = protos.get(name) if name else next(iter(protos.values()), None)
                if target is not None:
                    proto.target = target
                    break
                proto.trouble = f"{where!r} holds no PROTO {name}".rstrip()
            _refuse_cycle(proto)
        return self.scenes[path]

    def _read(self, path: Path, progress: Callable[[float], None] | None = None) -> list[Proto]:
        """Read a file that has not been read; its EXTERNPROTOs."""
        if path in self.scenes:
            return []
        if len(self.scenes) >= _MOST_FILES:
            raise MeshError(path, f"is one of more than {_MOST_FILES} files of one scene")
        source = load(path)
        source.count = self._count
        scene = self.scenes[path] = parse_vrml(source, progress)
        return list(scene.externals)

    def find(self, source: Source, addresses: Sequence[str]) -> Path | None:
        """The first file there is of those that another names; None, and the first is missing."""
        for name in (name for address in addresses for name in _names(address)):
            try:
                path = (source.path.parent / name).resolve()
                if self.within is not None and not path.is_relative_to(self.within.resolve()):
                    self.outside[addresses[0][:200]] = None
                    continue
                self.asked[path] = None
                if path.is_file():
                    return path
            except (OSError, ValueError):  # too long a name, or a zero in it
                continue
        if addresses and addresses[0]:
            self.missing[addresses[0][:200]] = None
        return None

    def trouble(self, address: str) -> str:
        """Why a file is not read that `find` has not found, in words."""
        if self.within is not None and address[:200] in self.outside:
            return f"no such file in the folder {self.within.resolve().name!r}, and no other is read"
        return "no such file"

    def warnings(self) -> Iterator[str]:
        """What was odd in any of them; of others than the first with their names."""
        for number, scene in enumerate(self.scenes.values()):
            for warning in scene.source.warnings:
                yield warning if number == 0 else f"{scene.source.path.name}, {warning}"


def _names(address: str) -> list[str]:
    """What a file may be called: exporters write backslashes, and blanks as %20."""
    plain = address.strip().removeprefix("file://").removeprefix("file:")
    if not plain or "://" in plain:
        return []
    names = [plain, plain.replace("\\", "/")]
    return list(dict.fromkeys([*names, *(unquote(name) for name in names)]))


def _refuse_cycle(start: Proto) -> None:
    """Raise if a PROTO holds itself, which only those of other files can."""
    seen: set[int] = set()
    ahead = [start]
    while ahead:
        proto = ahead.pop()
        for used in [*proto.uses, *([proto.target] if proto.target is not None else [])]:
            if used is start:
                raise start.source.error(start.position, f"EXTERNPROTO {start.name} leads back to itself")
            if id(used) not in seen:
                seen.add(id(used))
                ahead.append(used)
