"""Compiler of URScript to instructions of a stack machine: flat, so that no script nests the interpreter.

Supported: def, thread and sec with default values, if, while, return, break, continue, halt, local, global,
run, join, kill, critical sections, numbers, booleans, strings, lists, poses, index and arithmetic. Switch,
structs and methods are not.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

from controllers.universal_robots.simulated.script.errors import ScriptError

LONGEST_SOURCE = 100_000
"""Characters of a script."""
_DEEPEST = 40

_TOKENS = re.compile(
    r"""(?P<space>[ \t\r\f]+|\#[^\n]*)
      | (?P<newline>\n)
      | (?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)
      | (?P<string>"[^"\n]*"|'[^'\n]*')
      | (?P<name>[A-Za-z_]\w*)
      | (?P<operator>==|!=|<=|>=|[-+*/%<>=()\[\],:])""",
    re.VERBOSE | re.ASCII,
)
_KEYWORDS = frozenset(
    {
        *("def", "thread", "sec", "end", "if", "elif", "else", "while", "return", "break", "continue"),
        *("halt", "pass", "local", "global", "run", "join", "kill", "enter_critical", "exit_critical"),
        *("and", "or", "xor", "not", "True", "False"),
    }
)
_BINARY: Mapping[str, int] = MappingProxyType(
    {
        **dict.fromkeys(("or", "xor"), 1),
        "and": 2,
        **dict.fromkeys(("==", "!=", "<", "<=", ">", ">="), 4),
        **dict.fromkeys("+-", 5),
        **dict.fromkeys("*/%", 6),
    }
)
_NOT, _MINUS = 3, 7


class Instruction(NamedTuple):
    """An instruction with its argument, and the line of its source."""

    name: str
    argument: Any
    line: int


@dataclass
class Function:
    """A function, or a thread, of a program."""

    name: str
    parameters: list[str] = field(default_factory=list)
    needed: int = 0
    code: list[Instruction] = field(default_factory=list)


@dataclass(frozen=True)
class Program:
    """A compiled program.

    Attributes:
        secondary: It runs in parallel to a main program, and cannot move the arm.
    """

    main: Function
    functions: Mapping[str, Function]
    secondary: bool = False

    @property
    def name(self) -> str:
        """Name of its main function."""
        return self.main.name


class _Token(NamedTuple):
    kind: str
    text: str
    line: int


def compile_script(source: str) -> Program:
    """Compile a program: one `def` or `sec`, or a single line.

    Raises:
        ScriptError: If it is not valid.
    """
    if len(source) > LONGEST_SOURCE:
        raise ScriptError(f"a script has at most {LONGEST_SOURCE} characters")
    return _Compiler(_tokens(source)).program()


def _tokens(source: str) -> list[_Token]:
    found: list[_Token] = []
    line, place, depth = 1, 0, 0
    while place < len(source):
        match = _TOKENS.match(source, place)
        if match is None:
            raise ScriptError(f"unexpected character {source[place]!r}", line)
        place = match.end()
        kind, text = match.lastgroup or "", match.group()
        if kind == "newline":
            if depth == 0:
                found.append(_Token("newline", "", line))
            line += 1
        elif kind != "space":
            depth += (text in "([") - (text in ")]") if kind == "operator" else 0
            if kind == "name" and text in _KEYWORDS:
                kind = "keyword"
            found.append(_Token(kind, text, line))
    return [*found, _Token("newline", "", line), _Token("end of the script", "", line)]


class _Compiler:
    def __init__(self, tokens: list[_Token]) -> None:
        self._tokens = tokens
        self._at = 0
        self._depth = 0
        self._functions: dict[str, Function] = {}
        self._code: list[Instruction] = []
        # Of each loop around: its begin, and the jumps to its end.
        self._loops: list[tuple[int, list[int]]] = []

    def program(self) -> Program:
        self._skip_newlines()
        if self._peek.text in ("def", "sec") and self._peek.kind == "keyword":
            secondary = self._peek.text == "sec"
            main = self._function(main=True)
        else:
            secondary, main = False, Function("line")
            main.code = self._compiled(self._statement)
        self._skip_newlines()
        if self._peek.kind != "end of the script":
            self._fail("expected the end of the script")
        return Program(main, self._functions, secondary)

    # ------------------------------------------------------------------ tokens

    @property
    def _peek(self) -> _Token:
        return self._tokens[self._at]

    def _next(self) -> _Token:
        token = self._tokens[self._at]
        self._at = min(self._at + 1, len(self._tokens) - 1)
        return token

    def _take(self, *texts: str) -> bool:
        if self._peek.text in texts and self._peek.kind in ("keyword", "operator"):
            self._next()
            return True
        return False

    def _need(self, text: str) -> None:
        if not self._take(text):
            self._fail(f"expected {text!r}")

    def _need_name(self) -> str:
        if self._peek.kind != "name":
            self._fail("expected a name")
        return self._next().text

    def _end_statement(self) -> None:
        # Controllers accept a further statement on the same line, which ur_rtde makes use of.
        if self._peek.kind == "newline":
            self._next()
        elif self._peek.kind not in ("name", "keyword"):
            self._fail("expected the end of the line")

    def _skip_newlines(self) -> None:
        while self._peek.kind == "newline":
            self._next()

    def _fail(self, problem: str) -> None:
        token = self._peek
        raise ScriptError(f"unexpected {token.text or token.kind!r}: {problem}", token.line)

    def _deeper(self, call: Callable[[], None]) -> None:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise ScriptError(f"more than {_DEEPEST} levels", self._peek.line)
        call()
        self._depth -= 1

    # -------------------------------------------------------------------- code

    def _emit(self, name: str, argument: Any = None) -> int:
        self._code.append(Instruction(name, argument, self._peek.line))
        return len(self._code) - 1

    def _land(self, jump: int) -> None:
        self._code[jump] = self._code[jump]._replace(argument=len(self._code))

    def _compiled(self, parse: Callable[[], None]) -> list[Instruction]:
        """Return the code of a part in a new list."""
        outer, loops = self._code, self._loops
        self._code, self._loops = [], []
        parse()
        self._emit("constant", None)
        self._emit("return")
        inner, self._code, self._loops = self._code, outer, loops
        return inner

    # -------------------------------------------------------------- statements

    def _function(self, *, main: bool = False) -> Function:
        self._next()
        function = Function(self._need_name())

        def parse() -> None:
            self._need("(")
            while not self._take(")"):
                name = self._need_name()
                function.parameters.append(name)
                if self._take("="):
                    given = self._emit("jump if given")
                    self._expression()
                    self._emit("store local", name)
                    self._code[given] = self._code[given]._replace(argument=(name, len(self._code)))
                else:
                    function.needed = len(function.parameters)
                if self._peek.text != ")":
                    self._need(",")
            self._need(":")
            self._block("end")
            self._need("end")

        function.code = self._compiled(parse)
        if not main:
            self._functions[function.name] = function
        return function

    def _block(self, *ends: str) -> None:
        self._skip_newlines()
        while not (self._peek.kind == "keyword" and self._peek.text in ends):
            self._deeper(self._statement)
            self._skip_newlines()

    def _statement(self) -> None:
        token = self._peek
        if token.kind == "keyword" and (parse := getattr(self, f"_{token.text}", None)) is not None:
            parse()
        else:
            self._assignment_or_call()
        self._end_statement()

    def _def(self) -> None:
        self._function()

    _thread = _sec = _def

    def _if(self) -> None:
        ends: list[int] = []
        while self._take("if", "elif"):
            self._expression()
            self._need(":")
            otherwise = self._emit("jump if false")
            self._block("elif", "else", "end")
            ends.append(self._emit("jump"))
            self._land(otherwise)
        if self._take("else"):
            self._need(":")
            self._block("end")
        self._need("end")
        for jump in ends:
            self._land(jump)

    def _while(self) -> None:
        self._next()
        begin = len(self._code)
        self._expression()
        self._need(":")
        out = self._emit("jump if false")
        self._loops.append((begin, [out]))
        self._block("end")
        self._need("end")
        self._emit("jump", begin)
        for jump in self._loops.pop()[1]:
            self._land(jump)

    def _break(self) -> None:
        if not self._loops:
            self._fail("break belongs in a loop")
        self._next()
        self._loops[-1][1].append(self._emit("jump"))

    def _continue(self) -> None:
        if not self._loops:
            self._fail("continue belongs in a loop")
        self._next()
        self._emit("jump", self._loops[-1][0])

    def _return(self) -> None:
        self._next()
        if self._peek.kind == "newline":
            self._emit("constant", None)
        else:
            self._expression()
        self._emit("return")

    def _halt(self) -> None:
        self._next()
        self._emit("halt")

    def _pass(self) -> None:
        self._next()

    _enter_critical = _exit_critical = _pass

    def _local(self) -> None:
        where = self._next().text
        name = self._need_name()
        if self._take("="):
            self._skip_newlines()
            self._expression()
        else:
            self._emit("constant", None)
        self._emit(f"store {where}", name)

    _global = _local

    def _join(self) -> None:
        name = self._next().text
        self._expression()
        self._emit(name)

    _kill = _join

    def _assignment_or_call(self) -> None:
        name, following = self._peek, self._tokens[self._at + 1]
        if name.kind == "name" and following.text == "=" and following.kind == "operator":
            self._at += 2
            self._skip_newlines()
            self._expression()
            self._emit("store", name.text)
            return
        if name.kind == "name" and following.text == "[" and (count := self._indices_before_assignment()):
            self._next()
            for _ in range(count):
                self._need("[")
                self._expression()
                self._need("]")
            self._need("=")
            self._expression()
            self._emit("store item", (name.text, count))
            return
        self._expression()
        self._emit("pop")

    def _indices_before_assignment(self) -> int:
        """Return the number of indices, if an equals sign follows them; else 0."""
        at, depth, count = self._at + 1, 0, 0
        while True:
            text = self._tokens[at].text if self._tokens[at].kind == "operator" else ""
            depth += (text in ("[", "(")) - (text in ("]", ")"))
            count += depth == 0 and text == "]"
            at += 1
            if self._tokens[at].kind in ("newline", "end of the script"):
                return 0
            if depth == 0 and self._tokens[at].text != "[":
                return count if self._tokens[at].text == "=" else 0

    # ------------------------------------------------------------- expressions

    def _expression(self, least: int = 0) -> None:
        self._deeper(lambda: self._operand(least))
        while True:
            token = self._peek
            rank = _BINARY.get(token.text, -1) if token.kind in ("keyword", "operator") else -1
            if rank <= least:
                return
            self._next()
            # An operator at the end of a line continues it.
            self._skip_newlines()
            if token.text in ("and", "or"):
                jump = self._emit(f"jump or drop if {'false' if token.text == 'and' else 'true'}")
                self._expression(rank)
                self._land(jump)
            else:
                self._expression(rank)
                self._emit("binary", token.text)

    def _operand(self, least: int) -> None:
        if self._take("not"):
            self._expression(_NOT)
            self._emit("not")
        elif self._take("-"):
            self._expression(_MINUS)
            self._emit("minus")
        elif self._take("+"):
            self._expression(_MINUS)
        else:
            self._primary()
            while self._take("["):
                self._expression()
                self._need("]")
                self._emit("item")

    def _primary(self) -> None:
        token = self._next()
        match token.kind, token.text:
            case "number", text:
                self._emit("constant", int(text) if text.isdigit() and len(text) < 10 else float(text))
            case "string", text:
                self._emit("constant", text[1:-1])
            case "keyword", "True" | "False":
                self._emit("constant", token.text == "True")
            case "keyword", "run":
                name = self._need_name()
                self._need("(")
                self._emit("run", (name, *self._arguments()))
            case "operator", "(":
                self._expression()
                self._need(")")
            case "operator", "[":
                self._emit("list", self._items())
            case "name", "p" if self._take("["):
                self._emit("pose", self._items())
            case "name", name if self._take("("):
                self._emit("call", (name, *self._arguments()))
            case "name", name:
                self._emit("load", name)
            case _:
                self._at -= 1
                self._fail("expected a value")

    def _items(self) -> int:
        """Compile the items of a list after its bracket; return their number."""
        count = 0
        while not self._take("]"):
            self._expression()
            count += 1
            if self._peek.text != "]":
                self._need(",")
        return count

    def _arguments(self) -> tuple[int, tuple[str, ...]]:
        """Compile arguments after the parenthesis; return the number of those without a name, and names."""
        count, names = 0, []
        while not self._take(")"):
            following = self._tokens[self._at + 1]
            if self._peek.kind == "name" and following.text == "=" and following.kind == "operator":
                names.append(self._next().text)
                self._next()
            elif names:
                self._fail("expected a name, as in the argument before")
            else:
                count += 1
            self._expression()
            if self._peek.text != ")":
                self._need(",")
        return count, tuple(names)
