"""A complete driver: a controller that sends its state as a line of JSON, and takes lines of JSON.

    from the controller   {"q": [0.1, 1.5], "state": "idle", "remote": true, "homed": true}     q in rad
                          {"no": "too fast"}                                                    a refusal
    to the controller     {"do": ["home"]}, {"do": ["stop"]}, {"do": ["reset"]}
                          {"do": [{"to": [0.2, 1.4]}]}                                          a target, rad

docs/controllers/own-driver.md explains each method.
"""

import json
from collections.abc import Callable, Hashable, Mapping, Sequence

from protocol_gateway.seam import (
    ALL,
    Activity,
    Capabilities,
    Channel,
    ControllerCommand,
    ControllerEvent,
    Effects,
    Home,
    JointsReceived,
    JointType,
    MalformedReceived,
    Mode,
    MoveAbsolute,
    Open,
    Refused,
    Report,
    Reset,
    Send,
    StatusReceived,
    Stop,
)
from protocol_gateway.seam.errors import CommandError, GatewaySettingsError

LINES = Channel(name="lines", carries=ALL)
LONGEST_LINE = 65_536

_WORDS: Mapping[type[ControllerCommand], str] = {Home: "home", Stop: "stop", Reset: "reset"}


class JsonLines:
    """Driver of JSON lines.

    Args:
        options: The table `driver` of the site file: `limit`, the longest line in bytes.

    Raises:
        GatewaySettingsError: If an option is unknown or invalid.
    """

    ports: frozenset[str] = frozenset()
    # Nothing is sent unless an operator commands something.
    requests_a_second = 0.0
    capabilities = Capabilities(commands=frozenset({Home, Stop, Reset, MoveAbsolute}))

    def __init__(
        self,
        joint_types: Sequence[JointType],
        codes: Mapping[int, str],
        *,
        relay: Callable[[bytes, bool, Hashable], None] | None = None,
        options: object = None,
    ) -> None:
        given = options if isinstance(options, Mapping) else {}
        if unknown := sorted(given.keys() - {"limit"}):
            raise GatewaySettingsError(f"driver {unknown[0]!r} is unknown; the only option is 'limit'")
        self._limit = given.get("limit", LONGEST_LINE)
        if not isinstance(self._limit, int) or self._limit < 1:
            raise GatewaySettingsError(f"driver limit = {self._limit!r}: must be a number of bytes above 0")
        self._joints = len(joint_types)
        self._rest, self._offset = b"", 0

    def started(self, now_s: float) -> Effects:
        """Connect to the site file's `controller`."""
        return (Open(LINES),)

    def opened(self, channel: Channel, now_s: float) -> Effects:
        """Begin to read; this controller needs no greeting."""
        self._rest, self._offset = b"", 0
        return ()

    def skipped(self, channel: Channel, now_s: float) -> Effects:
        """Go on with the next whole line."""
        self._rest = b""
        return ()

    def closed(self, channel: Channel, now_s: float) -> Effects:
        """Do nothing: the gateway connects again."""
        return ()

    def timer_ended(self, ended: Mapping[str, float], now_s: float) -> Effects:
        """Do nothing: no timer is set."""
        return ()

    def received(self, channel: Channel, data: bytes, now_s: float) -> Effects:
        """Report the lines that are complete; the rest waits for more bytes."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > self._limit:
            lines, self._rest = [*lines, self._rest], b""
        events = [event for line in lines for event in self._events(line)]
        malformed = sum(isinstance(event, MalformedReceived) for event in events)
        refusals = sum(isinstance(event, Refused) for event in events)
        return (Report(events, units=len(lines) - malformed, refusals=refusals),)

    def prepare(self, *commands: ControllerCommand) -> bytes:
        """Return commands as one line.

        Raises:
            CommandError: If the controller does not have one.
        """
        return json.dumps({"do": [_word(command) for command in commands]}).encode() + b"\n"

    def command(self, prepared: bytes, now_s: float) -> Effects:
        """Send a line."""
        return (Send(LINES, prepared),)

    def _events(self, line: bytes) -> list[ControllerEvent]:
        offset, self._offset = self._offset, self._offset + len(line) + 1
        try:
            fields = json.loads(line)
            if "no" in fields:
                return [Refused(0, str(fields["no"]))]
            positions = tuple(float(each) for each in fields["q"])
            if len(positions) != self._joints:
                raise ValueError(f"{len(positions)} joints; the model has {self._joints}")
            status = StatusReceived(
                activity=Activity(fields["state"]),
                mode=Mode.REMOTE if fields["remote"] else Mode.LOCAL,
                homed=bool(fields["homed"]),
            )
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            shown = line[:80].decode("ascii", "backslashreplace")
            return [MalformedReceived(offset, shown, f"no state: {error}")]
        return [JointsReceived(positions), status]


def _word(command: ControllerCommand) -> str | dict[str, list[float]]:
    if isinstance(command, MoveAbsolute):
        return {"to": [*command.positions]}
    if type(command) not in _WORDS:
        raise CommandError(f"this controller has no {type(command).__name__}")
    return _WORDS[type(command)]
