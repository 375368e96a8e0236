"""The key frames of a 3DS file: the hierarchy of objects and their pivots.

    B000 ── B002 object ── B030 number, B010 name flags:uint16 flags:uint16 parent:uint16, B011 instance,
                           B013 pivot, B020 position, B021 rotation, B022 scale
    track = flags:uint16 unused:8 count:uint32 then keys
    key   = frame:uint32 flags:uint16 [a float for each of the flags' low 5 bits] values

In the real files examined, the first key of each track repeats the shape's local frame (4160), so vertices
need not be moved by it. (One file was saved in mid-motion and has another rotation.) Rotations are clockwise
about their axis: only then do the keys of those files agree with their local frames.
"""

import struct
from collections import Counter
from dataclasses import dataclass

import numpy as np

from robots.schema.poses import axis_rotation
from robots.shapes.files.three_ds.chunks import Chunk, Source
from robots.shapes.geometry import FloatArray, Node

_OBJECT = 0xB002
_NONE = 0xFFFF
_DUMMY = "$$$DUMMY"


@dataclass
class _Entry:
    number: int
    name: str = ""
    instance: str = ""
    parent: int = _NONE
    to_parent: FloatArray | None = None


def nodes_of(source: Source, chunk: Chunk) -> tuple[Node, ...]:
    """Return the hierarchy in file order; a parent may follow its children."""
    entries: list[_Entry] = []
    for child in source.chunks(chunk.start, chunk.end):
        if child.id == _OBJECT:
            entries.append(_entry(source, child, len(entries)))
    indices = {entry.number: index for index, entry in enumerate(entries)}
    parents = [indices.get(entry.parent, -1) if entry.parent != _NONE else -1 for entry in entries]
    counted = Counter(entry.name for entry in entries if entry.name != _DUMMY)
    for name, count in counted.items():
        if count > 1:
            source.warn(f"object {name!r}: {count - 1} copies of it in the key frames are not drawn")
    return tuple(
        Node(_name(entry), parents[index], _to_file(source, entries, parents, index))
        for index, entry in enumerate(entries)
    )


def _name(entry: _Entry) -> str:
    if entry.name == _DUMMY:
        return entry.instance or entry.name
    return f"{entry.name}.{entry.instance}" if entry.instance else entry.name


def _to_file(source: Source, entries: list[_Entry], parents: list[int], index: int) -> FloatArray:
    matrix, seen = np.eye(4), 0
    start = index
    while index >= 0:
        to_parent = entries[index].to_parent
        if to_parent is not None:
            matrix = to_parent @ matrix
        index, seen = parents[index], seen + 1
        if seen > 1000:
            raise source.error(
                0,
                f"key frames: {entries[start].name!r} is nested deeper than 1000, or is its own ancestor",
            )
    return matrix


def _entry(source: Source, chunk: Chunk, number: int) -> _Entry:
    entry = _Entry(number)
    position, turn, scale = np.zeros(3), np.eye(3), np.ones(3)
    for child in source.chunks(chunk.start, chunk.end):
        if child.id == 0xB030 and child.end - child.start >= 2:
            (entry.number,) = struct.unpack_from("<H", source.data, child.start)
        elif child.id == 0xB010:
            entry.name, after = source.text(child.start, child.end)
            if child.end - after >= 6:
                (entry.parent,) = struct.unpack_from("<H", source.data, after + 4)
        elif child.id == 0xB011:
            entry.instance, _ = source.text(child.start, child.end)
        elif child.id == 0xB020:
            position = _first_key(source, child, position)
        elif child.id == 0xB021:
            angle, *axis = _first_key(source, child, np.array([0.0, 0.0, 0.0, 1.0])).tolist()
            turn = axis_rotation(np.array(axis), -angle)
        elif child.id == 0xB022:
            scale = _first_key(source, child, scale)
    entry.to_parent = np.eye(4)
    entry.to_parent[:3, :3] = turn * scale
    entry.to_parent[:3, 3] = position
    return entry


def _first_key(source: Source, chunk: Chunk, default: FloatArray) -> FloatArray:
    """Return the values of a track's first key; the default if the track is empty."""
    if chunk.end - chunk.start < 14:
        return default
    (count,) = struct.unpack_from("<I", source.data, chunk.start + 10)
    if not count:
        return default
    start = chunk.start + 14
    if chunk.end - start < 6:
        raise source.error(start, f"a track declares {count} keys but contains none")
    (flags,) = struct.unpack_from("<H", source.data, start + 4)
    return source.floats(start + 6 + 4 * (flags & 31).bit_count(), chunk.end, len(default))
