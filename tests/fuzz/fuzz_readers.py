"""Broken files for the readers of meshes and of robot.toml: real ones, changed at random.

    python -m tests.fuzz.fuzz_readers [--inputs N] [--seconds S] [--seed N] [--reader 3ds] [--keep FOLDER]

A reader may raise only the documented errors, within seconds and a bounded memory. Anything else ends
the run with exit status 1 and its input in the folder.
"""

import faulthandler
import random
import resource
import signal
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import numpy as np

from robots.descriptions.description import LIBRARY, parse
from robots.schema.errors import RobotError
from robots.shapes.files.read import read_geometry
from robots.shapes.files.three_ds.read import read_3ds
from robots.shapes.files.three_ds.write import write_3ds
from robots.shapes.files.vrml.read import read_vrml
from robots.shapes.files.vrml.write import write_vrml
from robots.shapes.files.write_glb import glb_of
from robots.shapes.files.write_others import write_obj, write_ply, write_stl
from robots.shapes.geometry import Geometry, Material, Part
from robots.shapes.normals import creased
from robots.shapes.solids import box
from tests.fuzz.fuzzing import Finding, keep, options

FILES = Path(__file__).resolve().parents[1] / "robots" / "files"
SECONDS_AN_INPUT = 10
MEMORY = 3 << 30
# Larger ones are cut to this: a changed byte deep in a large file says no more than in a small one.
LARGEST = 24_000
_NUMBERS = (b"nan", b"-inf", b"1e999", b"4294967295", b"-1", b"0", b"99999999999999999999", b"1e-320")
_TOKENS = (b"{", b"}", b"[", b"]", b"USE x", b"DEF x", b"IS", b"PROTO x [] {", b'"', b"#", b"\0", b"=", b"\n")
_COUNTS = (0, 1, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF)


class HangError(BaseException):
    """Timeout of a reader; no Exception, because a reader may catch those."""


def main() -> None:
    parser = options(__doc__, inputs=1_000_000, seconds=600.0)
    parser.add_argument("--reader", choices=sorted(READERS), default=None)
    arguments = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    faulthandler.enable()
    names = [arguments.reader] if arguments.reader else sorted(READERS)
    start = time.monotonic()
    count = 0
    for name in names:
        share = arguments.seconds / len(names)
        done, finding = fuzz(name, arguments.inputs // len(names), share, arguments.seed)
        count += done
        print(f"{name}: {done} inputs, {done / max(time.monotonic() - start, 1e-9):.0f} a second so far")
        if finding is not None:
            keep(arguments.keep, f"seed{arguments.seed}-{done}.{name}", finding)
    print(f"{count} inputs in {time.monotonic() - start:.0f} s; only documented errors")


def fuzz(name: str, inputs: int, seconds: float, seed: int) -> tuple[int, Finding | None]:
    """Return how many inputs one reader accepted, and the first that it could not process."""
    chance = random.Random(f"{name} {seed}")
    corpus = list(READERS[name].corpus())
    before = signal.signal(signal.SIGPROF, _hang)
    end = time.monotonic() + seconds
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"input.{name}"
            for count in range(inputs):
                if time.monotonic() > end:
                    return count, None
                data = mutated(corpus, chance)
                path.write_bytes(data)
                problem = _tried(READERS[name].read, path)
                if problem:
                    return count, Finding(data, problem)
        return inputs, None
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def _tried(read: Callable[[Path], object], path: Path) -> str:
    """Return the reader's problem with a file; empty: none."""
    signal.setitimer(signal.ITIMER_PROF, SECONDS_AN_INPUT)  # its own time, not the machine's
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            read(path)
    except RobotError as error:
        text = str(error)
        return (
            "" if text and "\n" not in text and len(text) < 2000 else f"not one clear line: {text[:3000]!r}"
        )
    except HangError:
        return f"took over {SECONDS_AN_INPUT} s"
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        return repr(error)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return ""


def _hang(_signal: int, _frame: FrameType | None) -> None:
    raise HangError


def mutated(corpus: list[bytes], chance: random.Random) -> bytes:
    """Return one of the files, changed in one to eight places."""
    data = bytearray(chance.choice(corpus))
    for _ in range(chance.choice((1, 1, 1, 2, 4, 8))):
        if not data:
            break
        at = chance.randrange(len(data))
        length = min(chance.choice((1, 2, 4, 8, 64, 512)), len(data) - at)
        match chance.randrange(10):
            case 0:
                data[at] ^= 1 << chance.randrange(8)
            case 1:
                data[at : at + length] = chance.randbytes(length)
            case 2:
                del data[at : at + length]
            case 3:
                del data[at:]
            case 4:
                other = chance.choice(corpus)
                begin = chance.randrange(len(other)) if other else 0
                data[at:at] = other[begin : begin + length]
            case 5:
                data[at:at] = data[at : at + length] * chance.choice((1, 3, 50))
            case 6:
                data[at:at] = b" " + chance.choice(_TOKENS) + b" "
            case 7:
                _number(data, at, chance)
            case 8:
                width = chance.choice((2, 4))
                value = chance.choice(_COUNTS) & ((1 << 8 * width) - 1)
                data[at : at + width] = value.to_bytes(width, "little")
            case 9:
                data = _grown(data, at, chance)
    return bytes(data)


def _grown(data: bytearray, at: int, chance: random.Random) -> bytearray:
    """Repeat a block of a text inside itself, after itself, or in all places of its kind: nesting or length
    grows.
    """
    opened = [place for place, byte in enumerate(data[: at + 1]) if byte in b"{["]
    begin = opened[-chance.choice((1, 2, 3))] if len(opened) > 2 else 0
    end = _closed(data, begin)
    block = bytes(data[begin + 1 : end - 1])
    if not block or len(data) > 4 * LARGEST:
        return data
    match chance.randrange(3):
        case 0:  # in itself: the block in the block, some levels deep, twice at each
            for _ in range(chance.choice((1, 3, 6))):
                if len(block) < LARGEST:
                    block = block + b" " + block
        case 1:  # after itself: its parent contains it many times
            block = (block + b" ") * min(chance.choice((2, 100, 2000)), 1 + LARGEST // len(block))
        case 2:  # PROTOs of PROTOs, each of which uses the one before some times
            times, levels = chance.choice((1, 2, 10, 100, 5000)), chance.choice((1, 2, 8, 30, 150))
            block = (block + b" ") * chance.choice((1, 1 + LARGEST // len(block)))
            protos = [b"PROTO N0 [ field MFNode c [ ] ] { Switch { level [ " + block + b" ] choice IS c } }"]
            for level in range(1, levels):
                use = b"N%d { } " % (level - 1)
                protos.append(b"PROTO N%d [ ] { Group { children [ " % level + use * times + b"] } }")
            tail = b"\n" + b"\n".join(protos) + b"\n" + b"N%d { } " % (levels - 1) * times
            return data + tail if len(tail) < 4 * LARGEST else data
    return data[: begin + 1] + block + data[end - 1 :]


def _closed(data: bytearray, begin: int) -> int:
    """Return the position at which a bracket that opens there closes; the end if it does not."""
    opening, depth = data[begin : begin + 1], 0
    closing = b"}" if opening == b"{" else b"]"
    for place in range(begin, len(data)):
        byte = data[place : place + 1]
        depth += (byte == opening) - (byte == closing)
        if depth == 0:
            return place + 1
    return len(data)


def _number(data: bytearray, at: int, chance: random.Random) -> None:
    """Replace the next number of a text with an unusual one."""
    digits = b"0123456789.-+eE"
    while at < len(data) and data[at] not in digits:
        at += 1
    stop = at
    while stop < len(data) and data[stop] in digits:
        stop += 1
    data[at:stop] = chance.choice(_NUMBERS)


def _small(paths: Iterator[Path]) -> Iterator[bytes]:
    for path in sorted(paths):
        yield path.read_bytes()[:LARGEST]


def _three_ds_corpus() -> Iterator[bytes]:
    yield write_3ds(_box())
    yield from _small((FILES / "3ds").glob("*.3[dD][sS]"))


def _vrml_corpus() -> Iterator[bytes]:
    yield write_vrml(_box()).encode()
    yield _VRML.encode()
    yield from _small(FILES.rglob("*.wrl"))


def _toml_corpus() -> Iterator[bytes]:
    yield from _small(LIBRARY.glob("*/robot.toml"))


def _read_toml(path: Path) -> object:
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        text = path.read_text(encoding="latin-1")
    # The library's folder: the meshes that it names are there.
    return parse(text, LIBRARY / "pt600" / "robot.toml")


def _box() -> Geometry:
    material = Material("glass", (0.2, 0.4, 0.6), transparency=0.25)
    return Geometry((Part("box", material, *creased(*box(np.zeros(3), np.ones(3)), 0.0)),))


@dataclass(frozen=True)
class Reader:
    """Reader of a kind of file, and files of that kind."""

    read: Callable[[Path], object]
    corpus: Callable[[], Iterator[bytes]]


READERS: Mapping[str, Reader] = {
    "3ds": Reader(read_3ds, _three_ds_corpus),
    "wrl": Reader(read_vrml, _vrml_corpus),
    "toml": Reader(_read_toml, _toml_corpus),
    "glb": Reader(read_geometry, lambda: iter([glb_of(_box())])),
    # Other people's readers behind ours.
    "stl": Reader(read_geometry, lambda: iter([write_stl(_box()), _STL])),
    "obj": Reader(read_geometry, lambda: iter([write_obj(_box(), "none.mtl")[0].encode()])),
    "ply": Reader(read_geometry, lambda: iter([write_ply(_box()), _PLY])),
    "dxf": Reader(read_geometry, lambda: iter([_DXF])),
}

_STL = b"""solid a
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 1 1 0
endloop
endfacet
endsolid a
"""
_PLY = b"""ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 1
property list uchar int vertex_indices
end_header
0 0 0 255 0 0
1 0 0 0 255 0
1 1 0 0 0 255
3 0 1 2
"""
_DXF = b"""  0
SECTION
  2
ENTITIES
  0
3DFACE
  8
0
 62
1
 10
0.0
 20
0.0
 30
0.0
 11
1.0
 21
0.0
 31
0.0
 12
1.0
 22
1.0
 32
0.0
 13
0.0
 23
1.0
 33
0.0
  0
CIRCLE
  8
0
 10
0.0
 20
0.0
 40
2.0
  0
ENDSEC
  0
EOF
"""

_VRML = """#VRML V2.0 utf8
PROTO Segment [ exposedField SFVec3f at 0 0 0 field SFNode shape NULL field MFFloat gaps [ 1 2 ] ]
{ Transform { translation IS at children [ Shape { geometry IS shape } ] } }
DEF A Transform { center 1 2 3 rotation 0 0 1 1.57 scaleOrientation 1 0 0 0.5 scale 1 2 -3
  children [ DEF S Shape { appearance Appearance { material DEF M Material { diffuseColor 1 0 0 } }
    geometry IndexedFaceSet { convex FALSE creaseAngle 0.5 coord Coordinate { point [ 0 0 0, 2 0 0, 2 2 0,
      1 1 0, 0 2 0 ] } coordIndex [ 0 1 2 3 4 -1 ] color Color { color [ 1 0 0, 0 1 0 ] }
      colorPerVertex FALSE colorIndex [ 1 ] } } USE S ] }
Segment { at 1 1 1 shape Cylinder { radius 2 height 3 top FALSE } }
LOD { range [ 10 ] level [ Shape { geometry Sphere { radius 1 } } Group { } ] }
Switch { whichChoice 0 choice [ Shape { geometry Cone { } } ] }
Shape { geometry ElevationGrid { xDimension 3 zDimension 2 xSpacing 1 height [ 0 1 0 1 0 1 ] } }
Shape { geometry Extrusion { crossSection [ 1 1, 1 -1, -1 -1, -1 1, 1 1 ] spine [ 0 0 0, 0 1 0, 1 2 0 ]
  scale [ 1 1, 2 2 ] orientation [ 0 1 0 0.5 ] } }
Shape { geometry IndexedLineSet { coord Coordinate { point [ 0 0 0, 1 1 1 ] } coordIndex [ 0 1 -1 ] } }
Shape { geometry Text { string [ "a" ] } }
Inline { url "none.wrl" }
"""


if __name__ == "__main__":
    main()
