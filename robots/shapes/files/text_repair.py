"""Repairs to the text of OBJ and COLLADA files for trimesh, and a limit on COLLADA instances."""

import re
import xml.etree.ElementTree as Xml
from collections.abc import Iterator
from pathlib import Path

from robots.schema.errors import ShapeError
from robots.schema.xml_text import unicode_of

# Geometry instances, counted once for each instance, and the numbers in their face lists.
_MOST_INSTANCES = 20_000
_MOST_NUMBERS = 50_000_000
_MOST_NESTED = 100

_NEGATIVE_FACE = re.compile(r"(?m)^[ \t]*[fF][ \t][^\n]*-")
_COUNTED = re.compile(r"[ \t]*(v|vt|vn|f)[ \t]")


def plain_text(data: bytes) -> str:
    """Decode text as UTF-16, with or without a byte order mark, or as UTF-8; replace invalid bytes."""
    encoding, mark = unicode_of(data)
    return data[mark:].decode(encoding, errors="replace")


def counted_from_first(path: Path, text: str) -> str:
    """Replace negative vertex numbers in an OBJ file's faces (-1: the last vertex so far).

    Raises:
        ShapeError: If one goes back beyond the first vertex.
    """
    if not _NEGATIVE_FACE.search(text):
        return text
    counts = {"v": 0, "vt": 0, "vn": 0}
    lines = text.replace("\\\n", " ").replace("\\\r\n", " ").splitlines()
    for number, line in enumerate(lines):
        found = _COUNTED.match(line)
        if found is None:
            continue
        if found[1] in counts:
            counts[found[1]] += 1
        elif "-" in line:
            words = line.partition("#")[0].split()
            lines[number] = " ".join(["f", *(_corner(path, number + 1, word, counts) for word in words[1:])])
    return "\n".join(lines) + "\n"


def _corner(path: Path, line: int, word: str, counts: dict[str, int]) -> str:
    numbers = []
    for text, count in zip(word.split("/"), counts.values(), strict=False):
        if text.startswith("-") and text[1:].isdecimal():
            forward = count + 1 + int(text[:20])
            if forward < 1:
                raise ShapeError(
                    path, f"a face uses vertex {text[:20]}; there are {count}", place=f"line {line}"
                )
            text = str(forward)
        numbers.append(text)
    return "/".join(numbers)


def check_instances(path: Path, data: bytes) -> None:
    """Reject a COLLADA file with nested instances that add up to more than can be drawn.

    Raises:
        ShapeError: If it draws too much, a node contains itself, or it is not XML.
    """
    try:
        root = Xml.fromstring(data)
    except (Xml.ParseError, ValueError, LookupError) as error:
        raise ShapeError(path, f"cannot be read as DAE: {error}") from None
    sizes: dict[str, int] = {}
    nodes: dict[str, Xml.Element] = {}
    for element in root.iter():
        match _name(element):
            case "geometry":
                sizes[element.get("id", "")] = sum(
                    len(each.text or "") // 2 + 1 for each in element.iter() if _name(each) in ("p", "h")
                )
            case "node":
                nodes.setdefault(element.get("id", ""), element)
    drawn = _Drawn(path, sizes, nodes)
    for element in root.iter():
        if _name(element) == "visual_scene":
            instances, numbers = drawn.of(element, 0)
            if instances > _MOST_INSTANCES or numbers > _MOST_NUMBERS:
                raise ShapeError(
                    path,
                    f"draws {instances} instances with {numbers} numbers; at most {_MOST_INSTANCES} and "
                    f"{_MOST_NUMBERS} are read",
                )


class _Drawn:
    """A count of the geometry instances, and of the numbers in their face lists, that an element draws.

    The result of each node is cached.
    """

    def __init__(self, path: Path, sizes: dict[str, int], nodes: dict[str, Xml.Element]) -> None:
        self.path = path
        self.sizes = sizes
        self.nodes = nodes
        self.known: dict[str, tuple[int, int]] = {}

    def of(self, element: Xml.Element, depth: int) -> tuple[int, int]:
        if depth > _MOST_NESTED:
            raise ShapeError(
                self.path, f"nodes are nested deeper than {_MOST_NESTED}, or a node contains itself"
            )
        instances = numbers = 0
        for more, of_them in self._children(element, depth):
            instances += more
            numbers += of_them
        return instances, numbers

    def _children(self, element: Xml.Element, depth: int) -> Iterator[tuple[int, int]]:
        for child in element:
            address = child.get("url", "").removeprefix("#")
            match _name(child):
                case "instance_geometry" | "instance_controller":
                    yield 1, self.sizes.get(address, 0)
                case "node":
                    yield self.of(child, depth + 1)
                case "instance_node" if address in self.nodes:
                    if address not in self.known:
                        self.known[address] = self.of(self.nodes[address], depth + 1)
                    yield self.known[address]


def _name(element: Xml.Element) -> str:
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""
