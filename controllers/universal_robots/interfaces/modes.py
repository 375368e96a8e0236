"""Modes and status bits of Universal Robots' controllers, in RTDE and on the primary interface."""

from enum import IntEnum, IntFlag


class RobotMode(IntEnum):
    """Value of `robot_mode`."""

    NO_CONTROLLER = -1
    DISCONNECTED = 0
    CONFIRM_SAFETY = 1
    BOOTING = 2
    POWER_OFF = 3
    POWER_ON = 4
    IDLE = 5
    BACKDRIVE = 6
    RUNNING = 7
    UPDATING_FIRMWARE = 8


class SafetyMode(IntEnum):
    """Value of `safety_mode` and `safety_status`; the former has no values above 11."""

    NORMAL = 1
    REDUCED = 2
    PROTECTIVE_STOP = 3
    RECOVERY = 4
    SAFEGUARD_STOP = 5
    SYSTEM_EMERGENCY_STOP = 6
    ROBOT_EMERGENCY_STOP = 7
    VIOLATION = 8
    FAULT = 9
    VALIDATE_JOINT_ID = 10
    UNDEFINED = 11
    AUTOMATIC_MODE_SAFEGUARD_STOP = 12
    SYSTEM_THREE_POSITION_ENABLING_STOP = 13
    PENDANT_THREE_POSITION_ENABLING_STOP = 14
    IMMI_EMERGENCY_STOP = 15
    IMMI_SAFEGUARD_STOP = 16
    PROFISAFE_WAITING_FOR_PARAMETERS = 17
    PROFISAFE_AUTOMATIC_MODE_SAFEGUARD_STOP = 18
    PROFISAFE_SAFEGUARD_STOP = 19
    PROFISAFE_EMERGENCY_STOP = 20
    SAFETY_API_SAFEGUARD_STOP = 22


class JointMode(IntEnum):
    """Value of `joint_mode`, one a joint."""

    RESET = 235
    SHUTTING_DOWN = 236
    PART_D_CALIBRATION = 237
    BACKDRIVE = 238
    POWER_OFF = 239
    READY_FOR_POWER_OFF = 240
    NOT_RESPONDING = 245
    MOTOR_INITIALISATION = 246
    BOOTING = 247
    PART_D_CALIBRATION_ERROR = 248
    BOOTLOADER = 249
    CALIBRATION = 250
    VIOLATION = 251
    FAULT = 252
    RUNNING = 253
    IDLE = 255


class RuntimeState(IntEnum):
    """Value of `runtime_state`: the state of the program."""

    STOPPING = 0
    STOPPED = 1
    PLAYING = 2
    PAUSING = 3
    PAUSED = 4
    RESUMING = 5


class RobotStatus(IntFlag):
    """Bits of `robot_status_bits`."""

    POWER_ON = 1 << 0
    PROGRAM_RUNNING = 1 << 1
    TEACH_BUTTON_PRESSED = 1 << 2
    POWER_BUTTON_PRESSED = 1 << 3


class SafetyStatus(IntFlag):
    """Bits of `safety_status_bits`."""

    NORMAL_MODE = 1 << 0
    REDUCED_MODE = 1 << 1
    PROTECTIVE_STOPPED = 1 << 2
    RECOVERY_MODE = 1 << 3
    SAFEGUARD_STOPPED = 1 << 4
    SYSTEM_EMERGENCY_STOPPED = 1 << 5
    ROBOT_EMERGENCY_STOPPED = 1 << 6
    EMERGENCY_STOPPED = 1 << 7
    VIOLATION = 1 << 8
    FAULT = 1 << 9
    STOPPED_DUE_TO_SAFETY = 1 << 10
    THREE_POSITION_INPUT_ACTIVE = 1 << 11


class ReportLevel(IntEnum):
    """Severity of an alarm on the primary interface; 128 and more are those of UR's developers."""

    DEBUG = 0
    INFO = 1
    WARNING = 2
    VIOLATION = 3
    FAULT = 4
    CRITICAL_FAULT = 5
    DEVELOPER_DEBUG = 128
    DEVELOPER_INFO = 129
    DEVELOPER_WARNING = 130
    DEVELOPER_VIOLATION = 131
    DEVELOPER_FAULT = 132
    DEVELOPER_CRITICAL_FAULT = 133


class TextLevel(IntEnum):
    """Severity of a text message in RTDE."""

    EXCEPTION = 0
    ERROR = 1
    WARNING = 2
    INFO = 3


def name_of(kind: type[IntEnum], value: int) -> str:
    """Return the name of a mode, or `unknown 42`: newer software may report values that are not listed."""
    try:
        return kind(value).name
    except ValueError:
        return f"unknown {value}"
