"""Interface between a controller's own protocol and the gateway. A driver for each protocol implements it.

A driver does no I/O and reads no clock. It is told what happens on its channels, and returns effects, which
the link performs in order:

    told                                     effects
    ---------------------------------------  ------------------------------------------------------
    started, opened, received, skipped,      Open, Close: keep a channel connected, or end it
      closed, timer_ended, command,          Send: write whole bytes to a channel now
      controlled (`FollowsControl`)
                                             SetTimer: tell the driver when a time has come
                                             Report: what the controller reported
                                             FateUnknown: latch a stop

Only the driver knows degrees, millimetres, words and codes: above it everything is SI. Times are seconds on
the gateway's monotonic clock, unless named as the controller's.
"""

from protocol_gateway.seam.capabilities import Capabilities, StopEnds
from protocol_gateway.seam.commands import (
    COMMANDS,
    ControllerCommand,
    Hold,
    Home,
    MoveAbsolute,
    MoveRelative,
    Recover,
    Recovery,
    Reset,
    Resume,
    Speed,
    Stop,
    Trace,
)
from protocol_gateway.seam.effects import (
    ALL,
    NOTHING,
    Carries,
    Channel,
    Close,
    Effect,
    Effects,
    FateUnknown,
    Open,
    Report,
    Send,
    SetTimer,
)
from protocol_gateway.seam.events import (
    Activity,
    AlarmReceived,
    AxesUndeclared,
    ControllerEvent,
    JointsReceived,
    MalformedReceived,
    Mode,
    MotionImpossible,
    RecoverAnswered,
    Refused,
    Severity,
    Signal,
    SignalsReceived,
    SignalValue,
    SoftwareReceived,
    StatusReceived,
    UnknownReceived,
    homed_by_nature,
)
from protocol_gateway.seam.protocol import Driver, FollowsControl, StopDepends
from robots.schema.robot_toml import JointType

__all__ = [
    "ALL",
    "COMMANDS",
    "NOTHING",
    "Activity",
    "AlarmReceived",
    "AxesUndeclared",
    "Capabilities",
    "Carries",
    "Channel",
    "Close",
    "ControllerCommand",
    "ControllerEvent",
    "Driver",
    "Effect",
    "Effects",
    "FateUnknown",
    "FollowsControl",
    "Hold",
    "Home",
    "JointType",
    "JointsReceived",
    "MalformedReceived",
    "Mode",
    "MotionImpossible",
    "MoveAbsolute",
    "MoveRelative",
    "Open",
    "Recover",
    "RecoverAnswered",
    "Recovery",
    "Refused",
    "Report",
    "Reset",
    "Resume",
    "Send",
    "SetTimer",
    "Severity",
    "Signal",
    "SignalValue",
    "SignalsReceived",
    "SoftwareReceived",
    "Speed",
    "StatusReceived",
    "Stop",
    "StopDepends",
    "StopEnds",
    "Trace",
    "UnknownReceived",
    "homed_by_nature",
]
