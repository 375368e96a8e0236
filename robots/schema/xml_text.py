"""Reader of XML files as robots' programs write them: any declared encoding, and what ROS's own parser takes.

The encoding is that of the byte order mark, else the declared one, else UTF-8, as XML says. Accepted with a
note: bytes that the encoding does not have, and `--`, within comments; a DOCTYPE without declarations.
Prefixes need no declaration, and names keep them: `gz:type`. Entities are refused: they can expand without
limit.
"""

import codecs
import re
import xml.etree.ElementTree as Xml
from collections.abc import Iterator
from typing import NoReturn
from xml.parsers import expat

_MARKS = {
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF32_LE: "utf-32-le",  # before UTF-16: its mark begins in the same way
    codecs.BOM_UTF32_BE: "utf-32-be",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}
_DECLARED = re.compile(rb"""\s*<\?xml[^>]{0,200}?\bencoding\s*=\s*["']([\w.:-]{1,40})["']""")
_DECLARATION = re.compile(r"\A\s*<\?xml\b[^>]*\?>")
# Python has more codecs. Some encode no text, or take time that grows with the square of the length.
_ENCODING = re.compile(
    r"utf-?8|(us-)?ascii|iso[-_]?8859[-_](?!12)(1[0-6]|[1-9])|latin(-?1|[2-9])|windows-125[0-8]|koi8-[ru]|"
    r"cp(125[0-8]|437|850|932|936|949|950)|gbk|gb2312|gb18030|big5|shift[-_]jis|euc-(jp|kr)"
)
# Many files declare the first, and contain characters of the second.
_WIDER = {"gb2312": "gb18030", "gbk": "gb18030"}
_ENDS = {"<!--": "-->", "<![CDATA[": "]]>", "<?": "?>"}
_BEGIN = re.compile("|".join(map(re.escape, _ENDS)))
_UNDECODED = re.compile("[\udc80-\udcff]")


class XmlError(ValueError):
    """The file cannot be read as XML; the text says why."""


def read_xml(data: bytes | str) -> tuple[Xml.Element, tuple[str, ...]]:
    """Return the root element, and a note on each irregularity.

    Raises:
        XmlError: If the encoding is unknown or wrong, if it declares entities, or is not XML.
    """
    text, notes = xml_text(data)
    builder = Xml.TreeBuilder()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = parser.SkippedEntityHandler = _refuse_entity

    def on_doctype(name: str, system: str | None, public: str | None, declarations: bool) -> None:
        if declarations:
            _refuse_entity()
        notes.append("its DOCTYPE is ignored")

    parser.StartDoctypeDeclHandler = on_doctype
    try:
        parser.Parse(text, True)
    except (expat.ExpatError, ValueError) as error:
        if isinstance(error, XmlError):
            raise
        raise XmlError(f"is not XML: {error}") from None
    return builder.close(), tuple(notes)


def xml_text(data: bytes | str) -> tuple[str, list[str]]:
    """Return an XML document as text without declaration and comments, and notes.

    Raises:
        XmlError: If the encoding is unknown, or bytes outside of comments are not text of this encoding.
    """
    text, encoding = (data.removeprefix("\ufeff"), "utf-8") if isinstance(data, str) else _decoded(data)
    parts: list[str] = []
    notes: list[str] = []
    line = 1
    for is_comment, part in _parts(_DECLARATION.sub("", text, count=1)):
        lines = part.count("\n")
        parts.append("\n" * lines if is_comment else part)
        if is_comment and not notes:
            inside = part[4:-3]
            if _UNDECODED.search(inside):
                notes.append(f"line {line}: this comment has bytes that are not {encoding}; it is ignored")
            elif "--" in inside or inside.endswith("-"):
                notes.append(f"line {line}: this comment has --, which XML does not allow; it is ignored")
        line += lines
    bare = "".join(parts)
    if wrong := _UNDECODED.search(bare):
        byte, line = ord(wrong[0]) - 0xDC00, bare.count("\n", 0, wrong.start()) + 1
        raise XmlError(
            f"line {line}: byte 0x{byte:02x} is not {encoding} text: declare the file's encoding in its "
            'first line, as in <?xml version="1.0" encoding="GBK"?>'
        )
    return bare, notes


def unicode_of(data: bytes) -> tuple[str, int]:
    """Return the encoding that a file's first bytes show, UTF-8 if none, and the length of its mark."""
    for mark, name in _MARKS.items():
        if data.startswith(mark):
            return name, len(mark)
    # In ASCII text encoded as UTF-16, every other byte is zero.
    head = data[:64]
    for name, zeros, letters in (
        ("utf-16-le", head[1::2], head[::2]),
        ("utf-16-be", head[::2], head[1::2]),
    ):
        if len(head) > 3 and not any(zeros) and all(letters):
            return name, 0
    return "utf-8", 0


def _decoded(data: bytes) -> tuple[str, str]:
    """Return the text, with lone surrogates for bytes that the encoding does not have, and the encoding."""
    name, mark = unicode_of(data)
    if mark or name != "utf-8":
        return data[mark:].decode(name, "surrogateescape" if name == "utf-8" else "replace"), name
    declared = _DECLARED.match(data)
    name = declared[1].decode("ascii", "replace").lower() if declared else "utf-8"
    if name.startswith(("utf-16", "utf-32", "ucs-")):
        name = "utf-8"  # it has one byte a character: another program has converted it
    if not _ENCODING.fullmatch(name):
        raise XmlError(f"declares the encoding {name!r}, which is unknown: convert the file to UTF-8")
    return data.decode(_WIDER.get(name, name), "surrogateescape"), name


def _parts(text: str) -> Iterator[tuple[bool, str]]:
    """Yield the text in parts: comments (true), and the text between them."""
    at = begin = 0
    while (found := _BEGIN.search(text, at)) is not None:
        end = text.find(_ENDS[found[0]], found.end())
        if end < 0:
            break
        at = end + len(_ENDS[found[0]])
        if found[0] == "<!--":
            yield False, text[begin : found.start()]
            yield True, text[found.start() : at]
            begin = at
    yield False, text[begin:]


def _refuse_entity(*_: object) -> NoReturn:
    raise XmlError("has a DOCTYPE with declarations, or an ENTITY, which can expand without limit; remove it")
