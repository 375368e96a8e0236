"""VRML97 tokens to a scene: nodes with their fields, DEF and USE joined, PROTO kept.

    scene     = *( node | PROTO | EXTERNPROTO | ROUTE )
    node      = [ DEF name ] type "{" *( field value | field IS name | PROTO | ROUTE | script interface ) "}"
              | USE name
    value     = number... | string | TRUE | FALSE | NULL | node | "[" *value "]"

The grammar is read without a table of field types: a value shows what it is, and what a node
needs is asked for where it is drawn (`robots.meshes.vrml`). So unknown nodes do no harm.

Source: ISO/IEC 14772-1:1997, annex A.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robots.errors import MeshError
from robots.meshes.mesh import FloatArray
from robots.meshes.vrml_lexer import Kind, Lexer, Token

# A scene nested deeper is broken, or made to exhaust the stack.
MAX_DEPTH = 120


@dataclass(frozen=True)
class Is:
    """`IS name`: the value of a field of the PROTO around it."""

    name: str


@dataclass(eq=False)
class Node:
    """A node. The same object stands wherever USE names it."""

    type: str
    fields: dict[str, "Value"] = field(default_factory=dict)
    name: str = ""
    proto: "Proto | None" = None
    line: int = 0


@dataclass(eq=False)
class Proto:
    """A PROTO: default values of its fields, and its body, of which the first node is drawn."""

    name: str
    defaults: dict[str, "Value"]
    body: list[Node]


Value = FloatArray | list[str] | list[Node] | bool | Is
_NO_NODES: list[Node] = []
_ACCESS = {"eventIn", "eventOut", "field", "exposedField"}


@dataclass
class Scene:
    """A file's root nodes, and what was odd about it."""

    nodes: list[Node]
    warnings: list[str]


def parse_vrml(text: str, source: Path) -> Scene:
    """The scene of a VRML 2.0 text.

    Raises:
        MeshError: If it is not VRML 2.0, with the line.
    """
    lexer = Lexer(text, source)
    _check_header(text, source, lexer.warnings)
    parser = _Parser(lexer, {}, {})
    nodes = parser.statements(Kind.END)
    return Scene(nodes, lexer.warnings)


def _check_header(text: str, source: Path, warnings: list[str]) -> None:
    first = text.lstrip("\ufeff").split("\n", 1)[0].strip()
    words = first.replace("#", "# ", 1).split()
    if words[:3] == ["#", "VRML", "V1.0"]:
        raise MeshError(source, "is VRML 1.0; only VRML 2.0 is read: convert it first", place="line 1")
    if words[:3] != ["#", "VRML", "V2.0"]:
        if "{" not in text:
            raise MeshError(source, f"is not VRML 2.0: it begins {first[:40]!r}, not '#VRML V2.0 utf8'")
        warnings.append("line 1: no header '#VRML V2.0 utf8'; read as VRML 2.0 all the same")
    elif not first.startswith("#VRML"):
        warnings.append("line 1: a blank in the header, '# VRML'; it should be '#VRML V2.0 utf8'")


@dataclass
class _Parser:
    """Recursive descent; names of DEF and PROTO are those of the scope."""

    lexer: Lexer
    names: dict[str, Node]
    protos: dict[str, Proto]
    depth: int = 0

    def statements(self, end: Kind, mark: str = "") -> list[Node]:
        """Nodes and PROTOs up to the end of the file, or to a mark."""
        nodes: list[Node] = []
        while True:
            token = self.lexer.peek()
            if token.kind is end and (not mark or token.text == mark):
                self.lexer.next()
                return nodes
            if token.kind is Kind.END:
                raise self.lexer.error(f"the file ends where '{mark}' is missing", token)
            if not self.declaration(token):
                nodes.extend(self.node())

    def declaration(self, token: Token) -> bool:
        """Read a PROTO, EXTERNPROTO or ROUTE if one stands here."""
        if token.kind is not Kind.WORD or token.text not in ("PROTO", "EXTERNPROTO", "ROUTE"):
            return False
        self.lexer.next()
        if token.text == "ROUTE":
            for _ in range(3):  # from TO to: nothing moves in a mesh
                self.lexer.next()
        elif token.text == "PROTO":
            self.proto()
        else:
            raise self.lexer.error("EXTERNPROTO is not read; put the PROTO into the file", token)
        return True

    def proto(self) -> None:
        name = self.word("a PROTO's name")
        self.mark("[")
        defaults: dict[str, Value] = {}
        while self.lexer.peek().text != "]":
            access = self.word("eventIn, eventOut, field, exposedField or ']'")
            if access not in _ACCESS:
                raise self.lexer.error(f"{access!r} in a PROTO's interface")
            self.word("a field's type")
            field_name = self.word("a field's name")
            if access in ("field", "exposedField"):
                defaults[field_name] = self.value()
        self.mark("]")
        self.mark("{")
        # Names inside a PROTO are its own; PROTOs defined outside can be used inside.
        inner = _Parser(self.lexer, {}, dict(self.protos), self.depth + 1)
        self.protos[name] = Proto(name, defaults, inner.statements(Kind.MARK, "}"))

    def node(self) -> list[Node]:
        """A node, or none for NULL."""
        token = self.lexer.next()
        if token.kind is not Kind.WORD:
            what = "the file ends" if token.kind is Kind.END else repr(token.text)
            raise self.lexer.error(f"a node was expected, not {what}", token)
        if token.text == "NULL":
            return _NO_NODES
        if token.text == "USE":
            name = self.name("a name after USE")
            if name not in self.names:
                raise self.lexer.error(f"USE {name}: nothing of that name was DEFined before", token)
            return [self.names[name]]
        name = ""
        if token.text == "DEF":
            name = self.name("a name after DEF")
            token = self.lexer.next()
        node = Node(
            token.text, name=name, proto=self.protos.get(token.text), line=self.lexer.line(token.position)
        )
        self.mark("{", f"after {token.text!r}")
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise self.lexer.error(f"nodes nested deeper than {MAX_DEPTH}", token)
        self.body(node)
        self.depth -= 1
        # After the body: a node cannot USE itself.
        if name:
            self.names[name] = node
        return [node]

    def body(self, node: Node) -> None:
        while True:
            token = self.lexer.peek()
            if token.text == "}" and token.kind is Kind.MARK:
                self.lexer.next()
                return
            if self.declaration(token):
                continue
            if token.text in _ACCESS:
                self.script_interface()
                continue
            if token.kind is not Kind.WORD:
                what = "the file ends" if token.kind is Kind.END else repr(token.text)
                raise self.lexer.error(f"a field of {node.type} or '}}' was expected, not {what}", token)
            self.lexer.next()
            node.fields[token.text] = self.value()

    def script_interface(self) -> None:
        access = self.lexer.next().text
        self.word("a field's type")
        self.word("a field's name")
        if access in ("field", "exposedField") or self.lexer.peek().text == "IS":
            self.value()

    def value(self) -> Value:
        token = self.lexer.peek()
        if token.kind is Kind.MARK and token.text == "[":
            self.lexer.next()
            return self.list_value(token)
        if token.kind is Kind.NUMBER:
            numbers = []
            while self.lexer.peek().kind is Kind.NUMBER:
                numbers.append(_number(self.lexer.next().text))
            return np.array(numbers)
        if token.kind is Kind.STRING:
            return [self.lexer.next().text]
        if token.text in ("TRUE", "FALSE"):
            return self.lexer.next().text == "TRUE"
        if token.text == "IS":
            self.lexer.next()
            return Is(self.name("a name after IS"))
        return self.node()

    def list_value(self, opening: Token) -> Value:
        numbers = self.lexer.number_list()
        if numbers is not None:
            return numbers
        strings: list[str] = []
        nodes: list[Node] = []
        while True:
            token = self.lexer.peek()
            if token.text == "]" and token.kind is Kind.MARK:
                self.lexer.next()
                return strings or nodes
            if token.kind is Kind.END:
                raise self.lexer.error("a '[' that is never closed", opening)
            if token.kind is Kind.STRING:
                strings.append(self.lexer.next().text)
            elif token.kind is Kind.NUMBER:
                raise self.lexer.error("a list of numbers with something else in it", opening)
            elif not self.declaration(token):
                nodes.extend(self.node())

    def word(self, what: str) -> str:
        token = self.lexer.next()
        if token.kind is not Kind.WORD:
            raise self.lexer.error(f"{what} was expected, not {token.text or 'the end of the file'!r}", token)
        return token.text

    def name(self, what: str) -> str:
        """A name; exporters write some that VRML does not allow, such as 1-FACES or 12."""
        token = self.lexer.next()
        if token.kind not in (Kind.WORD, Kind.NUMBER):
            raise self.lexer.error(f"{what} was expected, not {token.text or 'the end of the file'!r}", token)
        if token.text[0].isdigit() and not any(
            "begins with a digit" in known for known in self.lexer.warnings
        ):
            line = self.lexer.line(token.position)
            self.lexer.warnings.append(
                f"line {line}: the name {token.text!r} begins with a digit; taken as it is"
            )
        return token.text

    def mark(self, mark: str, where: str = "") -> None:
        token = self.lexer.next()
        if token.kind is not Kind.MARK or token.text != mark:
            got = repr(token.text) if token.kind is not Kind.END else "the end of the file"
            raise self.lexer.error(f"'{mark}' was expected{' ' + where if where else ''}, not {got}", token)


def _number(text: str) -> float:
    return float(int(text, 16)) if "x" in text.lower() else float(text)
