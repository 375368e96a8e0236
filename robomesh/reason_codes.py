"""All reasons: code, English sentence, and advice.

The sentence is the problem, then a colon and the advice. Words in braces are parameters; `{cause}` is the
sentence of another reason. The page translates these codes (`web/src/i18n/reasons.ts`).
"""

from robomesh.reasons import Code

# ------------------------------------------------------------------ requests

BUSY = Code(
    "request.busy", "too many requests are waiting for this service", "send fewer requests and try again"
)
TURNED_AWAY = Code("request.turned_away", "refused unread: too many requests were waiting")
FAILED = Code("request.failed", "{request} failed with an internal error", "see the log of its service")
INVALID = Code("request.invalid", "{detail}")
# A refusal without a code, and several reasons for one refusal.
OTHER = Code("other", "{detail}")
SEVERAL = Code("several", "{cause}")
WILDCARD = Code("request.wildcard", "{key} has a wildcard", "ask one {request} by its whole key")
NO_RIGHT = Code("request.no_right", "{detail}")
OVER_QUOTA = Code(
    "quota.rate",
    "{asker} has used up its quota: {quota} = {most:g} for each name ([quotas] in the site file)",
    "try again in {seconds:.1f} s",
)
QUOTA_AT_ONCE = Code(
    "quota.at_once",
    "{asker} already has {count} requests in progress: quota {quota} = {most:g} for each name "
    "([quotas] in the site file)",
    "try again in {seconds:.1f} s",
)

QUOTA_VIEWS = Code(
    "quota.views",
    "no capacity: {asker} already has {count} views: quota views = {most} for each name, together "
    "{megapixels:.1f} million pixels a second ([quotas] in the site file)",
    "close a view and try again after {seconds:g} s, or request a smaller or slower one",
)
NOT_JSON = Code("request.not_json", "not JSON: {detail}")
NOT_JSON_OBJECT = Code(
    "request.not_json_object", "the request is not a JSON object", "send an object with the request's fields"
)
UNKNOWN_FIELD = Code("request.unknown_field", "{request} has no field '{field}'; it takes {fields}")
NOT_FINITE = Code("request.not_finite", "{value} is not finite")
KEY_TOO_LONG = Code("request.key_too_long", "the key has {count} characters", "at most {most} are allowed")
PAGE_TOO_MANY = Code(
    "page.too_many_requests", "more than {count} requests are waiting for an answer", "try again later"
)
CONSOLE_NO_RIGHT = Code("page.console_no_right", "the console may not send {request}")
NEEDS_OPERATOR = Code("page.needs_operator", "{account} is a {role}: {what} needs an operator")
PASSWORD_AGAIN = Code(
    "page.password_again",
    "commands are locked because this page was not used for a while",
    "enter your password again",
)
SIGNED_OUT = Code("page.signed_out", "this page is no longer signed in", "sign in again")
OWN_NAME_ONLY = Code("page.own_name_only", "{who} may send requests only as {own}, not as {name}")
WORKER_GAVE_UP = Code("request.worker_gave_up", "aborted: {detail}")

# --------------------------------------------------------------------- leases

LEASE_TAKEN = Code("lease.taken", "control taken")
LEASE_RENEWED = Code("lease.renewed", "control renewed")
LEASE_RELEASED = Code("lease.released", "control released")
LEASE_OFFERED = Code("lease.offered", "control offered to {name}")
LEASE_OFFER_WITHDRAWN = Code("lease.offer_withdrawn", "offer withdrawn")
LEASE_TAKEN_FROM = Code("lease.taken_from", "control taken over from {name}")
LEASE_ASKED = Code("lease.asked", "{name} asks {holder} for control")

LEASE_NONE = Code(
    "lease.none", "no operator is in control, or the lease has ended", "take control first (ACQUIRE)"
)
LEASE_HELD = Code("lease.held", "{holder} is in control", "wait until it is released, or ask for it")
LEASE_OTHER = Code(
    "lease.other",
    "{name} is in control with another lease (another window or program?)",
    "this lease is not valid",
)
LEASE_FREE = Code("lease.free", "no operator is in control", "take control (ACQUIRE)")
LEASE_OWN = Code("lease.own", "{name} is in control already")
LEASE_MOVING = Code("lease.moving", "{holder}'s motion is still running", "wait until it ends, then accept")
LEASE_NOT_OFFERED = Code(
    "lease.not_offered", "control was not offered to {name}", "ask its holder, or ACQUIRE"
)
LEASE_NO_REASON = Code("lease.no_reason", "TAKE needs a reason", "say in `reason` why control is taken away")
LEASE_NOT_WRITTEN = Code(
    "lease.not_written", "control not granted: {cause}, so its holder could not be recorded"
)

# Reasons for the end of control.
ENDED_RELEASED = Code("lease.ended.released", "{name} released control")
ENDED_RELEASED_WHY = Code("lease.ended.released_why", "{name} released control: {reason}")
ENDED_HANDED_OVER = Code("lease.ended.handed_over", "handed over to {name}")
ENDED_TAKEN = Code("lease.ended.taken", "taken by {name}: {reason}")
ENDED_EXPIRED = Code("lease.ended.expired", "{name}'s lease was not renewed within {seconds:g} s")
ENDED_SESSION = Code("lease.ended.session", "{name}'s page or program has disconnected")
ENDED_FOREIGN_MOTION = Code(
    "lease.ended.foreign_motion", "the robot began to move without a command from its holder"
)
ENDED_GATEWAY = Code("lease.ended.gateway", "the gateway is shutting down")
ENDED_UNKNOWN = Code("lease.ended.unknown", "no reason given")
ENDED_CLIENT = Code("lease.ended.client", "{name}'s old client program {client} has disconnected")

# ------------------------------------------------------------------- commands

COMMAND_ID_OLD = Code(
    "command.id_old",
    "id {id} is not higher than {last}, the last one under this lease",
    "use a higher id for each command",
)
COMMAND_ID_USED = Code("command.id_used", "id {id} was used for {what}", "use a higher id for each command")
COMMAND_LATE = Code(
    "command.late",
    "it arrived {seconds:.2f} s after its not_after",
    "it was delayed, or not_after is not in the gateway's time (`now` in each lease answer)",
)
COMMAND_WAITED = Code(
    "command.waited",
    "it waited {waited:.1f} s in the gateway (for the audit log, or for earlier requests); "
    "after {seconds:g} s its sender may have given up",
    "send it again",
)
COMMAND_TWO_UNITS = Code(
    "command.two_units", "RESUME and another motion are two units", "resume first, or RESET"
)
COMMAND_PROGRAM_RUNS = Code(
    "command.program_runs", "program {name} is running", "stop it, or wait until it has ended"
)
COMMAND_HELD = Code("command.held", "HOLD arrived before it could be sent")
COMMAND_CONTROL_ENDED = Code("command.control_ended", "control ended")
COMMAND_CONTROL_ENDED_MEANWHILE = Code(
    "command.control_ended_meanwhile", "control ended while the command was being written to the audit log"
)
COMMAND_BROKEN_OFF = Code(
    "command.broken_off", "it was cancelled while it was being written to the audit log"
)
COMMAND_NOT_WRITTEN = Code(
    "command.not_written", "{cause}; a command that cannot be recorded is not executed"
)
COMMAND_CHANGED = Code("command.changed", "{cause} since the motion was checked")
COMMAND_UNSUPPORTED = Code("command.unsupported", "{detail}")
COMMAND_NOT_LATCHED = Code("command.not_latched", "{cause}, so a restart would forget a stop")

STOP_NOT_LATCHED = Code("stop.not_latched", "stop {id} is not latched; no stop is")
STOP_OTHER = Code(
    "stop.other",
    "RESET names stop {asked}, but stop {id} is latched ({by}: {reason})",
    "remove the cause, then send RESET with stop_id {id}",
)
STOP_MOVING = Code(
    "stop.moving", "the robot is still moving after stop {id}", "wait until it has stopped, then send RESET"
)
STOP_LATCHED = Code(
    "stop.latched",
    "stop {id} is latched ({by}: {reason})",
    "remove the cause, then send RESET with stop_id {id}",
)

ROBOT_READ_ONLY = Code("robot.read_only", "this robot is read-only: {cause}")
READ_ONLY = Code("robot.is_read_only", "read-only: {cause}")
NO_STOP_CODE = Code(
    "robot.no_stop_code",
    "the codes in the site file have no stop for its controller",
    'add the code of "COMMAND:stop", or of "COMMAND"',
)
STOP_NOT_PROVEN = Code(
    "robot.stop_not_proven",
    "its stop is not proven",
    "test the stop unit on its controller (see docs/safety.md), then set stop_proven = true for this robot "
    "in the site file",
)
ROBOT_NOT_HOMED = Code("robot.not_homed", "the robot is not homed", "home it first (HOME)")
ROBOT_HOMED_UNKNOWN = Code(
    "robot.homed_unknown",
    "the controller does not report whether the robot is homed",
    "home it first (HOME); for a controller that never reports it, set "
    'accept_unknown = ["homed"] in the site file',
)
ROBOT_MOVED = Code("robot.moved", "the robot has moved")
ROBOT_OTHER_MOVED = Code("robot.other_moved", "{name} has moved, or has been commanded to move,")
ROBOT_MOVES_STOP = Code(
    "robot.moves_stop", "the robot is moving, or about to move", "wait until it has stopped, or stop it"
)
ROBOT_MOVES_HOME = Code(
    "robot.moves_home", "the robot is moving, or about to move", "wait until it has stopped, or send it home"
)

LINK_DOWN = Code("link.down", "the link to the controller is down ({cause})")
LINK_SILENT = Code("link.silent", "the controller is silent, so the robot's position is unknown ({cause})")
LINK_CONNECTING = Code("link.connecting", "connecting to {where}")
LINK_CONNECTED = Code("link.connected", "connected to {where}")
LINK_NO_UNIT = Code("link.no_unit", "connected to {where}, no unit yet")
LINK_FAILED = Code("link.failed", "cannot connect to {where}: {detail}")
LINK_NO_ANSWER = Code("link.no_answer", "{where} does not answer")
LINK_CLOSED = Code("link.closed", "the link was closed")
LINK_LOST = Code("link.lost", "{where}: {detail}")
LINK_REFUSED = Code("link.refused", "{where} refused the connection: {detail}")
LINK_NO_DATA = Code("link.no_data", "{where} sends nothing")
LINK_RECONNECTS = Code("link.reconnects", "{where} sends nothing; connecting again")
LINK_DELUGE = Code("link.deluge", "{where} sends far too much data: all of it is discarded")
LINK_OTHER_JOINTS = Code("link.other_joints", "{where} sends {detail}")
LINK_JUST_ENDED = Code("link.just_ended", "the connection has just ended")
LINK_BROKE = Code("link.broke", "the connection broke while it was written")
LINK_CLOGGED = Code("link.clogged", "the controller does not read; connecting again")
STOP_SENT = Code("stop.sent", "stop request {id} is on the controller's socket")
STOP_NOT_SENT = Code("stop.not_sent", "stop request {id} is latched, but not sent: {cause}")
STOP_READ_ONLY = Code(
    "stop.read_only",
    "stop request not sent, because the robot is read-only ({cause})",
    "stop it at its own panel",
)
STOP_SENT_AGAIN = Code(
    "stop.sent_again", "stop request {id} was sent to the controller when its link came back"
)
STOP_UNIT_REPEATED = Code("stop.unit_repeated", "the stop unit was sent again")
STOP_DISOBEYED = Code(
    "stop.disobeyed",
    "the robot moves although stop request {id} was sent: use the emergency stop there ({cause})",
)
STOP_SENT_LATER = Code("stop.sent_later", "{cause}; it is sent as soon as the link is back")

CONTROLLER_LOCAL = Code(
    "controller.local",
    "the controller is in local mode",
    "switch it to remote at the controller",
)
CONTROLLER_MODE_UNKNOWN = Code(
    "controller.mode_unknown",
    "the controller does not report whether it is in remote or local mode; for one that never does, set "
    'accept_unknown = ["mode"] in the site file',
)
CONTROLLER_STOPPED = Code(
    "controller.stopped", "the controller is stopped", "remove the cause, then send RESET"
)
CONTROLLER_FAULT = Code(
    "controller.fault", "the controller has a fault ({fault})", "clear it, then send RESET"
)
CONTROLLER_HOLDING = Code("controller.holding", "a motion is on hold", "RESUME it, or cancel it with RESET")
CONTROLLER_NOT_HOLDING = Code("controller.not_holding", "nothing is on hold", "there is no motion to resume")
POSITIONS_STALE = Code("positions.stale", "no joint positions for {seconds:g} s")
POSITIONS_UNKNOWN = Code("positions.unknown", "the robot's position is unknown ({cause})")
POSITIONS_NONE = Code("positions.none", "the controller has not reported joint positions")

SPEED_MISSING = Code("speed.missing", "SPEED needs speed_percent, from 1 to 100")
SPEED_OUTSIDE = Code("speed.outside", "speed {value:g} % is outside 1 to 100 %")
JOINT_COUNT = Code("joints.count", "{count} joint positions, but the robot has {joints} joints ({names})")
JOINTS_OUTSIDE = Code("joints.outside", "{cause}")
JOINT_LIMIT = Code("joints.limit", "joint {name} at {value} is beyond its limit {limit}")
JOINT_NOT_FINITE = Code("joints.not_finite", "joint {name} at {value} is not a finite number")
JOINT_CONSTRAINT = Code("joints.constraint", "{terms} at {value} is beyond its limit {limit}")

# ------------------------------------------------------------------- programs and checks

PROGRAM_UNREADABLE = Code("program.unreadable", "{detail}")
PROGRAM_UNREACHABLE = Code("program.unreachable", "{detail}")
PROGRAM_START_OUTSIDE = Code("program.start_outside", "at the start: {cause}")
PROGRAM_LINE = Code("program.line", "line {line}: {cause}")
PROGRAM_TOO_LONG = Code("program.too_long", "a program has at most {kib} KiB")
PROGRAM_MOVED = Code("program.moved", "the robot has moved since its program was checked")
PROGRAM_HOLD = Code("program.hold", "HOLD arrived during its check: not started")
PROGRAM_ASKER_GAVE_UP = Code(
    "program.asker_gave_up",
    "its check did not finish before its sender's deadline",
    "allow more time (not_after) and try again",
)
PROGRAM_PLAN_TOO_SLOW = Code("program.plan_too_slow", "planning it takes longer than {seconds:g} s")
PROGRAM_STOPPED = Code("program.stopped", "stopped by {by}: {reason}")
PROGRAM_STOPPED_BY_NUMBER = Code("program.stopped_by_number", "stopped: stop request {id}")
PROGRAM_GIVEN_UP = Code("program.given_up", "cancelled by RESET")
PROGRAM_CONTROL_ENDED = Code("program.control_ended", "control ended: {cause}")
PROGRAM_NOT_ARRIVED = Code("program.not_arrived", "the robot came to rest before the target of the line")
PROGRAM_DONE = Code("program.done", "program {program} is done")
PROGRAM_ENDED = Code("program.ended", "program {program} ended at line {line}: {cause}")
PROGRAM_FAILED = Code("program.failed", "the gateway failed with an internal error", "see its log")

BELOW_FLOOR = Code("check.below_floor", "{one} goes {depth_mm:.1f} mm below the floor")
TOUCHES = Code("check.touches", "{one} touches {other}")
NEARER_THAN_STOP = Code(
    "check.nearer_than_stop",
    "{one} comes within {distance_mm:.1f} mm of {other}, nearer than its stop distance of {limit_mm:g} mm",
)
NEARER_THAN_WARNING = Code(
    "check.nearer_than_warning",
    "{one} comes within {distance_mm:.1f} mm of {other}, nearer than its warning distance of {limit_mm:g} mm",
)
TOOL_TOO_FAST = Code(
    "check.tool_too_fast",
    "the tool moves at {speed:.0f} mm/s, faster than the program's tool speed of {limit:g} mm/s",
)
NEARLY_SINGULAR = Code(
    "check.nearly_singular",
    "the arm is nearly singular: {value:.4f}, but motion along a line needs {limit:g}",
)
CHECK_ON_ITS_WAY = Code("check.on_its_way", "on its way {cause}")
CHECK_MORE = Code("check.more", "and {count} more")
CHECK_REQUIRED = Code(
    "check.required",
    'it cannot be checked, and this robot\'s site says check = "require": {cause}',
)
CHECK_SKIPPED = Code("check.skipped", "not checked: {cause}")
CHECK_STARTING = Code("check.starting", "the check is still starting", "try again in a few seconds")
CHECK_BROKEN = Code("check.broken", "the check does not work: {detail}")
CHECK_FAILED = Code("check.failed", "the check failed: {detail}")
CHECK_IMPOSSIBLE = Code("check.impossible", "{detail}")
CHECK_QUEUED_TOO_LONG = Code(
    "check.queued_too_long", "the check waited longer than {seconds:g} s for other checks"
)
CHECK_TOO_SLOW = Code("check.too_slow", "the check took longer than {seconds:g} s")
CHECK_NO_POSITION = Code("check.no_position", "its controller does not report the robot's position")
CHECK_HELD_WAY_UNKNOWN = Code(
    "check.held_way_unknown",
    "the target of the held motion is unknown",
    "cancel it (RESET), then send a new motion",
)
CHECK_OTHERS_UNKNOWN = Code("check.others_unknown", "unknown: {cause}")
CHECK_OTHER_UNKNOWN = Code("check.other_unknown", "the position or the target of {name} ({cause})")
CHECK_OTHERS_LEFT_OUT = Code("check.others_left_out", "unknown, so not included: {cause}")
OTHER_NO_POSITION = Code("other.no_position", "its controller does not report its position")
OTHER_MOVES = Code("other.moves", "it is moving to an unknown target")
OTHER_NOT_SERVED = Code("other.not_served", "this gateway does not serve it")
NO_SHAPES = Code("check.no_shapes", "no link in {name}'s description has a shape, so it cannot be checked")
MESH_MISSING = Code("check.mesh_missing", "{name} cannot be checked completely: mesh file not found: {files}")
LINK_WITHOUT_SHAPE = Code(
    "check.link_without_shape", "{name} cannot be checked completely: {links} moves and has no shape"
)
FIXED_WITHOUT_SHAPE = Code(
    "check.fixed_without_shape", "not checked, because they have no shape: {links} of {name}"
)

# ------------------------------------------------------------------- audit log and latch file

AUDIT_SLOW = Code("audit.slow", "the audit log's disk takes longer than {seconds:g} s")
AUDIT_NOT_WRITABLE = Code("audit.not_writable", "the audit log {file} cannot be written ({detail})")
AUDIT_QUEUE_FULL = Code("audit.queue_full", "{count} entries wait for the disk")
LATCH_SLOW = Code("latch.slow", "the latch file {name} takes longer than {seconds:g} s to write")
LATCH_CLOSED = Code("latch.closed", "the latch file {name} is closed: its gateway is shutting down")
LATCH_NOT_WRITABLE = Code("latch.not_writable", "the latch file {name} cannot be written ({detail})")
LATCH_NOT_ALLOCATED = Code("latch.not_allocated", "the latch file {name} cannot be allocated ({detail})")
LAST_OF_MANY = Code("audit.last_of_many", "{cause} (the last of many callers)")
NOT_DONE = Code("audit.not_done", "not done: {cause}")
AUDIT_SEARCHES = Code(
    "audit.searches", "{count} searches of this log are already waiting", "try again in a moment"
)
AUDIT_UNREADABLE = Code("audit.unreadable", "{file} cannot be read: {detail}")
AUDIT_TOO_MANY = Code("audit.too_many", "most = {count} is too many", "at most {most} entries are returned")

# ------------------------------------------------------------------- alarms

ALARM_NO_REASON = Code(
    "alarm.no_reason",
    "the reason is missing",
    "say why the alarm is shelved, as in 'switched off for service until noon'",
)
ALARM_SHELF_TIME = Code(
    "alarm.shelf_time", "shelve_s is {seconds:g} s", "it must be more than 0 and at most {most:g} (a day)"
)
ALARM_NOT_SHELVED = Code("alarm.not_shelved", "alarm '{id}' is not shelved")
ALARM_NONE_NAMED = Code("alarm.none_named", "the list of alarms is empty", "name at least one alarm in `ids`")
ALARM_UNKNOWN = Code("alarm.unknown", "no alarm '{id}'", "it may have ended and been acknowledged")

# ------------------------------------------------------------------- kinematics

INVERSE_TASK = Code("inverse.task", "task {task} is unknown", "use POSE_6D or POSITION_AND_AXIS_5D")
INVERSE_POSE = Code("inverse.pose", "{detail}")
INVERSE_NEAR = Code("inverse.near", "near: {detail}")
CHECK_START_UNKNOWN = Code("check.start_unknown", "the position of {robot} is unknown", "give `start`")
JOINT_COUNT_OF_FIELD = Code(
    "joints.count_of_field", "{field} has {count} values, but {robot} has {joints} joints ({names})"
)
MESH_UNKNOWN = Code("mesh.unknown", "no mesh '{name}'; {robot} has {meshes}")

# ------------------------------------------------------------------- recordings and replays

RECORDING_NAME = Code(
    "recording.name",
    "name '{name}' is invalid",
    "use at most 81 letters, digits, '_', '.' and '-', beginning with a letter or digit",
)
RECORDING_OPEN = Code("recording.open", "{robot} is already being recorded, as '{name}'")
RECORDING_NOT_OPEN = Code("recording.not_open", "{robot} is not being recorded")
RECORDING_FAILED = Code("recording.failed", "{detail}")
RECORDING_UNREADABLE = Code("recording.unreadable", "{detail}")
RECORDING_NO_JOINTS = Code("recording.no_joints", "{file} contains no joint states")
RECORDER_BUSY = Code(
    "recorder.busy", "the recorder is busy: its recordings/{request} is not ready yet; try again"
)
FLIGHT_NOT_RUNNING = Code(
    "recorder.flight_not_running", "the flight recorder of {robot} is not running", "is the disk full?"
)
FLIGHT_NONE = Code(
    "recorder.flight_none",
    "the flight recorder is switched off",
    "switch it on with [recorder] flight in the site file",
)
REPLAY_IS_RECORDED = Code("replay.is_recorded", "this is a replay of {file}, which is already a recording")
REPLAY_CANNOT_MOVE = Code("replay.cannot_move", "this is a replay of {file}; it cannot be commanded")
REPLAY_POSITION = Code(
    "replay.position", "position {seconds:g} s is outside the recording", "choose 0 to {most:.3f} s"
)
REPLAY_SPEED = Code("replay.speed", "speed {speed:g} is out of range", "choose {least:g} to {most:g}")
REPLAY_NO_ROBOT = Code(
    "replay.no_robot", "{file} is not a recording of a robot: it has no topic robomesh/SITE/ROBOT/TOPIC"
)
REPLAY_TOO_MANY = Code("replay.too_many", "{count} replays are already open", "close one first")
REPLAY_SESSION = Code(
    "replay.session", "session '{session}' is not present", "give the id of a present alive/operator/<id>"
)

# ------------------------------------------------------------------- views

VIEW_UNKNOWN = Code("view.unknown", "no view '{view}'; there are {views}")
VIEW_UNKNOWN_OF = Code("view.unknown_of", "no view '{view}' of {robot}: there are {views}")
VIEW_NO_ROOM = Code("view.no_room", "no capacity: {detail}")
VIEW_INVALID = Code("view.invalid", "{detail}")
VIEW_NO_ANSWER = Code("view.no_answer", "the answer to {key}/views contains no view")
