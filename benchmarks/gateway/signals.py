"""CPU of the gateway for a unit with signals: a controller of Universal Robots' kind, without sockets.

    ./dev run python -m benchmarks signals [--seconds 20] [--json]

Packages of the simulated controller, which moves, go through driver, time stamps and publication as in the
gateway, at 125 and 500 Hz of the controller's clock but as fast as possible. The publisher only serializes.
Compared with a controller that has no fields but those of joints and modes. The fastest of five runs counts.

Target: at 125 Hz a unit with all signals takes less than twice the time of one with joints and modes only.
"""

import struct
import time
from typing import Annotated, Any

from google.protobuf.message import Message
from typer import Option

from controllers.simulated.demo import demo_tour
from controllers.universal_robots.driver import RTDE, RtdeDriver
from controllers.universal_robots.interfaces import rtde_messages as rtde
from controllers.universal_robots.interfaces.state import OUTPUTS
from controllers.universal_robots.simulated.controller import UrController
from protocol_gateway.link.timestamping import EventTime, Timestamper
from protocol_gateway.seam import Report, SignalsReceived
from protocol_gateway.telemetry.journal import Journal
from protocol_gateway.telemetry.signals import Signals
from protocol_gateway.telemetry.telemetry import Telemetry
from robots.descriptions.description import load
from robots.kinematics.joints import joints_of

JOINTS_AND_MODES = frozenset(
    ("timestamp", "actual_q", "actual_qd", "robot_mode", "safety_mode", "safety_status", "runtime_state")
)
_RUNS = 5


class Sink:
    """Publisher that serializes, and counts messages and bytes."""

    def __init__(self) -> None:
        self.messages = self.bytes = 0

    def put(self, message: Message, **_: object) -> None:
        """Serialize a message."""
        self.messages += 1
        self.bytes += len(message.SerializeToString())


def measure(
    seconds: Annotated[float, Option(help="of the controller's clock")] = 20.0,
) -> list[dict[str, Any]]:
    runs = [
        [cost_of(rate_hz, seconds, signals=signals) for rate_hz in (125, 500) for signals in (False, True)]
        for _ in range(_RUNS)
    ]
    # The fastest run: other programs only ever add time.
    return [min(each, key=lambda row: row["cpu_us_a_unit"]) for each in zip(*runs, strict=True)]


def cost_of(rate_hz: int, seconds: float, *, signals: bool) -> dict[str, Any]:
    """Return the CPU time of a unit, and what was published as signals."""
    description = load("puma560")
    joints = joints_of(description)
    controller = UrController(
        description, tour=demo_tour(description), powered=True, now_s=0.0, announce=lambda message: None
    )
    driver = RtdeDriver(joints.types, {}, relay=None)
    names = greet(driver, None if signals else JOINTS_AND_MODES)
    packages = []
    recipe = rtde.Recipe(names, [OUTPUTS[name] for name in names], 1)
    for number in range(int(seconds * rate_hz)):
        now_s = number / rate_hz
        controller.tick(now_s)
        packages.append(rtde.package(rtde.PackageType.DATA, recipe.write(controller.values(names, now_s))))
    sink, other = Sink(), Sink()
    journal = Journal(other, "arm")
    telemetry = Telemetry(
        joints,
        fast=other,
        slow=other,
        raw=other,
        signals=Signals(sink, journal, joints.names),
        journal=journal,
        stale_after_s=1.0,
        on_status=lambda: None,
        on_activity=lambda activity, dated_s: None,
        on_refused=lambda: None,
        stop_expected=lambda now_s: False,
    )
    stamper = Timestamper()
    count = 0
    begun_s = time.process_time()
    for number, data in enumerate(packages):
        now = EventTime(number / rate_hz + 100.0, round((number / rate_hz + 100.0) * 1e9))
        for effect in driver.received(RTDE, data, now.monotonic_s):
            if isinstance(effect, Report):
                for event, date in zip(effect.events, stamper.timestamps(effect.events, now), strict=True):
                    telemetry.on_event(event, date)
                    if isinstance(event, SignalsReceived):
                        count = max(count, len(event.values))
    took_s = time.process_time() - begun_s
    return {
        "rate_hz": rate_hz,
        "signals": count,
        "cpu_us_a_unit": round(took_s / len(packages) * 1e6, 1),
        "cpu_percent": round(100 * took_s / seconds, 2),
        "messages_a_second": round(sink.messages / seconds, 1),
        "bytes_a_message": round(sink.bytes / max(sink.messages, 1)),
    }


def greet(driver: RtdeDriver, offered: frozenset[str] | None) -> list[str]:
    """Answer the driver's greeting like a controller that has these fields; return the agreed ones."""
    answers = [
        rtde.package(rtde.PackageType.PROTOCOL_VERSION, b"\x01"),
        rtde.package(rtde.PackageType.URCONTROL_VERSION, struct.pack(">4I", 5, 21, 0, 0)),
    ]
    names: list[str] = []
    pending = [*driver.opened(RTDE, 0.0)]
    while pending:
        effect = pending.pop(0)
        data = getattr(effect, "data", b"")
        match data[2:3]:
            case b"O":
                names = data[11:].decode().split(",")
                missing = [name for name in names if offered is not None and name not in offered]
                types = ",".join(rtde.NOT_FOUND if name in missing else OUTPUTS[name] for name in names)
                number = bytes([0 if missing else 1])
                answers.append(rtde.package(rtde.PackageType.SET_UP_OUTPUTS, number + types.encode()))
            case b"S":
                answers.append(rtde.package(rtde.PackageType.START, b"\x01"))
        if answers:
            pending += driver.received(RTDE, answers.pop(0), 0.0)
    return names
