"""What a driver can do with its controller."""

from dataclasses import dataclass
from enum import Enum

from protocol_gateway.seam.commands import ControllerCommand, Recovery
from robomesh.reasons import Reason


class StopEnds(Enum):
    """Motion that a driver's `Stop` ends."""

    OURS = "ours"
    ANY = "any"


@dataclass(frozen=True, slots=True, kw_only=True)
class Capabilities:
    """Capabilities of a driver with its controller. Other commands are refused with a code, and not offered.

    Attributes:
        commands: Commands that `encode` takes; empty: the driver only reads.
        stop_ends: Whose motion `Stop` ends, unless `StopDepends` says it; a test at the site proves that it
            works.
        jogs: `Reset` gives a held motion up without a latch, and a new target replaces a running motion: the
            arm goes on smoothly from where it is, without a stop between the targets.
        absolute: The arm has absolute encoders: it is homed by nature.
        first_speed_percent: Speed of motions when an operator takes control, because it is sent with each
            motion (`FollowsControl`); None: the controller keeps its speed.
        dies_with_link: Whether the controller itself ends a motion when the gateway or its link is gone;
            None: unknown.
        no_joints: Reason for missing joint positions; None: the driver reports them.
        reports_pose: It reports the tool's pose that the controller computes (signals "tool.pose.*"), so that
            the joints of a real arm are unproven until `robomesh robot verify` has compared them.
        joint_mapping: The site file's declarations by which it converts joints, in any form: with others,
            the joints are unproven again.
        can_be_moved: Another key of the site file would let the driver move the arm.
        experimental: Its commands were never tried on a real controller.
        stop_means: How its `Stop` is sent, which a proof of the stop names; empty: in one way only.
        recoveries: Actions of `Recover`. Each is off unless the site file allows it.
        slow_hz: Positions a second, if they are too few to follow the arm: the robot is marked as slow. None:
            they are not.
    """

    commands: frozenset[type[ControllerCommand]]
    stop_ends: StopEnds = StopEnds.ANY
    jogs: bool = False
    absolute: bool = False
    first_speed_percent: float | None = None
    dies_with_link: bool | None = None
    no_joints: Reason | None = None
    reports_pose: bool = False
    joint_mapping: str = ""
    can_be_moved: bool = False
    experimental: bool = False
    stop_means: str = ""
    recoveries: frozenset[Recovery] = frozenset()
    slow_hz: float | None = None
