"""All reasons: code, English sentence, and advice.

The sentence is the problem, then a colon and the advice. Words in braces are parameters; `{cause}` is the
sentence of another reason. The page has their Chinese (`web/src/i18n/zh.json`).

`{detail}` is a text of another author: the operating system, a third-party reader, a controller; or the
problem of a file, which has too many forms for codes.
"""

from robomesh.reasons import Code

# ------------------------------------------------------------------ requests

BUSY = Code(
    "request.busy", "too many requests are waiting for this service", "send fewer requests and try again"
)
TURNED_AWAY = Code("request.turned_away", "refused unread: too many requests were waiting")
FAILED = Code("request.failed", "{request} failed with an internal error", "see the log of its service")
INVALID = Code("request.invalid", "{cause}")
# A refusal without a code, and several reasons for one refusal.
OTHER = Code("other", "{detail}")
SEVERAL = Code("several", "{cause}")
WILDCARD = Code("request.wildcard", "{key} has a wildcard", "ask one {request} by its whole key")
NO_RIGHT = Code("request.no_right", "{cause}")
RIGHT_KEY = Code("right.key", "{name} has the role {role}: it may not use {key}")
RIGHT_ROLE = Code("right.role", "{name} has the role {role}: it may not {act} {topic}; only {roles} may")
RIGHT_NAME = Code(
    "right.name",
    "{name} has the role {role}: it may not {act} {topic}, which carries another name; it may {act} {own}",
)
RIGHT_SITE = Code(
    "right.site", "{name} has the role {role}: it may not {act} {topic} at site {site}, which is another site"
)
RIGHT_ROBOT = Code(
    "right.robot", "{name} has the role {role}: it may not {act} {topic} of {robot}; its robots are {robots}"
)
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
NEEDS_TEXT = Code("request.needs_text", "the field '{field}' is missing or is not a text")
NEEDS_OBJECT = Code("request.needs_object", "the field '{field}' is missing or is not an object")
TOO_LARGE = Code("request.too_large", "the request is larger than {bytes} bytes")
HALF_CHARACTER = Code("request.half_character", "the request contains an unpaired surrogate")
NO_ANSWER = Code("request.no_answer", "no answer to {key} within {seconds:g} s", "is its service running?")
NO_ANSWER_OR_REVOKED = Code(
    "request.no_answer_or_revoked", "{cause} Or was the certificate of {name} revoked?"
)
BROKEN_ANSWER = Code("request.broken_answer", "{key}: {bytes} of {total} bytes arrived, then {cause}")
NO_FURTHER_PIECE = Code("piece.none", "no further piece within {seconds:g} s")
PIECE_DROPPED = Code("piece.dropped", "its owner no longer kept it: repeat the request")
NOT_ASKED = Code("request.not_asked", "{key} could not be asked: {detail}")
NO_SERVICE = Code(
    "request.no_service",
    "no {services} runs for {place}",
    "check the name, and that the service is running",
)
PRESENCE_UNKNOWN = Code(
    "presence.unknown", "the router did not list the live services within {seconds:g} s", "try again"
)
ABANDONED = Code("request.abandoned", "the client has disconnected")
UNKNOWN_FIELD = Code("request.unknown_field", "{request} has no field '{field}'; it takes {fields}")
NOT_FINITE = Code("request.not_finite", "{value} is not finite")
NOT_MESSAGE = Code("request.not_message", "{count} bytes are not a {message}: {detail}")
NOT_JSON_MESSAGE = Code("request.not_json_message", "the JSON does not fit {message}: {detail}")
NOT_LEASE_REQUEST = Code("request.not_lease_request", "this is no LeaseRequest")
FIELD_NOT_ONE_OF = Code("request.field_not_one_of", "{field}: '{value}' is not one of {names}")
FIELD_UNSET = Code("request.field_unset", "{field}: set one of {names}")
FIELD_NOT_FINITE = Code("request.field_not_finite", "{field}: {value} is not finite")
FIELD_TIME = Code("request.field_time", "{field}: {seconds} s and {nanos} ns is not a valid time")
REQUEST_UNKNOWN = Code("request.unknown", "no request '{name}'; there are {names}")
TOPIC_UNKNOWN = Code("key.topic_unknown", "no topic '{name}'; there are {names}")
KEY_NAME = Code(
    "key.name",
    "{what} '{name}' cannot be used",
    "lower-case letters, digits, '_' and '-', beginning with a letter or digit, at most {most}",
)
KEY_CHUNK = Code(
    "key.chunk",
    "{what} '{name}' cannot be used",
    "letters, digits, '_', '.' and '-', beginning with a letter or digit, at most {most} characters",
)
KEY_OTHER = Code("key.other", "'{key}' is not a key of the mesh: robomesh/<site>/<robot>/<topic>")
KEY_NOT_PRESENCE = Code(
    "key.not_presence", "'{key}' is not a presence key: robomesh/<site>/<robot>/alive/<service>/<id>"
)
OPERATOR_RESERVED = Code(
    "key.operator_reserved", "operator '{name}' cannot be used: it is the name of a request"
)
OPERATOR_TOO_LONG = Code("key.operator_too_long", "operator {name}: a name has at most {most} characters")
FAULT_UNKNOWN = Code("fault.unknown", "fault '{name}' is unknown; there are {names}")
FAULT_TIMES = Code(
    "fault.times",
    "fault '{given}': must be NAME@BEGIN+LENGTH, both in seconds, as in {name}@2.5+10",
)
KEY_TOO_LONG = Code("request.key_too_long", "the key has {count} characters", "at most {most} are allowed")
PAGE_TOO_MANY = Code(
    "page.too_many_requests", "more than {count} requests are waiting for an answer", "try again later"
)
CONSOLE_NO_RIGHT = Code("page.console_no_right", "the console may not send {request}")
NEEDS_OPERATOR = Code("page.needs_operator", "{account} is a {role}: {what} needs an operator")
NEEDS_ADMINISTRATOR = Code(
    "page.needs_administrator",
    "only the account of an administrator may do this, and this console has no accounts",
)
NEEDS_ENGINEER = Code("page.needs_engineer", "{account} is a {role}: {what} needs an engineer")
PASSWORD_AGAIN = Code(
    "page.password_again",
    "commands are locked because this page was not used for a while",
    "enter your password again",
)
SIGNED_OUT = Code("page.signed_out", "this page is no longer signed in", "sign in again")
OWN_NAME_ONLY = Code("page.own_name_only", "{who} may send requests only as {own}, not as {name}")
PAGE_TOO_MANY_PAGES = Code(
    "page.too_many_pages", "this session already has {count} open pages", "close a page first"
)
PAGE_TEXT = Code("page.text", "this connection takes binary messages only")
PAGE_NOT_A_MESSAGE = Code("page.not_a_message", "not a message of a page: {detail}")
PAGE_READS_TOO_SLOWLY = Code(
    "page.reads_too_slowly", "more than {bytes} bytes are waiting for a page that does not read"
)
PAGE_ASKS_TOO_MUCH = Code(
    "page.asks_too_much",
    "this page has sent more than the console reads from one page for more than {seconds:g} s",
    "send less",
)
PAGE_STOPS_ONLY = Code("page.stops_only", "this connection takes requests for a stop only")
PAGE_TOO_MANY_KEYS = Code("page.too_many_keys", "this page already watches {count} keys", "unwatch one first")
PAGE_WATCH_WILDCARD = Code(
    "page.watch_wildcard",
    "'{key}' cannot be watched",
    "name the view; '*' may replace the site and the robot only",
)
PAGE_WATCH_VIDEO = Code(
    "page.watch_video", "'{key}' cannot be watched", "name the site and the robot of a video"
)
PAGE_WATCH_NO_RIGHT = Code(
    "page.watch_no_right", "'{key}' cannot be watched: the console has no right to {topic}"
)
PAGE_CANNOT_WATCH = Code("page.cannot_watch", "'{key}' cannot be watched: {cause}")
WORKER_GAVE_UP = Code("request.worker_gave_up", "aborted: {cause}")
WORKER_TOO_SLOW = Code("worker.too_slow", "no answer within {seconds:g} s")
WORKER_NOT_STARTED = Code("worker.not_started", "{module} could not be started: {detail}")
WORKER_START_TOO_SLOW = Code("worker.start_too_slow", "{module} did not start within {seconds:g} s")
WORKER_CRASHED = Code("worker.crashed", "{module} crashed (status {status})")
WORKER_ANSWER_TOO_LONG = Code(
    "worker.answer_too_long", "{module}: its answer has {count} bytes: {most} at most"
)
WORKER_ANSWER_INVALID = Code("worker.answer_invalid", "{module}: its answer is invalid: {detail}")

# ----------------------------------------------------------------------- HTTP

HTTP_HOST = Code(
    "http.host", "host '{host}' is not this console's", "use its address, or name it in the console's hosts"
)
HTTP_ORIGIN = Code("http.origin", "origin '{origin}' is not this page's: {host}")
HTTP_OTHER_PAGE = Code("http.other_page", "the request comes from another page")
HTTP_TWO_LENGTHS = Code(
    "http.two_lengths", "the request has a content-length and a transfer-encoding", "send one of them"
)
HTTP_BODY = Code("http.body", "a {method} request has no body")
HTTP_NO_PATH = Code("http.no_path", "there is no {path}")
HTTP_METHOD = Code("http.method", "{path} does not take {method}")

# ------------------------------------------------------------------- accounts

ACCOUNT_SIGN_IN = Code("account.sign_in", "no account is signed in", "sign in first")
ACCOUNT_WRONG = Code("account.wrong", "the account or the password is wrong")
ACCOUNT_PASSWORD_WRONG = Code("account.password_wrong", "the current password is wrong")
ACCOUNT_WAIT = Code("account.wait", "too many attempts", "try again in {seconds} s")
ACCOUNT_BUSY = Code("account.busy", "too many passwords wait to be verified", "try again in a moment")
ACCOUNT_NOT_ADMIN = Code("account.not_admin", "{account} is not an administrator")
ACCOUNT_NO_SESSION = Code("account.no_session", "session '{session}' has ended")
ACCOUNT_NAME = Code(
    "account.name",
    "account name '{name}' is invalid",
    "use at most {most} lower-case letters, digits, '_' and '-', beginning with a letter or digit",
)
ACCOUNT_TAKEN = Code("account.taken", "there is an account {name} already")
ACCOUNT_NONE = Code("account.no_account", "there is no account '{name}'", "there are {accounts}")
ACCOUNT_LAST_ADMIN = Code(
    "account.last_admin",
    "{name} is the last administrator who can sign in",
    "make another administrator first",
)
ACCOUNT_ROLE = Code("account.role", "role '{role}' is unknown", "there are {roles}")
ACCOUNT_ACTION = Code("account.action", "action '{action}' is unknown", "there are {actions}")
ACCOUNT_FAILED = Code("account.failed", "{detail}")
TOKEN_UNKNOWN = Code(
    "token.unknown", "the token in this address is unknown", "ask an administrator for a new address"
)
TOKEN_REVOKED = Code(
    "token.revoked", "token {token} of this address is revoked", "ask an administrator for a new address"
)
TOKEN_EXPIRED = Code(
    "token.expired", "token {token} of this address has expired", "ask an administrator for a new address"
)
TOKEN_OTHER_VIEW = Code("token.other_view", "token {token} opens only the view {view} of {robot}")
PASSWORD_SHORT = Code(
    "account.short",
    "the password is too short",
    "use at least {least} characters; a few words are good",
)
PASSWORD_LONG = Code("account.long", "the password is too long", "use at most {most} bytes")
PASSWORD_CONTROL = Code(
    "account.control", "the password contains a control character", "leave this character out"
)
PASSWORD_REPEATS = Code("account.repeats", "the password repeats a few characters", "a few words are good")
PASSWORD_RUN = Code("account.run", "the password is a run of neighbouring characters", "a few words are good")
PASSWORD_COMMON = Code(
    "account.common",
    "the password is easy to guess, because it is a common word or a name with digits",
    "a few words are good",
)

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
ENDED_HIDDEN = Code("lease.ended.hidden", "{name}'s page was hidden or closed")
ENDED_NO_RIGHT = Code("lease.ended.no_right", "{name} is a monitor now")
ENDED_SIGNED_OUT = Code("lease.ended.signed_out", "{name} was signed out")
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
COMMAND_DEADLINE_FAR = Code(
    "command.deadline_far",
    "its not_after is {seconds:.0f} s ahead of the gateway's time; {command} may wait {most:g} s",
    "use the gateway's time (`now` in each lease answer)",
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
COMMAND_NOT_THERE = Code("command.not_there", "this controller has no {command}")
COMMAND_HELD = Code("command.held", "HOLD arrived before it could be sent")
COMMAND_CONTROL_ENDED = Code("command.control_ended", "control ended")
COMMAND_CONTROL_ENDED_MEANWHILE = Code(
    "command.control_ended_meanwhile", "control ended before the command was sent"
)
COMMAND_BROKEN_OFF = Code(
    "command.broken_off", "it was cancelled while it was being written to the audit log"
)
COMMAND_NOT_WRITTEN = Code(
    "command.not_written", "{cause}; a command that cannot be recorded is not executed"
)
COMMAND_CHANGED = Code("command.changed", "{cause} since the motion was checked")
COMMAND_UNSUPPORTED = Code("command.unsupported", "{cause}")
COMMAND_NOT_A_UNIT = Code("command.not_a_unit", "cannot be sent: {detail}")
COMMAND_VALUES = Code("command.values", "{count} values for {joints} joints")
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

GATEWAY_TWICE = Code(
    "gateway.twice",
    "another gateway ({id}) also serves robot {robot}, so nobody knows which of them grants control",
    "stop one of the two",
)
ROBOT_READ_ONLY = Code("robot.read_only", "this robot is read-only: {cause}")
READ_ONLY = Code("robot.is_read_only", "read-only: {cause}")
READS_ONLY = Code("robot.reads_only", "the driver of its controller only reads", "move it from its own panel")
MOTION_OFF = Code(
    "robot.motion_off",
    "its site file does not let the gateway move it",
    "move it from its own panel; motion with {protocol} is an experiment (see docs/controllers.md)",
)
NO_STOP_CODE = Code(
    "robot.no_stop_code",
    "the codes in the site file have no stop for its controller",
    'add the code of "COMMAND:stop", or of "COMMAND"',
)
EXPERIMENTAL = Code(
    "robot.experimental",
    "motion by the protocol {protocol} was never tried on a real controller",
    "set experimental = true for this robot in the site file to try it",
)
STOP_PROOF_SHORT = Code(
    "robot.stop_proof_short",
    "stop_proven does not say what was tried",
    'name driver = "{driver}", means = "{means}", software and date (see docs/safety.md)',
)
STOP_OTHER_MEANS = Code(
    "robot.stop_other_means",
    "its stop was proven by {before}, and is sent by {now}",
    "test it again (see docs/safety.md)",
)
STOP_OTHER_SOFTWARE = Code(
    "robot.stop_other_software",
    "its stop was proven with the software {before} of its controller, which is {now} now",
    "test it again (see docs/safety.md)",
)
STOP_NOT_PROVEN = Code(
    "robot.stop_not_proven",
    "its stop is not proven",
    "test the stop unit on its controller (see docs/safety.md), then set stop_proven = true for this robot "
    "in the site file",
)
RECOVER_NOT_THERE = Code("recover.not_there", "this controller has no {recovery}", "it has: {known}")
RECOVER_NOT_ALLOWED = Code(
    "recover.not_allowed",
    "the site file does not allow {recovery} for this robot",
    "add it to the robot's `recover`, or do it at the robot",
)
RECOVER_REASON = Code("recover.reason", "a recovery needs a reason", "type why it is sent")
RECOVER_LOOKED = Code(
    "recover.looked",
    "no person at the robot has looked",
    "confirm it after a person at the robot has found the cause",
)
RECOVER_MOVES = Code("recover.moves", "the robot moves, or is not known to rest", "wait until it rests")
RECOVER_HELD = Code(
    "recover.held", "a motion is on hold, and could go on", "discard it (RESET), or stop the robot"
)
RECOVER_PROGRAM = Code(
    "recover.program",
    "programs and old client programs may not recover a controller",
    "an operator sends RECOVER, as the only command of the request",
)
RECOVER_UNCHANGED = Code(
    "recover.unchanged", "tool, payload and frame are as they were: there is nothing to confirm"
)
RECOVER_CONFIRMED = Code("recover.confirmed", "{by} has confirmed {changes}: {reason}")
RECOVER_SENT = Code("recover.sent", "{by} has sent {recovery} to the controller: {reason}")
RECOVER_ANSWERED = Code(
    "recover.answered",
    'the controller answers {recovery} with "{detail}"',
    "what became of it shows in the robot's state",
)
RECOVER_REFUSED = Code("recover.refused", 'the controller refuses {recovery}: "{detail}"')
RECOVER_UNKNOWN = Code(
    "recover.unknown",
    "it is unknown whether the controller has done {recovery}: {detail}",
    "look at the robot's state; it is not sent again",
)
ROBOT_HOMED_BY_NATURE = Code(
    "robot.homed_by_nature", "its encoders are absolute: it is always homed", "move it to its home position"
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
LINK_LOST = Code("link.lost", "{where}: {cause}")
LINK_CLOSED_THERE = Code("link.closed_there", "the controller closed the connection")
LINK_REFUSED = Code("link.refused", "{where} refused the connection: {detail}")
LINK_NO_DATA = Code("link.no_data", "{where} sends nothing")
LINK_RECONNECTS = Code("link.reconnects", "{where} sends nothing; connecting again")
GATEWAY_OCCUPIED = Code(
    "gateway.occupied",
    "{work} occupied the gateway's event loop for {seconds:.2f} s: everything else waited, also stops",
)
LINK_DELUGE = Code("link.deluge", "{where} sends far too much data: all of it is discarded")
LINK_OTHER_JOINTS = Code("link.other_joints", "{where} sends {cause}")
JOINT_VALUES = Code("joints.values", "{count} joint values, the description has {joints}")
JOINT_NO_NUMBER = Code("joints.no_number", "no finite number for joint {name}")
JOINT_FAR = Code("joints.far", "joint {name} at {value}, far beyond its limits {lower} to {upper}")
JOINT_LEAP = Code(
    "joints.leap", "joint {name} at {after} only {seconds:.2f} s after {before}: no drive is that fast"
)
LINK_JUST_ENDED = Code("link.just_ended", "the connection has just ended")
LINK_BROKE = Code("link.broke", "the connection broke while it was written")
LINK_CLOGGED = Code("link.clogged", "the controller does not read; connecting again")
STOP_CONTROL_ENDED = Code("stop.control_ended", "dead-man: {cause}")
STOP_GATEWAY_KILLED = Code(
    "stop.gateway_killed",
    "dead-man: the gateway was killed while {holder} had control, and the robot still moves",
)
STOP_LINK_LOST = Code("stop.link_lost", "the link was lost during a motion of {holder}: {detail}")
STOP_WENT_LOCAL = Code(
    "stop.went_local", "the controller changed to local control during a motion of {holder}"
)
STOP_FATE_UNKNOWN = Code("stop.fate_unknown", "the fate of a motion is unknown: {cause}")
STOP_WOULD_NOT_ARRIVE = Code(
    "stop.would_not_arrive",
    "a stop could not be sent now, because its connection to the controller is missing",
    "restore the connection that the event link.channel_lost names",
)
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
AXES_EXTRA = Code(
    "joints.axes_extra",
    "axis {axes} of its controller belongs to no joint of the model",
    "put it into the model, or name its number in other_axes of the site file if it neither carries nor "
    "moves the arm",
)
JOINTS_NOT_VERIFIED = Code(
    "joints.not_verified",
    "its joints are unproven: they were never compared with the pose that its controller computes",
    "run robomesh robot verify {robot} --out FILE, then set verified = FILE for this robot in the site file",
)
JOINTS_OF_OTHER_ROBOT = Code(
    "joints.of_other_robot",
    "its joints are unproven: the comparison was made with {other}",
    "run robomesh robot verify {robot} --out FILE",
)
JOINTS_DISAGREE = Code(
    "joints.disagree",
    "its joints are unproven: model and controller differ by the comparison of {time}",
    "change the model or the site file as the comparison says, then make it again",
)
JOINTS_OTHER_MODEL = Code(
    "joints.other_model",
    "its joints are unproven: the comparison of {time} was made with another model, or with other keys of "
    "the site file",
    "run robomesh robot verify again",
)
JOINTS_OTHER_SOFTWARE = Code(
    "joints.other_software",
    "its joints are unproven: its controller's software is {now}, the comparison was made with {before}",
    "run robomesh robot verify again",
)
JOINTS_INVALID = Code("joints.invalid", "its joints cannot be right ({cause})")
POSITIONS_UNKNOWN = Code("positions.unknown", "the robot's position is unknown ({cause})")
POSITIONS_NONE = Code("positions.none", "the controller has not reported joint positions")

SPEED_MISSING = Code("speed.missing", "SPEED needs speed_percent, from 1 to 100")
SPEED_OUTSIDE = Code("speed.outside", "speed {value:g} % is outside 1 to 100 %")
JOINT_COUNT = Code("joints.count", "{count} joint positions, but the robot has {joints} joints ({names})")
JOINTS_OUTSIDE = Code("joints.outside", "{cause}")
JOINT_LIMIT = Code("joints.limit", "joint {name} at {value} is beyond its limit {limit}")
JOINT_NOT_FINITE = Code("joints.not_finite", "joint {name} at {value} is not a finite number")
JOINT_BEYOND = Code("joints.beyond", "joint {name} at {value}, limits {lower} to {upper}")
JOINT_SHAPE = Code(
    "joints.shape",
    "joint positions of shape {shape}: this robot takes ({joints},), one value per joint",
)
JOINT_CONSTRAINT = Code("joints.constraint", "{terms} at {value} is beyond its limit {limit}")

# ------------------------------------------------------------------- programs and checks

PROGRAM_UNREADABLE = Code("program.unreadable", "{cause}")
PROGRAM_UNREACHABLE = Code("program.unreachable", "{cause}")
PROGRAM_EMPTY = Code("program.empty", "the program has no statement that does anything")
PROGRAM_BYTES = Code("program.bytes", "the program has {count} bytes; up to {most} are read")
PROGRAM_LINES = Code("program.lines", "the program has {count} lines; up to {most} are read")
PROGRAM_STEPS = Code("program.steps", "the program has more than {most} steps here, including repeats")
PROGRAM_STEPS_OF_LINES = Code(
    "program.steps_of_lines",
    "the program has more than {most} steps here, including those that lines are cut into",
)
STATEMENT_NEAR = Code("program.statement_near", "'{word}' is not a statement; did you mean '{near}'?")
STATEMENT_UNKNOWN = Code("program.statement_unknown", "'{word}' is not a statement; there are {names}")
POINT_FORM = Code(
    "program.point_form", "write a definition as 'point NAME = joints ...' or 'point NAME = pose ...'"
)
POINT_NAME = Code(
    "program.point_name",
    "'{name}' is not a valid point name: small letters, digits, _ and -, a letter first, up to {most}",
)
POINT_RESERVED = Code(
    "program.point_reserved", "'{name}' is a statement and not a valid point name: choose another"
)
POINT_TWICE = Code("program.point_twice", "point '{name}' is already defined in line {line}")
POINT_NEAR = Code("program.point_near", "{word}: there is no point '{name}'; did you mean '{near}'?")
POINT_UNKNOWN = Code("program.point_unknown", "{word}: there is no point '{name}'; there are {names}")
POINT_NONE = Code("program.point_none", "{word}: there is no point '{name}'; none is defined")
FRAME_FORM = Code(
    "program.frame_form",
    "'move_line_by' needs tool, base or site first, not {given}",
    "write for example 'move_line_by tool X Y Z ROLL PITCH YAW'",
)
LINE_AT_LIMIT = Code("program.line_at_limit", "joint {name} is at its limit there")
LINE_ENDS = Code(
    "program.line_ends",
    "the arm reaches no farther on this line without another posture",
    "move single joints",
)
LINE_ROLL = Code(
    "program.line_roll",
    "with five joints, a straight line cannot set the roll about the tool's axis",
    "move a joint instead",
)
TRACE_FORM = Code("program.trace_form", "'trace' takes on or off, not {given}")
REPEAT_NOT_CLOSED = Code("program.repeat_not_closed", "'repeat' has no 'end'")
REPEAT_NOT_WHOLE = Code("program.repeat_not_whole", "'repeat' takes a whole number, not {given}")
REPEAT_TOO_DEEP = Code("program.repeat_too_deep", "'repeat' is nested more than {most} deep")
END_WITHOUT_REPEAT = Code("program.end_without_repeat", "'end' without an open 'repeat' above")
NOT_A_NUMBER = Code("program.not_a_number", "'{word}': '{given}' is not a number")
JOINT_NUMBERS = Code(
    "program.joint_numbers",
    "'{word}' takes {count} numbers ({names}: degrees, mm of a prismatic joint), not {given}",
)
POSE_NUMBERS = Code(
    "program.pose_numbers", "'{word}' takes {count} numbers ({names}: mm and degrees), not {given}"
)
NUMBER_TOO_LARGE = Code(
    "program.number_too_large", "'{word}': {name} is {given}; must be between -{most:.0f} and {most:.0f}"
)
ONE_NUMBER = Code("program.one_number", "'{word}' takes one number ({unit}), not {given}")
NUMBER_OUTSIDE = Code(
    "program.number_outside", "'{word}' is {given}; must be between {least:g} and {most:g} {unit}"
)
NO_ARGUMENT = Code("program.no_argument", "'{word}' takes no argument, not '{given}'")
POINT_UNREACHABLE = Code("program.point_unreachable", "point {name} cannot be reached: {cause}")
POSE_UNREACHABLE = Code("program.pose_unreachable", "the pose at {place} mm cannot be reached: {cause}")
LINE_NOT_FOLLOWED = Code("program.line_not_followed", "the line cannot be followed: {cause}")
LINE_NOT_FOLLOWED_BEYOND = Code(
    "program.line_not_followed_beyond",
    "the line cannot be followed beyond {done_mm:.1f} of its {length_mm:.1f} mm: {cause}",
)
LINE_END = Code("program.line_end", "its end cannot be reached: {cause}")
LINE_JUMP = Code(
    "program.line_jump",
    "the arm would have to jump to another posture there, with joint {name} moving most",
)
LINE_AWAY = Code("program.line_away", "the tool stays {distance_mm:.1f} mm away from it")
LINE_BENT = Code(
    "program.line_bent",
    "the arm cannot keep its tool's axis within {limit_deg:g}° of a uniform rotation there",
)
PROGRAM_START_OUTSIDE = Code("program.start_outside", "at the start: {cause}")
PROGRAM_LINE = Code("program.line", "line {line}: {cause}")
PROGRAM_TOO_LONG = Code("program.too_long", "a program has at most {kib} KiB")
CELL_CHANGES = Code(
    "cell.changes",
    "{operator} is changing the cell of {robot}: no control and no motion until it is done",
    "try again in a moment",
)
CELL_DISAGREES = Code(
    "cell.disagrees",
    "kinematics shows other fixtures or another floor for {robot} than motions are checked against",
    "wait, or restart kinematics",
)
CELL_NOT_FOLLOWED = Code(
    "cell.not_followed",
    "kinematics cannot show the cell of {robot}: {cause}",
    "correct the cause, then restart kinematics",
)
CELL_CONTROLLED = Code(
    "cell.controlled",
    "{holder} has control of {robot}",
    "the cell can be changed when control is released",
)
CELL_MOVES = Code("cell.moves", "{robot} moves", "wait until every robot of the cell rests, or stop it")
CELL_UNKNOWN = Code(
    "cell.unknown",
    "it is not known whether {robot} rests, because its controller reports no position",
    "connect its controller first",
)
CELL_OUTDATED = Code(
    "cell.outdated", "the cell of {robot} has changed meanwhile", "load it again and repeat the change"
)
CELL_SAME = Code("cell.same", "nothing would change in the cell of {robot}")
CELL_NO_FILE = Code(
    "cell.no_file",
    "the gateway of {robot} runs without a site file in which a change could be saved",
    "write one and start the site with it",
)
CELL_NO_CELL = Code(
    "cell.no_cell",
    "{robot} has no cell, so it can have no fixture",
    "give it a `cell` in the site file and restart the site's services",
)
CELL_OTHER_GATEWAY = Code(
    "cell.other_gateway",
    "{robot} is of the same cell and has another gateway",
    "one gateway must serve all robots of a cell that is changed",
)
CELL_READ_ONLY = Code(
    "cell.read_only",
    "the gateway may not write {file} or its folder",
    "mount the folder writable, or change the file by hand and restart the site's services",
)
CELL_FILE_CHANGED = Code(
    "cell.file_changed",
    "{file} was changed on disk after the gateway read it",
    "restart the site's services, then repeat the change",
)
CELL_FILE_FORM = Code(
    "cell.file_form",
    "{file} writes this part in a form that cannot be changed without touching other lines",
    "write fixtures as [[fixture]] and robots as [[robot]] tables, or change the file by hand",
)
CELL_DISK = Code("cell.disk", "{file} cannot be read or written: {detail}")
CELL_FIXTURE = Code("cell.fixture", "fixture '{name}': {detail}")
CELL_CONTENT = Code("cell.content", "{detail}")
CELL_TOO_MANY = Code(
    "cell.too_many",
    "a cell that is changed by request has at most {most} {what}, not {count}",
    "combine some in one mesh, or edit the site file by hand and restart",
)
CELL_MESH = Code(
    "cell.mesh",
    "fixture '{name}': the site file names no mesh '{file}'",
    "a new mesh file is named in the site file first",
)
CELL_NO_KINEMATICS = Code(
    "cell.no_kinematics",
    "the kinematics service of {robot} does not take the change, so nothing has changed: {cause}",
)
CELL_CHECK_FAILED = Code(
    "cell.check_failed", "motions cannot be checked against the changed cell, so nothing has changed: {cause}"
)
CELL_TAKEN_BACK = Code(
    "cell.taken_back",
    "the change was taken back: the kinematics service of {robot} did not show it within {seconds:g} s",
    "look whether that service runs, then try again",
)
CELL_STUCK = Code(
    "cell.stuck",
    "the change failed ({cause}), and the old cell could not be restored: {detail}",
    "restart the gateway and the kinematics service of {robot}",
)
CELL_CHANGED = Code("cell.changed", "{operator} changed the cell of {robot}: {summary}")
CELL_ACCEPTED = Code("cell.accepted", "{summary}")
CELL_NOT_CHANGED = Code("cell.not_changed", "the cell was not changed: {cause}")
PROGRAMS_NAME = Code(
    "programs.name",
    "'{name}' is not a valid name",
    'use 1 to {most} letters, digits, spaces and signs except / \\ : * ? " < > |, without a full stop at '
    "the begin or end",
)
PROGRAMS_NAME_TAKEN = Code(
    "programs.name_taken", "{robot} already has a program named '{name}'", "choose another name, or open it"
)
PROGRAMS_ROBOT = Code("programs.robot", "site {site} has no robot {robot}", "check the name")
PROGRAMS_UNKNOWN = Code("programs.unknown", "{robot} has no stored program {id}", "list its programs")
PROGRAMS_VERSION = Code(
    "programs.version", "program '{name}' has no version {version}", "choose one from 1 to {newest}"
)
PROGRAMS_TEXT = Code(
    "programs.text", "no program of {robot} with SHA-256 {sha256} is stored: it was refused, or it is too old"
)
PROGRAMS_CHANGED = Code(
    "programs.changed",
    "{author} has changed program '{name}' meanwhile: its version is {version} now",
    "look at that version, then try again",
)
PROGRAMS_REASON = Code("programs.reason", "a program is deleted only with a reason", "write why")
PROGRAMS_NOT_TEXT = Code("programs.not_text", "the program contains a NUL character", "choose a text file")
PROGRAMS_FULL = Code(
    "programs.full",
    "the site's programs already take {most_mib:g} MiB, all that [programs] most_mib allows",
    "raise it in the site file",
)
PROGRAMS_TOO_MANY = Code(
    "programs.too_many",
    "{robot} already has {most} programs, the most that a robot may have, with deleted ones",
)
PROGRAMS_VERSIONS = Code(
    "programs.versions",
    "program '{name}' already has {most} versions, the most that a program may have",
    "save it under another name",
)
PROGRAMS_DISK = Code("programs.disk", "the store cannot write to its disk, so nothing has changed: {detail}")
PROGRAMS_SAVED = Code("programs.saved", "{author} saved program '{name}', version {version}")
PROGRAMS_ASIDE = Code(
    "programs.aside",
    "{author} saved program '{name}' on an older version: kept as version {version}, not as the current one",
)
PROGRAMS_RENAMED = Code("programs.renamed", "{author} renamed program '{old}' to '{name}'")
PROGRAMS_RESTORED = Code(
    "programs.restored", "{author} restored version {from_version} of program '{name}' as version {version}"
)
PROGRAMS_DELETED = Code(
    "programs.deleted", "{author} deleted program '{name}' ({reason}); it can be restored"
)
PROGRAMS_DAMAGED = Code(
    "programs.damaged",
    "a stored program cannot be read ({detail})",
    "restore the file from a backup and restart the store",
)
PROGRAMS_RUN_LOST = Code(
    "programs.run_lost", "the text of program '{name}', which ran, is not kept: {detail}"
)
LAYOUTS_UNKNOWN = Code("layouts.unknown", "the site has no layout '{name}'", "look at the list")
LAYOUTS_NAME_TAKEN = Code(
    "layouts.name_taken",
    "the site already has a layout '{name}', by {author}",
    "choose another name, or replace it",
)
LAYOUTS_TEXT = Code(
    "layouts.text",
    "a layout is the part of an address after its '?', at most {most} characters without spaces",
)
LAYOUTS_FULL = Code(
    "layouts.full",
    "a site keeps at most {most} layouts and {most_kib} KiB of them",
    "delete one that nobody needs",
)
LAYOUTS_DAMAGED = Code(
    "layouts.damaged",
    "the stored layouts cannot be read ({detail})",
    "the damaged file is layouts.damaged; restore layouts.json from a backup and restart the store",
)
NOTE_WRITTEN = Code("note.written", "{author} noted: {text}")
NOTE_WITHDRAWN = Code("note.withdrawn", "{by} withdrew the note of {author}: {text}")
NOTES_TEXT = Code("notes.text", "a note has 1 to {most} characters", "this one has {count}")
NOTES_ID = Code("notes.id", "'{id}' cannot be the id of a note", "use 8 to 64 letters, digits and '-'")
NOTES_ID_TAKEN = Code("notes.id_taken", "{robot} already has another note {id}", "choose another id")
NOTES_RANGE = Code("notes.range", "the note ends {seconds:.1f} s before it begins", "swap its times")
NOTES_FUTURE = Code(
    "notes.future",
    "the note is on a time {seconds:.0f} s in the future",
    "choose a past time, or check the clocks of both machines",
)
NOTES_UNKNOWN = Code("notes.unknown", "{robot} has no note {id}", "list its notes")
NOTES_AUTHOR = Code(
    "notes.author", "{author} wrote this note, so only {author} or an administrator may withdraw it"
)
NOTES_FULL = Code(
    "notes.full",
    "the site's notes already take {most_mib:g} MiB, all that [programs] notes_mib allows",
    "raise it in the site file",
)
NOTES_DAMAGED = Code(
    "notes.damaged",
    "{count} lines of {file} cannot be read as notes",
    "they stay in the file; restore it from a backup and restart the store",
)
JOG_MISSING = Code("jog.missing", "JOG without a direction", "send `jog` with frame, axis and speed")
JOG_FRAME = Code("jog.frame", "the frame of a jog is missing", "choose TOOL, BASE, SITE or JOINT")
JOG_AXIS = Code("jog.axis", "the axis of a jog is missing", "choose X, Y, Z, ROLL, PITCH or YAW")
JOG_JOINT = Code("jog.joint", "there is no joint {number}", "choose 1 to {joints}")
JOG_SPEED = Code(
    "jog.speed",
    "the speed of a jog, {speed:g} {unit}, is 0 or outside ±{most:g} {unit}",
    "choose another speed",
)
JOG_FORBIDDEN = Code("jog.forbidden", "the site file forbids jogging this robot (jog_speed = 0)", "use steps")
JOG_NO_DRIVER = Code(
    "jog.no_driver",
    "this controller cannot be jogged: its driver does not say that a motion on hold can be cancelled",
    "use steps",
)
JOG_NO_STATE = Code(
    "jog.no_state",
    "this controller cannot be jogged: it does not report whether it moves or is on hold",
    "use steps",
)
JOG_RUNS = Code("jog.runs", "a jog runs", "release it, and try again when the arm rests")
JOG_UNKNOWN = Code("jog.unknown", "no jog {id} runs")
JOG_SEQUENCE = Code(
    "jog.sequence", "keep-alive {sequence} of the jog is not new: the last one was {last}", "count up"
)
JOG_RELEASED = Code("jog.released", "released")
JOG_NOT_ALIVE = Code("jog.not_alive", "no keep-alive for {ms} ms", "use a faster computer or network")
JOG_NOT_HELD_DOWN = Code("jog.not_held_down", "no keep-alive came: nothing has moved")
JOG_COMMANDED = Code("jog.commanded", "the operator commanded {names}")
JOG_NOT_MOVING = Code("jog.not_moving", "the robot does not move", "check the controller")
JOG_FAILED = Code("jog.failed", "the gateway failed with an internal error", "see its log")
JOG_ENDED = Code("jog.ended", "jog {name} ended after {distance}: {cause}")
JOG_TOO_FAST = Code(
    "jog.too_fast",
    "the controller's lowest speed, {percent:g} %, moves the tool at {tool_mm_s:.0f} mm/s here",
    "choose a higher speed, or move single joints",
)
PROGRAM_MOVED = Code("program.moved", "the robot has moved since its program was checked")
PROGRAM_HOLD = Code("program.hold", "HOLD arrived during its check: not started")
PROGRAM_ASKER_GAVE_UP = Code(
    "program.asker_gave_up",
    "its check did not finish before its sender's deadline",
    "allow more time (not_after) and try again",
)
PROGRAM_PLAN_TOO_SLOW = Code("program.plan_too_slow", "planning it takes longer than {seconds:g} s")
STOP_JOG_NOT_HELD = Code("stop.jog_not_held", "the robot still moves {seconds:g} s after the hold of a jog")
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
CHECK_STARTING = Code("check.starting", "the check is still starting", "it is ready in a few seconds")
CHECK_BROKEN = Code("check.broken", "the check does not work: {cause}")
CHECK_FAILED = Code("check.failed", "the check failed: {cause}")
CHECK_IMPOSSIBLE = Code("check.impossible", "{cause}")
CHECK_NOTHING = Code("check.nothing", "its description has no link with a shape, so nothing can be checked")
CHECK_QUEUED_TOO_LONG = Code(
    "check.queued_too_long", "the check waited longer than {seconds:.1f} s for other checks"
)
CHECK_TOO_SLOW = Code(
    "check.too_slow",
    "the check takes longer than {seconds:.1f} s (the slowest of the last ones took {slowest:.1f} s)",
    "try again with a later not_after, or when the gateway's machine is less busy",
)
CHECK_NO_POSITION = Code("check.no_position", "its controller does not report the robot's position")
CHECK_HELD_WAY_UNKNOWN = Code(
    "check.held_way_unknown",
    "the target of the held motion is unknown",
    "cancel it (RESET), then send a new motion",
)
CHECK_TOOL_CHANGED = Code(
    "check.tool_changed",
    "tool, payload or frame were changed at the controller: {changes}",
    "set them back there, or confirm that they are right",
)
CHECK_OTHERS_UNKNOWN = Code("check.others_unknown", "unknown: {cause}")
CHECK_OTHER_UNKNOWN = Code("check.other_unknown", "the position or the target of {name} ({cause})")
CHECK_OTHERS_LEFT_OUT = Code("check.others_left_out", "unknown, so not included: {cause}")
CHECK_INTERPOLATION = Code(
    "check.interpolation",
    "joint moves: straight between the joint positions, all joints in phase, jerk-limited, from rest "
    "to rest; lines: joint moves that keep the tool within {line_mm:g} mm and {line_deg:g}° of the "
    "line, each from rest to rest; home: a joint move at half of the greatest speeds",
)
CHECK_NOTE_NO_SHAPE = Code(
    "check.note.no_shape", "not checked for collisions, because they have no shape: {links}"
)
CHECK_NOTE_PENDING = Code(
    "check.note.pending", "links whose hulls touch are not studied yet; until then they are checked as hulls"
)
CHECK_NOTE_LEFT_OUT = Code("check.note.left_out", "{name} is left out: its position is unknown")
CHECK_NOTE_ONLY_FLOOR = Code(
    "check.note.only_floor", "only the floor around the arm: its cell has no fixture and no other robot"
)
CHECK_NOTE_ALONE = Code(
    "check.note.alone", "no obstacle around the arm: its cell has no fixture, no floor and no other robot"
)
CHECK_NOTE_MORE_VIOLATIONS = Code("check.note.more_violations", "{count} more violations are not listed")
CHECK_NOTE_MORE_PROBLEMS = Code("check.note.more_problems", "{count} more problems are not listed")
CHECK_NOTE_ENDS = Code(
    "check.note.ends", "nothing after line {line} is checked: the program cannot get there"
)
CHECK_NOTE_BENT = Code(
    "check.note.bent",
    "line {lines}: between its ends the tool's axis is up to {angle_deg:.1f}° from a uniform rotation: "
    "this arm cannot follow it",
)
FLOOR_ADVICE = Code(
    "check.floor_advice",
    "if the floor is lower than {height_mm:g} mm, write floor = {below_mm}.0 for the robot in the "
    "site file; if there is none, floor = false",
)
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
LIMITS_DOUBTFUL = Code(
    "check.limits_doubtful",
    "limits of {name} are doubtful: {joints} ({detail})",
    "state their limits and max_speed in robot.toml or the site file, or correct the URDF",
)

# ------------------------------------------------------------------- audit log and latch file

AUDIT_SLOW = Code("audit.slow", "the audit log's disk takes longer than {seconds:g} s")
AUDIT_NOT_WRITABLE = Code("audit.not_writable", "the audit log {file} cannot be written ({cause})")
AUDIT_QUEUE_FULL = Code("audit.queue_full", "{count} entries wait for the disk")
LATCH_SLOW = Code("latch.slow", "the latch file {name} takes longer than {seconds:g} s to write")
LATCH_CLOSED = Code("latch.closed", "the latch file {name} is closed: its gateway is shutting down")
LATCH_NOT_WRITABLE = Code("latch.not_writable", "the latch file {name} cannot be written ({cause})")
LATCH_NOT_ALLOCATED = Code("latch.not_allocated", "the latch file {name} cannot be allocated ({cause})")
DISK_FULL = Code("disk.full", "{detail}", "make space on its disk")
DISK_FAULT = Code("disk.fault", "{detail}", "check its disk")
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

ALARM_FORGOTTEN = Code(
    "alarm.forgotten", "the saved alarms cannot be read, so acknowledgements are lost: {detail}"
)
ALARM_NOT_SAVED = Code("alarm.not_saved", "alarms cannot be saved; a restart would lose them: {detail}")

# Causes of alarms; the alarm has the advice.
GATEWAY_SILENT = Code(
    "gateway.silent", "the gateway of {robot} has reported nothing for more than {seconds:g} s"
)
CONTROLLER_STOPPED_ITSELF = Code(
    "controller.stopped_itself", "the controller has stopped the arm by itself, or its drives are off"
)
FAULT_REPORTED = Code("controller.fault_reported", "the controller has a fault: {fault}")
STOP_LATCHED_BY = Code("stop.latched_by", "stop {id} is latched by {by}: no reason given")
STOP_LATCHED_WHY = Code("stop.latched_why", 'stop {id} is latched by {by}: reason "{reason}"')
SITE_TWICE = Code("mesh.site_twice", "the name of site {site} is used twice: {names}")
SERVICE_TWICE = Code("mesh.service_twice", "robot {robot} has {count} {service} services: {names}")
CANNOT_LISTEN = Code(
    "service.cannot_listen",
    "{what} cannot listen on {address}: {detail}",
    "it is tried again; end the program that uses the port, or choose another address",
)
ADDRESS_ABSENT = Code(
    "service.address_absent",
    "{what} does not listen on {address} yet: this machine has no such address now",
    "it is tried again; bring its network up",
)
SERVICE_PROBLEM = Code("service.problem", "{name}: {cause}")
SERVICE_GONE = Code("service.gone", "{name} is gone")
SERVICE_MISSING = Code("service.missing", "{name} has not started")
SERVICE_SILENT = Code(
    "service.silent", "{name} is present but has reported nothing for more than {seconds:g} s"
)
SITE_GONE = Code("site.gone", "site {other} is gone: {site} does not see any of its services")
CLOCK_AHEAD = Code(
    "clock.ahead", "the clock of {host} is {seconds:.1f} s ahead of that of {watch} (the watch's)"
)
CLOCK_BEHIND = Code(
    "clock.behind", "the clock of {host} is {seconds:.1f} s behind that of {watch} (the watch's)"
)
VERSIONS_DIFFER = Code("mesh.versions", "versions differ: {versions}")
MESSAGES_LOST = Code("mesh.loss", "{name} lost {percent:.1f} % of the messages for it within a minute")
ROUTER_UNLINKED = Code(
    "router.unlinked", "{name} reaches {count:.0f} of the {wanted:.0f} routers that it should link to"
)
CERTIFICATE_EXPIRES = Code("certificate.expires", "the certificate of {name} expires on {date} UTC")
CERTIFICATE_EXPIRED = Code("certificate.expired", "the certificate of {name} expired on {date} UTC")

# ------------------------------------------------------------------- kinematics

INVERSE_TASK = Code("inverse.task", "task {task} is unknown", "use POSE_6D or POSITION_AND_AXIS_5D")
INVERSE_POSE = Code("inverse.pose", "{cause}")
INVERSE_NEAR = Code("inverse.near", "near: {cause}")
INVERSE_LIMITS = Code("inverse.limits", "limits: found only with {cause}")
INVERSE_TOO_FAR = Code(
    "inverse.too_far",
    "out of reach: {distance} from the first joint; the tool reaches at most {reach}",
)
INVERSE_GAP = Code(
    "inverse.gap", "out of reach: within its limits the tool stays at least {distance} from this position"
)
INVERSE_ORIENTATION = Code(
    "inverse.orientation",
    "not this orientation: at this position, the tool's orientation is at least {angle} off",
)
INVERSE_AXIS = Code(
    "inverse.axis", "not this orientation: at this position, the tool's axis is at least {angle} off"
)
POSE_NOT_NUMBERS = Code("pose.not_numbers", "the pose takes 16 numbers, 4 rows of 4, tool to base in metres")
POSE_SIZE = Code("pose.size", "the pose has {count} numbers; it must have 16, 4 rows of 4")
POSE_SHAPE = Code("pose.shape", "the pose has numbers of shape {shape}; it must have 16, 4 rows of 4")
POSE_NOT_FINITE = Code("pose.not_finite", "the pose holds {value}; every number must be finite")
POSE_LAST_ROW = Code("pose.last_row", "the pose has the last row {row}; it must be 0 0 0 1")
POSE_TOO_FAR = Code("pose.too_far", "the pose is {distance_m:.3g} m away; it must be less than {limit_m:g} m")
POSE_NO_ROTATION = Code(
    "pose.no_rotation",
    "the pose has no rotation in its first 3 rows and columns: the rows must have length 1 and be at right "
    "angles, these have the lengths {lengths}",
)
POSE_MIRRORED = Code(
    "pose.mirrored",
    "the pose is mirrored: the determinant of its first 3 rows and columns is -1; it must be 1",
)
POSE_NEAR_NOT_FINITE = Code(
    "pose.near_not_finite",
    "the pose was requested near {positions}, which has a number that is not finite",
)
CHECK_START_UNKNOWN = Code("check.start_unknown", "the position of {robot} is unknown", "give `start`")
JOINT_COUNT_OF_FIELD = Code(
    "joints.count_of_field", "{field} has {count} values, but {robot} has {joints} joints ({names})"
)
MESH_CHANGED = Code(
    "mesh.changed",
    "{key} has SHA-256 {sha256}, not {wanted}, because the robot's description has changed",
    "load the page again",
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
RECORDING_FAILED = Code("recording.failed", "{cause}")
RECORDING_UNREADABLE = Code("recording.unreadable", "{cause}")
RECORDING_UNKNOWN = Code(
    "recording.unknown", "no recording '{name}' here", "use a file name from recordings/list"
)
RECORDING_FILE = Code("recording.file", "{file}: cannot be read: {detail}")
RECORDING_NOT_WRITABLE = Code("recording.not_writable", "{file}: cannot be written: {detail}")
RECORDING_EMPTY = Code("recording.empty", "{file} is empty: the disk was full, or the recorder was killed")
RECORDING_CUT = Code("recording.cut", "{file}: not a readable recording: it ends before its first message")
RECORDING_KILLED = Code("recording.killed", "its recorder was killed: readable up to that point")
RECORDING_DISK_FULL = Code("recording.disk_full", "ended: no space left on the disk")
RECORDING_DISK_FAILED = Code("recording.disk_failed", "ended: {detail}")
RECORDING_NOT_MCAP = Code("recording.not_mcap", "{file}: not an MCAP file: its first bytes are wrong")
RECORDING_DAMAGED = Code("recording.damaged", "{file}: damaged near byte {byte}")
RECORDING_CHUNK = Code("recording.chunk", "a chunk has {mib} MiB: the limit is {most} MiB")
RECORDING_ENDS = Code("recording.ends", "{file}: it ends before byte {byte}")
RECORDING_NO_BYTE = Code("recording.no_byte", "{file}: no byte {byte}: it has {total}")
RECORDING_NO_ATTACHMENT = Code(
    "recording.no_attachment", "{file} has no attachment '{name}'", "there are {attachments}"
)
RECORDING_NO_TOPIC = Code("recording.no_topic", "{file} has no topic '{topic}'", "there are {topics}")
RECORDING_NO_VALUE = Code("recording.no_value", "{file} has no value '{name}'", "there are {topics}")
RECORDING_CHANGED = Code("recording.changed", "{file} changed during the fetch", "fetch it again")
RECORDING_NOT_FOUND = Code(
    "recording.not_found", "no recording '{name}' on the mesh", "there are {recordings}"
)
RECORDING_SPAN = Code(
    "recording.span",
    "{file} is {seconds:.3f} s long, and the part is not within it, or ends before it begins",
    "choose a begin and an end, in seconds since its start",
)
RECORDING_VIDEO_LONG = Code(
    "recording.video_long",
    "the part is longer than {most:g} min",
    "choose a shorter one, or use robomesh recordings export",
)
RECORDING_VIDEO_SPACE = Code(
    "recording.video_space",
    "the console's machine has no {mib:.0f} MiB free for the video",
    "make room there",
)
RECORDING_VIDEO_BUSY = Code(
    "recording.video_busy", "{count} videos are being made or wait already", "try again later"
)
RECORDING_VIDEO_GONE = Code(
    "recording.video_gone", "this video is no longer kept (at most {minutes:g} min)", "render it again"
)
RECORDING_ZIP = Code("recording.zip", "a ZIP cannot have {count} recordings", "choose 1 to {most}")
RECORDING_AMBIGUOUS = Code(
    "recording.ambiguous", "several recordings have the name '{name}'", "name the file: {files}"
)
RECORDING_TOO_MANY_VALUES = Code(
    "recording.too_many_values", "{count} values are too many: request at most {most}"
)
RECORDING_TIMES = Code("recording.times", "the range ends before it begins")
RECORDING_TOO_LONG = Code(
    "recording.too_long",
    "the range is too long to read at once",
    "request at most {hours:g} h, with start and end",
)
RECORDING_OUTSIDE = Code(
    "recording.outside", "{file}: nothing from {start} to {end}: it goes from {first} to {last}"
)
RECORDING_SEVERAL_ROBOTS = Code(
    "recording.several_robots",
    "{file} is merged from recordings of several robots: {robots}",
    "use the recording of one of them",
)
RECORDING_NO_JOINTS = Code("recording.no_joints", "{file} contains no joint states")
RECORDING_RANGE = Code("recording.range", "{range}: {file} has {bytes} bytes")
RECORDING_TOO_MANY = Code(
    "recording.too_many_downloads", "{count} recordings are being sent already", "try again soon"
)
RECORDING_TITLE = Code(
    "recording.title",
    "'{name}' is not a valid name of a recording",
    'use 1 to {most} letters, digits, spaces and signs except / \\ : * ? " < > |, without a full stop at '
    "the begin or end",
)
RECORDING_NOTE = Code("recording.note", "the note has {count} characters", "use at most {most}")
RECORDING_TAG = Code(
    "recording.tag", "'{tag}' is not a valid tag", "use 1 to {most} letters, digits and signs except commas"
)
RECORDING_TAGS = Code("recording.tags", "{count} tags are too many", "use at most {most}")
RECORDING_REASON = Code("recording.reason", "a recording is deleted only with a reason", "write why")
RECORDING_CONFLICT = Code(
    "recording.conflict",
    "{author} has changed '{name}' meanwhile",
    "look at its name, note and tags, then try again",
)
RECORDING_CHANGES = Code("recording.changes", "'{name}' was already changed {most} times, the most possible")
RECORDING_LABELS_DAMAGED = Code(
    "recording.labels_damaged",
    "name, note and tags of a recording cannot be read ({detail})",
    "the damaged file ends with .changes.damaged; restore the .changes.json from a backup",
)
RECORDING_DISK = Code(
    "recording.disk", "the recorder cannot write to its disk, so nothing has changed: {detail}"
)
RECORDING_WRITTEN = Code("recording.written", "'{name}' is still being recorded", "stop it first")
RECORDING_INDEXED = Code("recording.indexed", "'{name}' is being indexed", "try again soon")
RECORDING_PLAYED = Code(
    "recording.played",
    "'{name}' is being played, or opened by another robomesh program",
    "close it there first",
)
RECORDING_FETCHED = Code(
    "recording.fetched", "{who} is downloading '{name}'", "wait for the end, or try again in {seconds:.0f} s"
)
RECORDING_RENAMED = Code("recording.renamed", "{author} renamed recording '{old}' to '{name}'")
RECORDING_NOTED = Code("recording.noted", "{author} changed the note of recording '{name}'")
RECORDING_TAGGED = Code("recording.tagged", "{author} tagged recording '{name}': {tags}")
RECORDING_UNTAGGED = Code("recording.untagged", "{author} removed all tags of recording '{name}'")
RECORDING_DELETED = Code(
    "recording.deleted",
    "{author} deleted recording '{name}' ({reason}): {file}, {bytes} bytes, SHA-256 {sha256}",
)
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
VIEW_NO_ROOM = Code("view.no_room", "no capacity: {cause}")
VIEWS_TOO_MANY = Code(
    "view.too_many",
    "{count} requested views exist, and {most} are possible (most_views in the site file's [renderer])",
    "retry when some of them have ended",
)
VIEWS_TOO_COSTLY = Code(
    "view.too_costly_now",
    "{width} x {height} at {fps:g} a second counts for {megapixels:.1f} million pixels a second: "
    "{left_megapixels:.1f} of {most_megapixels:.1f} million are left for requested views; request a "
    "smaller or slower one",
)
VIEW_INVALID = Code("view.invalid", "{cause}")
VIEW_TOO_COSTLY = Code(
    "view.too_costly",
    "{width} x {height} at {fps:g} a second counts for {megapixels:.1f} million pixels a second: "
    "requested views may have {most_megapixels:.1f} million together; {possible} a second is possible, more "
    "with a larger size, fps or most_views in the site file's [renderer]",
)
VIEW_OR_OF = Code("view.or_of", "a view request needs either `view`, a camera, or `of`, a view's name")
VIEW_SIZE = Code(
    "view.size",
    "size {width} x {height}: must be even numbers from {least} to {most}, with at most as many pixels as "
    "1920 x 1080",
)
VIEW_VALUE = Code("view.value", "{field} {value:g}: must be from {least:g} to {most:g}, or 0 for the default")
VIEW_GHOST = Code("view.ghost", "the ghost has {count} joint positions: the robot has {joints} joints")
VIEW_PATH = Code("view.path", "the path has {count} points: at most {most} are drawn")
VIEW_NOT_FINITE = Code("view.not_finite", "the ghost or path has a number that is not finite")
CAMERA_NO_DIRECTION = Code(
    "camera.no_direction", "eye and target are both at ({place}) m: they must be different points"
)
CAMERA_HEIGHT = Code("camera.height", "height {value:g} m: must be from {least:g} to {most:g}")
CAMERA_ANGLE = Code(
    "camera.angle",
    "field_of_view {value:g} rad: must be from {least:.3f} to {most:.3f} ({least_deg:g}° to {most_deg:g}°)",
)
CAMERA_MOUNT = Code("camera.mount", "mount '{mount}' is not a link or frame of the robot; use {names}")
CAMERA_VECTOR = Code("camera.vector", "{field} ({numbers}): numbers must be from -{most:g} to {most:g}")
VIEW_NO_ANSWER = Code("view.no_answer", "the answer to {key}/views contains no view")
VIEW_NO_RENDERER = Code(
    "view.no_renderer",
    "no renderer answers for {robot}",
    "check that its name is right and that its renderer runs",
)
VIEW_NO_PICTURE = Code("view.no_picture", "no picture of {view} arrived within {seconds:g} s")
VIEW_NOT_A_PICTURE = Code("view.not_a_picture", "{key} is not a picture")
VIEW_PICTURE_UNREADABLE = Code("view.picture_unreadable", "the newest picture cannot be read: {detail}")
VIEW_NO_PNG = Code("view.no_png", "this console has no PyAV to make PNG", "request .jpg instead")
VIEW_PARAMETER = Code("view.parameter", "the parameter '{name}' is unknown", "use width, height and fps")
VIEW_NOT_A_NUMBER = Code("view.not_a_number", "{name}='{value}' is not a number")
VIEW_NOT_PIXELS = Code("view.not_pixels", "{name}='{value}' is not a number of pixels")
VIEW_TOO_MANY_STILLS = Code("view.too_many_stills", "{count} stills are being made", "try again in a moment")
VIEW_TOO_MANY_STREAMS = Code(
    "view.too_many_streams", "{count} video streams are open already", "close one first"
)
VIEW_TOO_MANY_STREAMS_OF = Code(
    "view.too_many_streams_of", "{address} has {count} open video streams already", "close one first"
)

# --------------------------------------------------------------------- Define

DEFINE_UNREADABLE = Code("define.unreadable", "{detail}")
DEFINE_NO_ROBOT = Code("define.no_robot", "there is no robot '{name}' here")
DEFINE_MODEL_GONE = Code("define.model_gone", "this mesh is no longer stored", "load the page again")
DEFINE_FILE_GONE = Code("define.file_gone", "{files}: no longer stored", "drop the files on the page again")
DEFINE_PATH = Code(
    "define.path",
    "'{path}' is not the path of a robot's file",
    "use a path below the robot's folder, like meshes/base.wrl",
)
DEFINE_PATH_TOO_LONG = Code("define.path_too_long", "'{path}' is too long for a file name")
DEFINE_FILES = Code("define.files", "`files` must give each path the SHA-256 of its file")
DEFINE_FILE_NOT_GIVEN = Code("define.file_not_given", "'{file}' is not one of the given files")
DEFINE_FILE_IS_FOLDER = Code("define.file_is_folder", "a file's name is another file's folder")
DEFINE_FILE_TOO_LARGE = Code("define.file_too_large", "the file is larger than {megabytes:g} MB")
DEFINE_TOO_MANY_FILES = Code("define.too_many_files", "{count} files: at most {most} are possible")
DEFINE_FILES_TOO_LARGE = Code(
    "define.files_too_large", "{count} files of {megabytes:.0f} MB: at most {most:.0f} MB are possible"
)
DEFINE_UPLOADS = Code("define.uploads", "{count} files are being sent already", "try again in a moment")
DEFINE_NOT_ZIP = Code("define.not_zip", "the file is not a readable zip archive: {detail}")
DEFINE_ZIP_TOO_LARGE = Code(
    "define.zip_too_large",
    "the archive contains {count} files of {megabytes:.0f} MB: at most {most} files and "
    "{most_megabytes:.0f} MB are possible",
)
DEFINE_NOT_URDF = Code("define.not_urdf", "{file} is not a robot's URDF")
DEFINE_JOINTS = Code("define.joints", "`joints` must have one finite number for each joint, {count} in total")
DEFINE_PROBLEMS = Code(
    "define.problems",
    "the robot is not saved, because its description has problems ({count})",
    "correct them first",
)
DEFINE_EXISTS = Code("define.exists", "there is a robot {name} in {folder} already")
DEFINE_CHANGED = Code(
    "define.changed",
    "{name} in {folder} was changed after it was opened",
    "a save over it loses these changes",
)
DEFINE_TOO_SLOW = Code("define.too_slow", "this took more than {seconds:g} s and was stopped")
DEFINE_CRASHED = Code(
    "define.crashed",
    "this crashed the worker process twice: it may be damaged, or need too much memory ({detail})",
)
DEFINE_MEMORY = Code("define.memory", "reading it takes more than {gigabytes:g} GB of memory")
DEFINE_NESTED = Code("define.nested", "it is nested too deeply to read")
DEFINE_DISK = Code("define.disk", "the console cannot write to its disk: {detail}")
DEFINE_SITE_HAS = Code(
    "define.site_has", "the site {site} has a robot {name} already", "save yours under another name"
)
DEFINE_NO_SUPERVISOR = Code(
    "define.no_supervisor",
    "no supervisor runs here (robomesh up). Add this to the site file and restart the site's services:"
    '\n\n[[robot]]\nname = "{name}"\nmodel = "{model}"\ncontroller = "simulated"',
)
DEFINE_RUNS = Code("define.runs", "{name} runs already", "it restarts whenever it is saved")
DEFINE_IN_SITE_FILE = Code("define.in_site_file", "{name} is in the site file", "remove it there")
DEFINE_NOT_STARTED = Code("define.not_started", "{name} was not started from the page")
DEFINE_STARTED_UNREADABLE = Code(
    "define.started_unreadable", "the list of started robots is invalid ({detail})", "repair or remove it"
)
