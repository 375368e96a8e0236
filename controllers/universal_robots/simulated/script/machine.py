"""Stack machine that executes a program of URScript with its threads, within limits of time and memory.

A tick executes each thread until it waits: for the next tick (`sync`), for a time, or for the arm. A function
of the controller returns its value, or a `Wait`. A program without waits is ended, as on a real controller.
"""

import itertools
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, TypeAlias

from controllers.universal_robots.simulated.script.code import Function, Program
from controllers.universal_robots.simulated.script.errors import ScriptError

_MOST_INSTRUCTIONS = 20_000  # of all threads in a tick
_MOST_THREADS = 32
_MOST_FRAMES = 64
_MOST_VARIABLES = 20_000
_MOST_ITEMS = 100  # of a list, with those of its lists
_LONGEST_TEXT = 2000
_LARGEST_INTEGER = 2**31

Value: TypeAlias = Any
"""A number, a boolean, a text, a tuple (list), a Pose, or None."""


class Pose(tuple[Value, ...]):
    """A pose: position [m] and rotation vector [rad]."""

    __slots__ = ()


@dataclass(frozen=True)
class Wait:
    """End of a wait: `over` is called in each tick, and returns the function's value in a tuple, or None."""

    over: Callable[[float], tuple[Value, ...] | None]


ControllerFunction: TypeAlias = Callable[..., Value]
"""Called with the machine, the number of the thread, and the script's arguments."""


@dataclass
class _Frame:
    function: Function
    variables: dict[str, Value]
    at: int = 0


@dataclass
class _Thread:
    number: int
    frames: list[_Frame]
    stack: list[Value] = field(default_factory=list)
    wait: Wait | None = None


class Machine:
    """Execution of one program.

    Args:
        functions: Functions of the controller by their names.

    Attributes:
        now_s: Time of the tick.
        line: Line that was executed last.
    """

    def __init__(self, program: Program, functions: Mapping[str, ControllerFunction]) -> None:
        self.program = program
        self._functions = functions
        self._globals: dict[str, Value] = {}
        self._numbers = itertools.count(1)
        self._threads: dict[int, _Thread] = {}
        self._left = 0
        self._variables = 0
        self.now_s = 0.0
        self.line = 0
        self._main = self._start(program.main, self._globals)

    @property
    def ended(self) -> bool:
        """True once the main function has ended, which ends its threads."""
        return self._main not in self._threads

    def alive(self, thread: int) -> bool:
        """Return whether a thread runs."""
        return thread in self._threads

    def tick(self, now_s: float) -> None:
        """Execute each thread until it waits.

        Raises:
            ScriptError: If the program cannot go on.
        """
        self.now_s = now_s
        self._left = _MOST_INSTRUCTIONS
        for thread in tuple(self._threads.values()):
            if self.ended:
                return
            if thread.number in self._threads:
                self._run(thread)

    def halt(self) -> None:
        """End all threads."""
        self._threads.clear()

    # ---------------------------------------------------------------- threads

    def _start(self, function: Function, variables: dict[str, Value]) -> int:
        if len(self._threads) >= _MOST_THREADS:
            raise ScriptError(f"more than {_MOST_THREADS} threads", self.line)
        number = next(self._numbers)
        self._threads[number] = _Thread(number, [_Frame(function, variables)])
        return number

    def _run(self, thread: _Thread) -> None:
        if thread.wait is not None:
            try:
                value = thread.wait.over(self.now_s)
            except ScriptError as error:
                frame = thread.frames[-1]
                raise ScriptError(error.text, frame.function.code[frame.at - 1].line) from None
            if value is None:
                return
            thread.wait = None
            thread.stack += value
        while thread.wait is None and thread.number in self._threads:
            self._left -= 1
            frame = thread.frames[-1]
            step = frame.function.code[frame.at]
            frame.at += 1
            self.line = step.line
            if self._left < 0:
                raise ScriptError("it does not wait: sync() is missing in a loop", step.line)
            try:
                _STEPS[step.name](self, thread, frame, step.argument)
            except ScriptError as error:
                raise ScriptError(error.text, error.line or step.line) from None
            except (ArithmeticError, ValueError, TypeError, IndexError) as error:
                raise ScriptError(str(error) or type(error).__name__, step.line) from None

    # ---------------------------------------------------------- variables, calls

    def _store(self, variables: dict[str, Value], name: str, value: Value) -> None:
        if name not in variables:
            self._variables += 1
            if self._variables > _MOST_VARIABLES:
                raise ScriptError(f"more than {_MOST_VARIABLES} variables")
        variables[name] = value

    def _scope(self, frame: _Frame, name: str) -> dict[str, Value]:
        return self._globals if name not in frame.variables and name in self._globals else frame.variables

    def _load(self, thread: _Thread, frame: _Frame, name: str) -> None:
        scope = self._scope(frame, name)
        if name not in scope:
            raise ScriptError(f"{name} has no value")
        thread.stack.append(scope[name])

    def _store_item(self, thread: _Thread, frame: _Frame, argument: tuple[str, int]) -> None:
        name, count = argument
        value = thread.stack.pop()
        places = thread.stack[-count:]
        del thread.stack[-count:]
        scope = self._scope(frame, name)
        if name not in scope:
            raise ScriptError(f"{name} has no value")
        scope[name] = _checked(_replaced(scope[name], places, value))

    def _parameters(self, function: Function, thread: _Thread, count: int, names: tuple[str, ...]) -> Any:
        given = _popped(thread.stack, count + len(names))
        if count > len(function.parameters):
            raise ScriptError(f"{function.name} has {len(function.parameters)} parameters")
        variables: dict[str, Value] = {}
        for name, value in zip((*function.parameters[:count], *names), given, strict=True):
            if name not in function.parameters or name in variables:
                raise ScriptError(f"{function.name} has no further parameter {name}")
            self._store(variables, name, value)
        if missing := [each for each in function.parameters[: function.needed] if each not in variables]:
            raise ScriptError(f"{function.name} needs {missing[0]}")
        return variables

    def _call(self, thread: _Thread, frame: _Frame, argument: tuple[str, int, tuple[str, ...]]) -> None:
        name, count, names = argument
        if (function := self.program.functions.get(name)) is not None:
            if len(thread.frames) >= _MOST_FRAMES:
                raise ScriptError(f"more than {_MOST_FRAMES} calls in each other")
            thread.frames.append(_Frame(function, self._parameters(function, thread, count, names)))
            return
        built_in = self._functions.get(name)
        if built_in is None:
            raise ScriptError(f"function {name} is unknown to this simulated controller")
        given = _popped(thread.stack, count + len(names))
        try:
            value = built_in(
                self, thread.number, *given[:count], **dict(zip(names, given[count:], strict=True))
            )
        except TypeError:
            raise ScriptError(f"the arguments of {name} do not fit") from None
        if isinstance(value, Wait):
            thread.wait = value
        else:
            thread.stack.append(_checked(value))

    def _run_thread(self, thread: _Thread, frame: _Frame, argument: tuple[str, int, tuple[str, ...]]) -> None:
        name, count, names = argument
        function = self.program.functions.get(name)
        if function is None:
            raise ScriptError(f"thread {name} is unknown")
        thread.stack.append(self._start(function, self._parameters(function, thread, count, names)))

    def _return(self, thread: _Thread, frame: _Frame, argument: None) -> None:
        thread.frames.pop()
        if frame.variables is not self._globals:
            self._variables -= len(frame.variables)
        if not thread.frames:
            self._threads.pop(thread.number, None)

    def _join(self, thread: _Thread, frame: _Frame, argument: None) -> None:
        number = thread.stack.pop()
        thread.wait = Wait(lambda now_s: None if number in self._threads else ())

    def _kill(self, thread: _Thread, frame: _Frame, argument: None) -> None:
        number = thread.stack.pop()
        killed = self._threads.pop(number, None) if isinstance(number, int) else None
        for each in killed.frames if killed is not None else ():
            self._variables -= len(each.variables)

    def _default(self, thread: _Thread, frame: _Frame, argument: tuple[str, int]) -> None:
        if argument[0] in frame.variables:
            frame.at = argument[1]

    def _branch(self, thread: _Thread, frame: _Frame, at: int) -> None:
        if not _truth(thread.stack.pop()):
            frame.at = at


def _short_circuit(keeps: bool) -> Callable[[Machine, _Thread, _Frame, int], None]:
    def step(machine: Machine, thread: _Thread, frame: _Frame, at: int) -> None:
        if _truth(thread.stack[-1]) is keeps:
            frame.at = at
        else:
            thread.stack.pop()

    return step


def _popped(stack: list[Value], count: int) -> list[Value]:
    found = stack[len(stack) - count :]
    del stack[len(stack) - count :]
    return found


def _truth(value: Value) -> bool:
    if not isinstance(value, bool | int | float):
        raise ScriptError("a condition is True or False")
    return bool(value)


def _size(value: Value) -> int:
    return sum(map(_size, value)) + 1 if isinstance(value, tuple) else 1


def _checked(value: Value) -> Value:
    """Return a value that is not too large.

    Raises:
        ScriptError: If it is.
    """
    if isinstance(value, tuple) and _size(value) > _MOST_ITEMS + 1:
        raise ScriptError(f"a list has at most {_MOST_ITEMS} items")
    if isinstance(value, str) and len(value) > _LONGEST_TEXT:
        raise ScriptError(f"a text has at most {_LONGEST_TEXT} characters")
    if type(value) is int and abs(value) > _LARGEST_INTEGER:
        return float(value)
    return value


def _place(items: Value, place: Value) -> int:
    if not isinstance(items, tuple) or isinstance(place, bool) or not isinstance(place, int | float):
        raise ScriptError("an index belongs to a list, and is a number")
    if not 0 <= place < len(items):
        raise ScriptError(f"index {place:g} of a list with {len(items)} items")
    return int(place)


def _replaced(items: Value, places: list[Value], value: Value) -> Value:
    place = _place(items, places[0])
    inner = value if len(places) == 1 else _replaced(items[place], places[1:], value)
    return type(items)((*items[:place], inner, *items[place + 1 :]))


def _number(value: Value) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ScriptError(f"expected a number, not {text_of(value)[:40]}")
    return value


def _arithmetic(name: str, left: Value, right: Value) -> Value:
    if isinstance(left, tuple) or isinstance(right, tuple):
        kind = Pose if isinstance(left, Pose) or isinstance(right, Pose) else tuple
        if isinstance(left, tuple) and isinstance(right, tuple):
            if len(left) != len(right):
                raise ScriptError(f"lists of {len(left)} and {len(right)} items")
            return kind([_arithmetic(name, a, b) for a, b in zip(left, right, strict=True)])
        if isinstance(left, tuple):
            return kind([_arithmetic(name, each, right) for each in left])
        return kind([_arithmetic(name, left, each) for each in right])
    a, b = _number(left), _number(right)
    match name:
        case "+":
            return a + b
        case "-":
            return a - b
        case "*":
            return a * b
        case "/":
            return a / b
        case _:
            return math.fmod(a, b) if isinstance(a + b, float) else int(math.fmod(a, b))


_COMPARISONS: Mapping[str, Callable[[Any, Any], bool]] = MappingProxyType(
    {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
)


def _binary(machine: Machine, thread: _Thread, frame: _Frame, name: str) -> None:
    right, left = thread.stack.pop(), thread.stack.pop()
    if name == "==" or name == "!=":
        value: Value = (left == right) is (name == "==")
    elif name == "xor":
        value = _truth(left) is not _truth(right)
    elif name in _COMPARISONS:
        value = _COMPARISONS[name](_number(left), _number(right))
    else:
        value = _arithmetic(name, left, right)
    thread.stack.append(_checked(value))


def _minus(machine: Machine, thread: _Thread, frame: _Frame, argument: None) -> None:
    thread.stack.append(_arithmetic("*", thread.stack.pop(), -1))


def _not(machine: Machine, thread: _Thread, frame: _Frame, argument: None) -> None:
    thread.stack.append(not _truth(thread.stack.pop()))


def _item(machine: Machine, thread: _Thread, frame: _Frame, argument: None) -> None:
    place, items = thread.stack.pop(), thread.stack.pop()
    thread.stack.append(items[_place(items, place)])


def _list(machine: Machine, thread: _Thread, frame: _Frame, count: int) -> None:
    thread.stack.append(_checked(tuple(_popped(thread.stack, count))))


def _pose(machine: Machine, thread: _Thread, frame: _Frame, count: int) -> None:
    if count != 6:
        raise ScriptError("a pose has 6 numbers")
    thread.stack.append(Pose(map(_number, _popped(thread.stack, count))))


def _pop(machine: Machine, thread: _Thread, frame: _Frame, argument: None) -> None:
    thread.stack.pop()


def _jump(machine: Machine, thread: _Thread, frame: _Frame, at: int) -> None:
    frame.at = at


_STEPS: Mapping[str, Callable[[Machine, _Thread, _Frame, Any], None]] = MappingProxyType(
    {
        "constant": lambda machine, thread, frame, value: thread.stack.append(value),
        "pop": _pop,
        "load": Machine._load,
        "store": lambda machine, thread, frame, name: machine._store(
            machine._scope(frame, name), name, thread.stack.pop()
        ),
        "store local": lambda machine, thread, frame, name: machine._store(
            frame.variables, name, thread.stack.pop()
        ),
        "store global": lambda machine, thread, frame, name: machine._store(
            machine._globals, name, thread.stack.pop()
        ),
        "store item": Machine._store_item,
        "item": _item,
        "list": _list,
        "pose": _pose,
        "minus": _minus,
        "not": _not,
        "binary": _binary,
        "jump": _jump,
        "jump if false": Machine._branch,
        "jump if given": Machine._default,
        "jump or drop if false": _short_circuit(False),
        "jump or drop if true": _short_circuit(True),
        "call": Machine._call,
        "run": Machine._run_thread,
        "join": Machine._join,
        "kill": Machine._kill,
        "return": Machine._return,
        "halt": lambda machine, thread, frame, _: machine.halt(),
    }
)


def text_of(value: Value) -> str:
    """Return a value as `to_str` and `textmsg` write it."""
    if isinstance(value, Pose):
        return f"p[{', '.join(map(text_of, value))}]"
    if isinstance(value, tuple):
        return f"[{', '.join(map(text_of, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)
