"""URScript program that makes one motion. The gateway builds it from numbers only, never from texts.

The gateway sends the program to the controller, and permits its motion by another connection, in registers:

    register   written by   content
    --------   ----------   --------------------------------------------------------------------------
    go         gateway      number of the permitted motion: a program with another number moves nothing
    beat       gateway      a new number at least WATCHDOG_HZ times a second; without it the arm stops
    outputs    program      its number, its `Progress`, and the newest beat that it has read

The program waits at most PERMISSION_S for its permission. So a program that arrives after the gateway has
given up its motion moves nothing, and the arm stops if the gateway ends. After the motion nothing of the
program remains in the controller.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

WATCHDOG_HZ = 10
"""Least frequency of beats [Hz]; the controller stops the program without them."""
PERMISSION_S = 0.2
"""Longest time for which a program waits for its permission [s]."""
STOP_ACCELERATION = 4.0
"""Deceleration of the program's own stop, of the leading joint [rad/s²]."""
REGISTERS = range(24, 48)
"""General purpose registers for clients of RTDE; those below are for fieldbuses."""
INPUTS = 2
OUTPUTS = 3


class Progress(IntEnum):
    """Progress of a program."""

    MOVING = 1
    DONE = 2
    STOPPED = 3
    NOT_BEGUN = 4


@dataclass(frozen=True, kw_only=True)
class Registers:
    """Registers that a program uses.

    Attributes:
        first_input: Number of the first of INPUTS integer inputs: `go`, `beat`.
        first_output: Number of the first of OUTPUTS integer outputs: number, progress, beat.
    """

    first_input: int = 24
    first_output: int = 24

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs in RTDE."""
        return tuple(f"input_int_register_{self.first_input + place}" for place in range(INPUTS))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs in RTDE."""
        return tuple(f"output_int_register_{self.first_output + place}" for place in range(OUTPUTS))


def motion_script(
    number: int,
    target: Sequence[float],
    *,
    speed: float,
    acceleration: float,
    registers: Registers,
) -> bytes:
    """Return the program of a motion.

    Args:
        number: Number of the motion, above 0.
        target: Joint positions [rad].
        speed: Of the leading joint [rad/s].
        acceleration: Of the leading joint [rad/s²].

    Raises:
        ValueError: If a number is not finite, or not above 0.
    """
    if not all(map(math.isfinite, (*target, speed, acceleration))) or min(speed, acceleration, number) <= 0:
        raise ValueError("numbers of a motion are finite; number, speed and acceleration are above 0")
    joints = ", ".join(f"{each:.9f}" for each in target)
    go, beat = registers.first_input, registers.first_input + 1
    own, progress, heard = (registers.first_output + place for place in range(OUTPUTS))
    lines = f"""def robomesh_motion():
  global arrived = False
  thread move():
    movej([{joints}], a={acceleration:.6f}, v={speed:.6f}, t=0, r=0)
    arrived = True
  end
  write_output_integer_register({heard}, read_input_integer_register({beat}))
  write_output_integer_register({progress}, {Progress.NOT_BEGUN:d})
  write_output_integer_register({own}, {number:d})
  waited = 0.0
  while read_input_integer_register({go}) != {number:d} and waited < {PERMISSION_S:.1f}:
    sync()
    waited = waited + get_steptime()
  end
  if read_input_integer_register({go}) == {number:d}:
    rtde_set_watchdog("{registers.inputs[1]}", {WATCHDOG_HZ:d}, "stop")
    write_output_integer_register({progress}, {Progress.MOVING:d})
    moving = run move()
    while not arrived and read_input_integer_register({go}) == {number:d}:
      write_output_integer_register({heard}, read_input_integer_register({beat}))
      sync()
    end
    if arrived:
      write_output_integer_register({progress}, {Progress.DONE:d})
    else:
      kill moving
      stopj({STOP_ACCELERATION:.1f})
      write_output_integer_register({progress}, {Progress.STOPPED:d})
    end
  end
end
"""
    return lines.encode("ascii")
