"""Writer of RTDE inputs on a connection of its own, without I/O.

sent                         answer
-----------------------      ----------------------------------------------------
protocol version 2           accepted
set up inputs                types; IN_USE: another client or a fieldbus has one
set up outputs, 1 Hz         types; a recipe that is not used
start                        accepted; from now on inputs are written
"""

from collections.abc import Sequence

from controllers.universal_robots.interfaces import rtde_messages as rtde
from controllers.universal_robots.interfaces.packages import Malformed
from controllers.universal_robots.interfaces.rtde_messages import (
    IN_USE,
    InputsSetUp,
    OutputsSetUp,
    PackageType,
    ProtocolVersionAnswered,
    Recipe,
    RtdeStream,
    StartAnswered,
)


class InputsWriter:
    """Writer of integer inputs on consecutive connections to one controller.

    The caller sends `connected()` on a new connection, and after each `receive` the bytes of `to_send()`. It
    closes a connection with a `problem`.

    Attributes:
        ready: Inputs can be written.
        failed: Name of the input that cannot be used, or "RTDE"; empty: nothing has failed.
        problem: Why not.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = tuple(names)
        self._reset()
        self.failed = self.problem = ""

    def _reset(self) -> None:
        self._stream = RtdeStream()
        self._recipe: Recipe | None = None
        self._to_send = b""
        self.ready = False

    def connected(self) -> bytes:
        """Forget the previous connection; return the first request of a new one."""
        self._reset()
        self.failed = self.problem = ""
        return rtde.request_protocol_version(2)

    def disconnected(self) -> None:
        """Note that the connection has ended; its problem stays."""
        self.ready = False

    def to_send(self) -> bytes:
        """Return the bytes to send now, once."""
        data, self._to_send = self._to_send, b""
        return data

    def receive(self, data: bytes) -> None:
        """Take the next bytes, split anywhere."""
        for package in self._stream.receive(data):
            if isinstance(package, Malformed):
                self._fail("RTDE", package.reason)
            elif package.type not in (PackageType.DATA, PackageType.TEXT):
                message = self._stream.decode(package)
                if isinstance(message, Malformed):
                    self._fail("RTDE", message.reason)
                else:
                    self._take(message)
            if self.problem:
                return

    def values(self, *values: int) -> bytes:
        """Return the package that writes all inputs, in the order of their names."""
        assert self._recipe is not None
        written = self._recipe.write(dict(zip(self._names, values, strict=True)))
        return rtde.package(PackageType.DATA, written)

    def _take(self, message: rtde.RtdeMessage) -> None:
        match message:
            case ProtocolVersionAnswered(accepted=True) if self._stream.version == 1:
                self._stream.version = 2
                self._to_send += rtde.set_up_inputs(self._names)
            case InputsSetUp(recipe_id, types) if self._stream.version == 2 and self._recipe is None:
                self._set_up(recipe_id, types)
            case OutputsSetUp(types=types) if self._recipe is not None and types == ("DOUBLE",):
                self._to_send += rtde.start()
            case StartAnswered(accepted=True) if self._recipe is not None:
                self.ready = True
            case _:
                self._fail("RTDE", f"{type(message).__name__} was not expected")

    def _set_up(self, recipe_id: int, types: Sequence[str]) -> None:
        if len(types) != len(self._names):
            self._fail("RTDE", f"{len(types)} types for {len(self._names)} inputs")
            return
        for name, kind in zip(self._names, types, strict=True):
            if kind != "INT32":
                problem = "another client or a fieldbus uses it" if kind == IN_USE else f"its type is {kind}"
                self._fail(name, problem)
                return
        self._recipe = Recipe(self._names, types, recipe_id)
        self._to_send += rtde.set_up_outputs(("timestamp",), 1.0)

    def _fail(self, name: str, problem: str) -> None:
        self.failed, self.problem, self.ready = name, problem, False
