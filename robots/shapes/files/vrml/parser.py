"""Parser of VRML97 tokens to a scene: nodes with fields; USE is resolved, PROTO is kept.

    scene     = *( node | PROTO | EXTERNPROTO | ROUTE )
    node      = [ DEF name ] type "{" *( field value | field IS name | PROTO | ROUTE | script interface ) "}"
              | USE name
    value     = number... | string | TRUE | FALSE | NULL | node | "[" *value "]"

The parser needs no table of field types: a value's syntax shows its kind, and a field's type is checked
when the node is drawn (`robots.shapes.files.vrml.drawing`). So unknown nodes are harmless.

Source: ISO/IEC 14772-1:1997, annex A.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from sys import intern

import numpy as np

from robots.schema.errors import ShapeError
from robots.shapes.files.vrml.lexer import Kind, Lexer
from robots.shapes.files.vrml.source import Source
from robots.shapes.geometry import FloatArray

# A scene that is nested deeper is damaged, or meant to exhaust the stack.
MAX_DEPTH = 120


@dataclass(frozen=True, slots=True)
class Is:
    """`IS name`: a reference to a field of the enclosing PROTO."""

    name: str


@dataclass(eq=False, slots=True)
class Node:
    """A node; every USE of its name refers to the same object.

    Attributes:
        position: Position of the node's type in the source's text.
        name: The name in its DEF; empty without one.
        proto: The PROTO that it instantiates; None for a node of the standard.
    """

    type: str
    fields: dict[str, "Value"]
    source: Source
    position: int
    name: str = ""
    proto: "Proto | None" = None

    def error(self, reason: str) -> ShapeError:
        """Return an error with the node's place and type."""
        return self.source.error(self.position, f"{self.type}: {reason}")

    def warn(self, warning: str, *, once: str = "") -> None:
        """Record a warning with the node's place and type."""
        self.source.warn(self.position, f"{self.type}: {warning}", once=once)


@dataclass(eq=False, slots=True)
class Proto:
    """A PROTO or EXTERNPROTO.

    Attributes:
        defaults: Default values of its fields.
        body: Its nodes, of which the first is drawn; an EXTERNPROTO's body is in another file.
        urls: Addresses of an EXTERNPROTO; None for a PROTO.
        target: The PROTO found for an EXTERNPROTO.
        reason_missing: Why no PROTO was found for an EXTERNPROTO.
        uses: The PROTOs instantiated in its body.
    """

    name: str
    source: Source
    position: int
    defaults: dict[str, "Value"] = field(default_factory=dict)
    body: list[Node] = field(default_factory=list)
    urls: list[str] | None = None
    target: "Proto | None" = None
    reason_missing: str = "has no address"
    uses: list["Proto"] = field(default_factory=list)


Value = FloatArray | list[str] | list[Node] | bool | Is
_VALUED = ("field", "exposedField")
_ACCESS = ("eventIn", "eventOut", *_VALUED)


@dataclass(frozen=True, eq=False)
class Scene:
    """A file's root nodes, its PROTOs by name in file order, and the EXTERNPROTOs of all scopes."""

    source: Source
    nodes: list[Node]
    protos: dict[str, Proto]
    externals: list[Proto]


def parse_vrml(source: Source, progress: Callable[[float], None] | None = None) -> Scene:
    """Parse a VRML 2.0 text.

    Raises:
        ShapeError: If it is not VRML 2.0; the error has the line and column.
    """
    parser = _Parser(Lexer(source, progress), {}, {}, [])
    return Scene(source, parser.statements(""), parser.protos, parser.externals)


@dataclass
class _Parser:
    """A recursive-descent parser of one scope of DEF and PROTO names."""

    lexer: Lexer
    names: dict[str, Node]
    protos: dict[str, Proto]
    externals: list[Proto]
    inside: Proto | None = None
    depth: int = 0

    def statements(self, end: str) -> list[Node]:
        """Parse nodes and PROTOs up to a mark, or to the end of the file if `end` is empty."""
        lexer, nodes = self.lexer, list[Node]()
        while True:
            if lexer.kind is Kind.END:
                if end:
                    raise lexer.expected(f"'{end}'")
                return nodes
            if lexer.kind is Kind.MARK:
                if lexer.text == end:
                    lexer.advance()
                    return nodes
                if not end and lexer.text in "}]":
                    lexer.source.warn(lexer.start, f"an extra {lexer.text!r}; skipped")
                    lexer.advance()
                    continue
            if not self.declaration():
                nodes += self.node()

    def declaration(self) -> bool:
        """Parse a PROTO, EXTERNPROTO or ROUTE if one begins here; return whether one did."""
        lexer = self.lexer
        if not lexer.is_word("PROTO", "EXTERNPROTO", "ROUTE"):
            return False
        keyword = lexer.text
        lexer.advance()
        if keyword == "ROUTE":  # nothing moves in a shape
            self.name("a node and its event")
            if not lexer.is_word("TO"):
                raise lexer.expected("TO")
            lexer.advance()
            self.name("a node and its event")
        else:
            self.proto(external=keyword == "EXTERNPROTO")
        return True

    def proto(self, *, external: bool) -> None:
        lexer = self.lexer
        proto = Proto("", lexer.source, lexer.start)
        proto.name = self.name("a PROTO's name")
        self.mark("[", "before a PROTO's fields")
        while not lexer.is_mark("]"):
            if not lexer.is_word(*_ACCESS):
                raise lexer.expected("eventIn, eventOut, field, exposedField or ']'")
            valued = lexer.text in _VALUED and not external
            lexer.advance()
            self.name("a field's type")
            field_name = self.name("a field's name")
            if valued:
                proto.defaults[field_name] = self.value(field_name)
        lexer.advance()
        if external:
            urls = self.value(proto.name)
            proto.urls = [url for url in urls if isinstance(url, str)] if isinstance(urls, list) else []
            self.externals.append(proto)
        else:
            # DEF names inside a PROTO are local; PROTOs defined outside can be used inside.
            inner = _Parser(lexer, {}, dict(self.protos), self.externals, proto, self.depth + 1)
            inner.check_depth(proto.position)
            self.mark("{", "before a PROTO's body")
            proto.body = inner.statements("}")
        self.protos[proto.name] = proto

    def check_depth(self, position: int) -> None:
        if self.depth > MAX_DEPTH:
            raise self.lexer.source.error(position, f"nested deeper than {MAX_DEPTH}")

    def node(self) -> list[Node]:
        """Parse a node; return it in a list, which is empty for NULL and for an undefined USE."""
        lexer = self.lexer
        if lexer.kind is not Kind.WORD:
            raise lexer.expected("a node")
        word, position = lexer.text, lexer.start
        lexer.advance()
        if word == "NULL":
            return []
        if word == "USE":
            name = self.name("a name after USE")
            if name in self.names:
                return [self.names[name]]
            lexer.source.warn(position, f"USE {name}: no node was DEFined with that name before; left out")
            return []
        name = ""
        if word == "DEF":
            name = self.name("a name after DEF")
            if lexer.kind is not Kind.WORD:
                raise lexer.expected("a node")
            word, position = lexer.text, lexer.start
            lexer.advance()
        # Interned, so that nodes of one type share the string.
        node = Node(intern(word), {}, lexer.source, position, name, self.protos.get(word))
        if node.proto is not None and self.inside is not None:
            self.inside.uses.append(node.proto)
        self.mark("{", f"after {word!r}")
        self.depth += 1
        self.check_depth(position)
        self.body(node)
        self.depth -= 1
        # Only now, so that a node cannot USE itself.
        if name:
            self.names[name] = node
        return [node]

    def body(self, node: Node) -> None:
        lexer = self.lexer
        while not lexer.is_mark("}"):
            if lexer.kind is not Kind.WORD:
                raise lexer.expected(f"a field of {node.type} or '}}'")
            if self.declaration():
                continue
            if lexer.text in _ACCESS:
                self.script_interface()
                continue
            name = lexer.text
            lexer.advance()
            node.fields[intern(name)] = self.value(name)
        lexer.advance()

    def script_interface(self) -> None:
        valued = self.lexer.text in _VALUED
        self.lexer.advance()
        self.name("a field's type")
        name = self.name("a field's name")
        if valued or self.lexer.is_word("IS"):
            self.value(name)

    def value(self, of: str) -> Value:
        """Parse the value of the field `of`."""
        lexer = self.lexer
        if lexer.kind is Kind.NUMBERS:
            return np.array(lexer.numbers())
        if lexer.kind is Kind.WORD:
            if lexer.text in ("TRUE", "FALSE", "true", "false"):
                value = lexer.text.upper() == "TRUE"
                lexer.advance()
                return value
            if lexer.text == "IS":
                lexer.advance()
                return Is(self.name("a name after IS"))
            return self.node()
        if lexer.kind is Kind.STRING:
            text = lexer.text
            lexer.advance()
            return [text]
        if lexer.is_mark("["):
            listed = lexer.number_list()
            return self.list_value() if listed is None else listed
        raise lexer.expected(f"a value of {of}")

    def list_value(self) -> Value:
        lexer, opening = self.lexer, self.lexer.start
        lexer.advance()
        strings: list[str] = []
        nodes: list[Node] = []
        while not lexer.is_mark("]"):
            if lexer.kind is Kind.END:
                raise lexer.source.error(opening, "this '[' is never closed")
            if lexer.kind is Kind.STRING:
                strings.append(lexer.text)
                lexer.advance()
            elif lexer.is_word("TRUE", "FALSE"):  # no node that is drawn has a list of booleans
                lexer.advance()
            elif not self.declaration():
                nodes += self.node()
        lexer.advance()
        return strings or nodes

    def name(self, what: str) -> str:
        """Parse a name, including invalid ones that exporters write, such as 1-FACES or 12."""
        lexer = self.lexer
        if lexer.kind is Kind.NUMBERS and len(lexer.text.split()) > 1:
            raise lexer.expected(what)
        if lexer.kind not in (Kind.WORD, Kind.NUMBERS):
            raise lexer.expected(what)
        name = lexer.text
        if name[0].isdigit():
            lexer.source.warn(
                lexer.start, f"the name {name[:40]!r} begins with a digit; accepted", once="digit"
            )
        lexer.advance()
        return name

    def mark(self, mark: str, where: str) -> None:
        if not self.lexer.is_mark(mark):
            raise self.lexer.expected(f"'{mark}' {where}")
        self.lexer.advance()
