"""Alarm rules: which events are alarms, their priority, what clears them and the advice (ISA-18.2).

An alarm requires a person to act. Codes that need no action (a setting, or a fault that another alarm
reports) are listed without a priority, to show that they were considered.

    ended by     codes of events that clear it: "link.up"; also its own code or code + ".over" as INFO
    over after   cleared if it is not activated again within this time
    neither      active until acknowledged: a single event, whose end is never reported

Source: ANSI/ISA-18.2-2016, clause 10 (rationalisation) and annex (latching alarms).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from robomesh.schemas.robomesh_pb2 import Alarm, Event

LOW, MEDIUM, HIGH, CRITICAL = Alarm.LOW, Alarm.MEDIUM, Alarm.HIGH, Alarm.CRITICAL
_MINUTE_S = 60.0


@dataclass(frozen=True, slots=True)
class Rule:
    """Handling of events, or of a state, with one code.

    Attributes:
        priority: None if it is not an alarm.
        advice: Recommended action.
        each: Name of an event value: each of its values is an alarm of its own; of "table/plate" the part
            before the slash counts.
    """

    priority: Alarm.Priority | None
    advice: str = ""
    ended_by: tuple[str, ...] = ()
    over_after_s: float | None = None
    each: str = ""


_NONE = Rule(None)
_LINK = "Look at the controller's power, its network cable and its address in the site file."
_DISK = "Make room in the recorder's folder, or move it to a larger disk."
_WHO = "Find out what moves the robot; keep away from it until you know."

RULES: Mapping[str, Rule] = MappingProxyType(
    {
        # The controller's link and state: `conditions.py` keeps these active while they hold.
        "link.down": Rule(HIGH, _LINK),
        "link.silent": Rule(HIGH, _LINK),
        "link.deluge": Rule(
            HIGH, "A device other than a controller sends there, or the controller is broken."
        ),
        "controller.joint_count": Rule(HIGH, "The site file names another model than the controller has."),
        "controller.joint_values": Rule(
            HIGH,
            "The line corrupts data, or the site file names another model: see the controller's own display.",
        ),
        "gateway.occupied": _NONE,
        "link.channel_lost": Rule(
            MEDIUM,
            "Look at this port in the controller's services, in the site file and in firewalls.",
            ended_by=("link.channel_back",),
            each="channel",
        ),
        "link.flooding": Rule(MEDIUM, "Lower the controller's rate; only the newest of it is published."),
        "controller.fault": Rule(HIGH, "Clear the fault at the controller, then reset."),
        "controller.stopped": Rule(
            MEDIUM,
            "Find out at the robot what stopped it: an emergency stop, its safety functions, or a person.",
            ended_by=("link.up", "link.down"),
        ),
        "controller.local": Rule(LOW, "People at the controller move the robot: contact them."),
        "stop.latched": Rule(MEDIUM, "Find out why it was stopped; the operator who has control resets it."),
        "check.missing": Rule(HIGH, "Motions are not checked as they should be; see the gateway's log."),
        "gateway.silent": Rule(HIGH, "The gateway or its machine hangs: restart it."),
        # Reported by the gateway.
        "joints.gone": Rule(
            HIGH,
            "The controller sends, but no positions: see what its own display says.",
            ended_by=("joints.back", "link.up", "link.down", "link.silent"),
        ),
        "status.gone": Rule(
            MEDIUM,
            "The controller no longer sends its status: see what its own display says.",
            ended_by=("status.back", "link.up", "link.down", "link.silent"),
        ),
        "unit.malformed": Rule(LOW, "If it goes on, look at the cable and the protocol.", (), _MINUTE_S),
        "controller.alarm": Rule(MEDIUM, "See the controller's own display.", (), 5 * _MINUTE_S),
        "signals.too_many": Rule(LOW, "Let the controller's driver report fewer signals.", (), _MINUTE_S),
        "controller.refused": Rule(LOW, "See what was asked for, and its reason.", (), _MINUTE_S),
        "controller.tool_changed": _NONE,
        "controller.payload_changed": _NONE,
        "controller.frame_changed": _NONE,
        "robot.read_only": _NONE,
        "joints.unproven": _NONE,
        "controller.software": _NONE,
        "stop.remembered": _NONE,  # the controller state reports it
        "stop.sent": _NONE,
        "stop.not_sent": Rule(LOW, "This robot is only watched: stop it at its own panel."),
        "stop.disobeyed": Rule(CRITICAL, "The robot still moves: use its emergency stop."),
        "motion.foreign": Rule(HIGH, _WHO),
        "lease.ended": Rule(LOW, "Control was not given back; see who had it.", (), 5 * _MINUTE_S),
        "program.ended": Rule(
            MEDIUM, "See at which line and why, then run it again.", ("program.started", "program.done")
        ),
        "check.warning": Rule(LOW, "It passes near something: slow down, or go around.", (), _MINUTE_S),
        "check.failed": Rule(
            MEDIUM,
            "It moves although its check failed: watch it, ready to stop; see the reason.",
            (),
            _MINUTE_S,
        ),
        "check.skipped": Rule(
            LOW, "It moves unchecked: watch it, ready to stop; the text says what is missing.", (), _MINUTE_S
        ),
        "audit.failed": Rule(
            HIGH,
            "Make room where the gateway keeps its audit log: no motion until it can be written.",
            ("audit.mended",),
        ),
        "audit.damaged": Rule(HIGH, "Keep a copy of the log; robomesh audit verify tells where it breaks."),
        "gateway.failed": Rule(HIGH, "The gateway's log says why; report it."),
        "legacy.closed": Rule(LOW, "An old client program does not read: start it again.", (), 5 * _MINUTE_S),
        "legacy.turned_away": Rule(LOW, "Too many old programs, or one that may not.", (), 5 * _MINUTE_S),
        "legacy.malformed": Rule(LOW, "An old client program sends rubbish; look at it.", (), 5 * _MINUTE_S),
        # Kinematics: each ends with ".over".
        "kinematics.limit": Rule(LOW, "Move the joint back before it reaches its limit.", each="joint"),
        "kinematics.clearance.warning": Rule(LOW, "Move away from it, or slow down.", each="second"),
        "kinematics.clearance.stop": Rule(HIGH, "Too near: move away from it.", each="second"),
        "kinematics.collision": Rule(HIGH, "They touch: look before anything moves.", each="second"),
        "kinematics.not_counted": Rule(
            MEDIUM, "The position of that robot is unknown: clearance leaves it out.", each="robot"
        ),
        "kinematics.floor": Rule(
            LOW, "Measure the floor's height; write it into the site file.", (), 5 * _MINUTE_S
        ),
        # The recorder.
        "recorder.gives_up": Rule(HIGH, _DISK),
        "recorder.disk_slow": Rule(MEDIUM, "The disk cannot keep up: find out what else uses it."),
        "recorder.space": Rule(MEDIUM, _DISK),
        "recorder.failed": Rule(MEDIUM, "See the recorder's log."),
        "recorder.refused": Rule(MEDIUM, "The trace is not recorded; its text says why."),
        "recorder.damaged": Rule(LOW, "A part of the last minutes cannot be read; the rest is kept."),
        "recorder.not_saved": Rule(HIGH, "The last minutes are not saved. " + _DISK, ("recorder.saved",)),
        "recorder.not_recovered": Rule(LOW, "Try robomesh recordings recover on the file."),
        "recorder.ended": Rule(HIGH, _DISK),
        "recorder.flight_ended": Rule(HIGH, _DISK),
        # The renderer.
        "renderer.slow": Rule(LOW, "Ask for fewer or smaller views.", ("renderer.keeps_up",)),
        # The router and the console: clients without rights.
        "router.without_rights": Rule(
            MEDIUM,
            "Its certificate is revoked or unknown: find out which machine and which person use it.",
            (),
            5 * _MINUTE_S,
        ),
        "router.imposter": Rule(HIGH, "Check the machine at that address; then restart the router."),
        "router.rules": Rule(MEDIUM, "The rules file cannot be read: robomesh keys writes it again."),
        "account.refused": Rule(
            LOW,
            "Ask the account's owner about these attempts; if in doubt, disable it or change its password.",
            (),
            5 * _MINUTE_S,
        ),
        "token.refused": Rule(
            LOW,
            "A screen or program there has an old address, or tries tokens: find out which.",
            (),
            5 * _MINUTE_S,
        ),
        "accounts.unreadable": Rule(
            MEDIUM, "Repair the accounts file; until then the last valid one applies."
        ),
        # The mesh itself: `consistency.py` keeps these active while they hold.
        "service.gone": Rule(MEDIUM, "See its log; start it again.", each="service"),
        "service.problem": Rule(LOW, "Everything else runs; the text says what to do.", each="id"),
        "service.silent": Rule(
            MEDIUM, "It hangs, or its line is full: see its log, then start it again.", each="id"
        ),
        "site.gone": Rule(MEDIUM, "The link to it is cut, or it is off: contact its operators.", each="site"),
        "router.unlinked": Rule(LOW, "See [router] connect, and whether that site's router runs.", each="id"),
        "clock.off": Rule(MEDIUM, "Set the clocks by NTP; times in recordings disagree.", each="host"),
        "mesh.versions": Rule(LOW, "Bring all to one version."),
        "mesh.twice": Rule(HIGH, "Two services have the same name: stop or rename one of them.", each="name"),
        "mesh.loss": Rule(LOW, "The line loses messages: look for what fills it.", each="id"),
        "certificate.expires": Rule(MEDIUM, "Renew it: robomesh keys renew.", each="id"),
        "alarm.not_saved": Rule(MEDIUM, "Make room, or check the permissions of the watch's folder."),
        "alarm.flood": Rule(MEDIUM, "Begin with the oldest of the most urgent: others may follow from it."),
    }
)

_UNKNOWN = {
    Event.WARNING: Rule(LOW, over_after_s=5 * _MINUTE_S),
    Event.ERROR: Rule(MEDIUM),
    Event.CRITICAL: Rule(HIGH),
}


def rule_of(code: str, severity: Event.Severity) -> Rule:
    """Return the rule of an event. Codes without a rule use the event's severity."""
    return RULES.get(code) or _UNKNOWN.get(severity, _NONE)


def ends(code: str) -> frozenset[str]:
    """Return the codes of the alarms that an event clears, if it is not an alarm itself."""
    by_table = {alarm for alarm, rule in RULES.items() if code in rule.ended_by}
    return frozenset({code, code.removesuffix(".over"), *by_table})
