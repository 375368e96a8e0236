"""Files that break the rules: read with a warning if possible, otherwise refused in one line."""

import gzip
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.schema.errors import ShapeError
from robots.shapes.files.vrml.lexer import Kind, Lexer
from robots.shapes.files.vrml.read import read_vrml
from robots.shapes.files.vrml.source import Source
from robots.shapes.geometry import Geometry, bounds

Draw = Callable[[str], Geometry]

HEADER = "#VRML V2.0 utf8\n"
SHAPE = """Shape { geometry IndexedFaceSet {
  coord Coordinate { point [ 0 0 0, 1 0 0, 0 1 0 ] } coordIndex [ 0 1 2 ] } }"""


def read(folder: Path, data: bytes) -> Geometry:
    path = folder / "a.wrl"
    path.write_bytes(data)
    return read_vrml(path)


# Read with a warning


@pytest.mark.parametrize(
    ("text", "warning"),
    [
        (SHAPE, "line 1, column 1: the header '#VRML V2.0 utf8' is missing; read as VRML 2.0"),
        (f"#hello\n{SHAPE}", "line 1, column 1: the header '#VRML V2.0 utf8' is missing"),
        (f"# VRML V2.0 utf8\n{SHAPE}", "line 1, column 1: the header has a blank, '# VRML'"),
        (f"{HEADER}{SHAPE} }} ] }}", "line 3, column 79: an extra '}'; skipped"),
        (f"{HEADER}DEF 12 {SHAPE} USE 12", "line 2, column 5: the name '12' begins with a digit"),
        (f"{HEADER}DEF 3-a.b:c {SHAPE}", "line 2, column 5: the name '3-a.b:c' begins with a digit"),
        (f"{HEADER}Transform {{ translation 1 - 2 3 }} {SHAPE}", "line 2, column 27: a sign is separated"),
    ],
)
def test_odd_file_is_read_with_a_warning(tmp_path: Path, text: str, warning: str) -> None:
    geometry = read(tmp_path, text.encode())
    assert geometry.triangle_count >= 1
    assert any(said.startswith(warning) for said in geometry.warnings), geometry.warnings


def test_latin_1_is_read_with_a_warning(tmp_path: Path) -> None:
    geometry = read(tmp_path, f"{HEADER}# Stück\nDEF Grün {SHAPE}".encode("latin-1"))
    assert geometry.parts[0].name == "Grün"
    assert geometry.warnings == ("line 2, column 5: is not UTF-8; the file is read as Latin-1",)


# Read without one: the standard allows it, or it does no harm.


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + HEADER + SHAPE,
        HEADER.replace("utf8", "utf8 CosmoWorlds V1.0") + SHAPE,
        (HEADER + SHAPE).replace("\n", "\r\n"),
        (HEADER + "# a comment\n" + SHAPE + "# the end").replace("\n", "\r"),
        HEADER + SHAPE + "\0\0",
        HEADER + SHAPE.replace("[ 0 1 2 ]", "[ ,0,,1,2,, ]"),
        HEADER + SHAPE.replace("[ 0 0 0, 1 0 0, 0 1 0 ]", "[0 0 0 1 0 0 0 1 0]"),
        HEADER + SHAPE.replace("[ 0 0 0, 1 0 0, 0 1 0 ]", "[0 0 0,1 0 0,0 1 0,]"),
        HEADER + SHAPE.replace("[ 0 0 0,", "[ # first ]\n 0 0 0, # 9 9 9\n"),
        HEADER + SHAPE.replace("[ 0 0 0, 1 0 0,", "[ +.0 0. 0e5, 1.0E+0 -0 0x0,"),
        HEADER + SHAPE.replace("0 1 0 ]", "0 1\xa00 ]"),
        HEADER + SHAPE.replace("[ 0 1 2 ]", "[ 0 1 2 -1 -1 ]"),
        HEADER + "Group { children " + SHAPE + " }",
        HEADER + "ROUTE Nobody.1event TO 2.set_x " + SHAPE,
    ],
)
def test_what_the_standard_allows_is_read_without_a_warning(tmp_path: Path, text: str) -> None:
    geometry = read(tmp_path, text.encode())
    assert [corner.tolist() for corner in bounds(geometry)] == [[0, 0, 0], [1, 1, 0]]
    assert geometry.triangle_count == 1
    assert [warning for warning in geometry.warnings if "digit" not in warning] == []


@pytest.mark.parametrize("name", ["a.wrz", "a.wrl", "a.wrl.gz"])
def test_gzip_is_known_by_its_content(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(gzip.compress((HEADER + SHAPE).encode()))
    assert read_vrml(path).triangle_count == 1


def test_string_may_contain_quotes_brackets_and_line_breaks(draw: Draw) -> None:
    geometry = draw(r'WorldInfo { title "a \" } ] # \\" info [ "one' + "\n" + 'two" "" ] } ' + SHAPE)
    assert geometry.triangle_count == 1


def test_list_with_comments_and_detached_signs_keeps_every_number(draw: Draw) -> None:
    text = "[ 0 0 0, # the first\n - 1 0 0, 0 - 1 0 # ]\n ]"
    geometry = draw(SHAPE.replace("[ 0 0 0, 1 0 0, 0 1 0 ]", text))
    assert [corner.tolist() for corner in bounds(geometry)] == [[-1, -1, 0], [0, 0, 0]]


# Refused


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "is empty"),
        (b" \n\0", "is empty"),
        (b"#hello", "is not VRML 2.0: it begins with '#hello', not '#VRML V2.0 utf8'"),
        (b"solid \0\0 {", "is not VRML 2.0: it contains binary data"),
        (b"#VRML V1.0 ascii\nSeparator { }", "line 1, column 1: is VRML 1.0; only VRML 2.0 is read"),
        (b"#X3D V3.0 utf8\nGroup { }", "line 1, column 1: is X3D; only VRML 2.0 is read"),
        (b"#Inventor V2.1 ascii\nSeparator { }", "line 1, column 1: is Inventor; only VRML 2.0 is read"),
        (gzip.compress(HEADER.encode(), mtime=0)[:-9], "is gzip data, but truncated"),
        (gzip.compress(HEADER.encode(), mtime=0)[:10] + b"\xff" * 20, "is gzip data, but damaged"),
        (
            gzip.compress(b" " * (20 << 20), mtime=0),
            "unpacks to more than 16 MiB, too much for a mesh of its size",
        ),
    ],
)
def test_file_of_another_format_is_rejected(tmp_path: Path, data: bytes, reason: str) -> None:
    with pytest.raises(ShapeError) as caught:
        read(tmp_path, data)
    assert str(caught.value).startswith(str(tmp_path / "a.wrl"))
    assert reason in str(caught.value)


def test_folder_and_missing_file_are_rejected(tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match="cannot be read: Is a directory"):
        read_vrml(tmp_path)
    with pytest.raises(ShapeError, match="cannot be read: No such file"):
        read_vrml(tmp_path / "none.wrl")


def face_set(points: str, rest: str = "coordIndex [ 0 1 2 ]") -> str:
    return f"Shape {{ geometry IndexedFaceSet {{ coord Coordinate {{ point [ {points} ] }} {rest} }} }}"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Shape {", "line 2, column 8: a field of Shape or '}' was expected, not the end of the file"),
        ("Shape {\n geometry", "line 3, column 10: a value of geometry was expected, not the end"),
        ("Shape { geometry }", "line 2, column 18: a value of geometry was expected, not '}'"),
        ("Shape }", "line 2, column 7: '{' after 'Shape' was expected, not '}'"),
        ("Shape Box { }", "line 2, column 7: '{' after 'Shape' was expected, not 'Box'"),
        ("Group { children [ Shape { } ", "line 2, column 18: this '[' is never closed"),
        ("Group { children [ 1 Shape { } ] }", "column 22: a number or ']' was expected, not 'Shape'"),
        ("Group { 5 }", "line 2, column 9: a field of Group or '}' was expected, not '5'"),
        ('WorldInfo { title "open }', "line 2, column 19: this string does not end"),
        ("DEF", "line 2, column 4: a name after DEF was expected, not the end of the file"),
        ("DEF A { }", "line 2, column 7: a node was expected, not '{'"),
        ("USE { }", "line 2, column 5: a name after USE was expected, not '{'"),
        ('"text"', "line 2, column 1: a node was expected, not 'text'"),
        ("ROUTE a.b IN c.d", "line 2, column 11: TO was expected, not 'IN'"),
        ("PROTO P { }", "line 2, column 9: '[' before a PROTO's fields was expected, not '{'"),
        ("PROTO P [ SFBool b ] { }", "line 2, column 11: eventIn, eventOut, field, exposedField or ']' was"),
        ("PROTO P [ field SFBool ] { }", "line 2, column 24: a field's name was expected, not ']'"),
        ("PROTO P [ ] Shape { }", "line 2, column 13: '{' before a PROTO's body was expected, not 'Shape'"),
        ("PROTO P [ ] { Shape { }", "line 2, column 24: '}' was expected, not the end of the file"),
        ("Shape { geometry Box { size 1 2 } }", "line 2, column 18: Box: size has 2 numbers; it takes 3"),
        ('Shape { geometry Box { size "1" } }', "line 2, column 18: Box: size must be numbers"),
        ("Shape { geometry Sphere { radius [ ] } }", "Sphere: radius has 0 numbers; it takes 1"),
        ("Transform { rotation 0 0 1 }", "line 2, column 1: Transform: rotation has 3 numbers; it takes 4"),
        (face_set("0 0 0 1"), "Coordinate: point has 4 numbers, which do not make rows of 3"),
        (face_set("0 0 nan"), "line 2, column 66: a number or ']' was expected, not 'nan'"),
        (face_set("0 inf 0"), "a number or ']' was expected, not 'inf'"),
        (face_set("0 0 1e39"), "line 2, column 66: 1e39 is too large for a number"),
        (face_set("0 0 -1.#IND"), "a number was expected, not '1.#IND'"),
        (face_set("0 0 1.2.3"), "line 2, column 66: a number or ']' was expected, not '1.2.3'"),
        (face_set("0 0 0", "coordIndex [ 0 0.5 1 ]"), "coordIndex contains 0.5; it takes whole numbers"),
        (face_set("0 0 0", "coordIndex [ 1e30 ]"), "coordIndex contains 1e+30; it takes point numbers"),
        ("Transform { translation 1e39 0 0 }", "line 2, column 25: 1e39 is too large for a number"),
        (
            "Transform { scale 1e30 1 1 children Transform { scale 1e31 1 1 } }",
            "line 2, column 37: Transform: nested transforms reach beyond 1e+60",
        ),
        ("Shape { geometry ElevationGrid { xDimension 3 zDimension 2 } }", "height has 0 numbers; 3 x 2"),
        ("Group { children " * 200, "line 2, column 2041: nested deeper than 120"),
    ],
)  # fmt: skip
def test_error_of_an_invalid_file_has_line_and_column(
    draw: Draw, tmp_path: Path, text: str, expected: str
) -> None:
    with pytest.raises(ShapeError) as caught:
        draw(text)
    assert str(caught.value).startswith(f"{tmp_path / 'a.wrl'}, line ")
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_lines_are_counted_with_any_line_ending(tmp_path: Path) -> None:
    for end in ("\n", "\r\n", "\r"):
        with pytest.raises(ShapeError, match="line 4, column 3: "):
            read(tmp_path, f"#VRML V2.0 utf8{end}{end}Group {{{end}  5".encode())


def test_error_about_a_long_token_is_short(draw: Draw) -> None:
    with pytest.raises(ShapeError) as caught:
        draw("Group { children [ " + "}" * 1 + "x" * 100_000)
    assert len(caught.value.reason) < 120
    with pytest.raises(ShapeError) as caught:
        draw("Shape { geometry " + "x" * 100_000)
    assert len(caught.value.reason) < 300


def test_text_quoted_from_a_file_has_no_control_characters(draw: Draw) -> None:
    geometry = draw(f"Evil\x1b {{ }} {SHAPE}")
    assert geometry.warnings == ("line 2, column 1: Evil?: is not a node of VRML 2.0; skipped",)
    with pytest.raises(ShapeError) as caught:
        draw("Evil\x1b [31m")
    assert caught.value.reason == r"'{' after 'Evil\x1b' was expected, not '['"


# Any text


@given(st.text(alphabet='{}[]"#-+.,01eEx \n\\ABDEFSU', max_size=60))
def test_any_text_is_tokenised_completely_or_rejected(text: str) -> None:
    with suppress(ShapeError):  # of this string does not end
        lexer = Lexer(Source(Path("a.wrl"), text))
        for _ in range(len(text) + 1):
            if lexer.kind is Kind.END:
                break
            lexer.advance()
        assert lexer.kind is Kind.END


@given(
    st.lists(st.floats(-1e38, 1e38, allow_subnormal=False), max_size=300),
    st.sampled_from([" ", ", ", ",", "\n", " # 1 ] 2\n", ",\t"]),
)
def test_list_returns_the_numbers_of_the_text(numbers: list[float], between: str) -> None:
    lexer = Lexer(Source(Path("a.wrl"), f"[ {between.join(map(repr, numbers))} ] end"))
    found = lexer.number_list()
    assert (found.tolist() if found is not None else []) == numbers
    assert lexer.text == "end"
