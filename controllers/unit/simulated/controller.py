"""State machine of the simulated controller: units in, state records out. No I/O; time is an argument.

    state     move, home   hold      resume   stop      reset     at rest
    --------  -----------  --------  -------  --------  --------  -----------------
    idle      moving       holding   -        stopped   -         demo: moving
    moving    moving*      holding   -        stopped   -         next motion, idle
    homing    then moving  holding   -        stopped   -         next motion, idle
    holding   refused      -         resumes  stopped   idle      -
    stopped   refused      -         -        -         idle      -

*A new unit's motions replace the running one smoothly; only homing is completed first. The motions of one
unit run one after the other. A motion that began at rest stays on its straight line when its speed changes
or when it is held, resumed or stopped. The status is "moving" while the arm brakes; "stopped" and "holding"
mean that it is at rest.
"""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from controllers.unit.simulated.execution import (
    Move,
    Order,
    SetSpeed,
    Situation,
    Word,
    orders_of,
)
from protocol_gateway.unit_protocol.codes import code_table
from protocol_gateway.unit_protocol.records import (
    AbsolutePositions,
    Error,
    Record,
    Status,
    Time,
    Velocities,
    asks_to_stop,
)
from protocol_gateway.unit_protocol.scales import si_scales
from robots.kinematics.joints import FloatArray, Joints
from robots.kinematics.motion import Motion
from robots.kinematics.straight_motion import HOMING_REST_S, HOMING_SPEED

_DEMO_SPEED = 0.6
_DEMO_REST_S = 0.4
# An encoder's resolution, in degrees or millimetres.
_DECIMALS = 6


class Controller:
    """State of one simulated controller.

    Args:
        codes: Type codes as in the site file; if empty, names are written.
        demo: Targets [rad] or [m] of an endless motion until the first motion command; None for rest.
            A controller boots without a reference position and reports `homed` only after homing. A demo
            begins homed, because it represents an arm that has been at work for a long time.
        now_s: The clock's time at boot.
    """

    def __init__(
        self,
        joints: Joints,
        *,
        codes: Mapping[int, str],
        demo: Iterator[FloatArray] | None,
        now_s: float,
    ) -> None:
        self.table = code_table(codes)
        self._joints = joints
        self._scales = np.array(si_scales(joints.types))
        self._motion = Motion(joints, joints.home.copy())
        self._demo = demo
        self._boot_s = now_s
        self._homed = demo is not None
        self._trace = self._stopped = self._holding = False
        self._speed = 1.0
        self._task: Move | None = None
        self._queue: deque[Move] = deque()

    def execute(self, records: Sequence[Record], now_s: float) -> Error | None:
        """Execute a client's unit, all or nothing; return the error record if it is refused."""
        orders = orders_of(records, self._joints, self._situation(now_s))
        if isinstance(orders, Error):
            # A stop is executed even if the rest of its unit is invalid.
            if asks_to_stop(records):
                self._do([Word("stop")], now_s)
            return orders
        self._do(orders, now_s)
        return None

    def tick(self, now_s: float) -> None:
        """Begin the next motion if the current one has ended."""
        if self._holding or self._stopped or self._motion.moving(now_s):
            return
        if self._task is not None and now_s >= self._motion.end_s + self._pause_s():
            self._homed = self._homed or self._task.homing
            self._task = None
        if self._task is None and self._queue:
            self._begin(self._queue.popleft(), now_s)
        elif self._task is None and self._demo is not None:
            self._begin(Move(next(self._demo)), now_s)

    def state_records(self, now_s: float) -> tuple[Record, ...]:
        """Return the records of the controller's state."""
        state = self._motion.state(now_s)
        positions = (state.positions / self._scales).round(_DECIMALS) + 0.0  # no "-0.00"
        velocities = (state.velocities / self._scales).round(_DECIMALS) + 0.0
        return (
            AbsolutePositions(tuple(positions.tolist())),
            Velocities(tuple(velocities.tolist())),
            Status(self._words(now_s)),
            Time(round(now_s - self._boot_s, _DECIMALS)),
        )

    # ------------------------------------------------------------------------ orders

    def _situation(self, now_s: float) -> Situation:
        positions = self._motion.state(now_s).positions
        if self._homing():
            positions = self._queue[-1].target if self._queue else self._joints.home
        return Situation(stopped=self._stopped, holding=self._holding, positions=positions)

    def _do(self, orders: Sequence[Order], now_s: float) -> None:
        motions = [order for order in orders if isinstance(order, Move)]
        if motions and not self._homing():
            self._clear_motions()
        for order in orders:
            match order:
                case Move():
                    self._queue.append(order)
                case SetSpeed(fraction):
                    self._speed = fraction
                    if self._task is not None and not self._holding and self._motion.moving(now_s):
                        self._begin(self._task, now_s)
                case Word(word):
                    self._word(word, now_s)
        if any(isinstance(order, Move) or _moves(order) for order in orders):
            self._demo = None
        if self._queue and self._task is None and not (self._holding or self._stopped):
            self._begin(self._queue.popleft(), now_s)

    def _word(self, word: str, now_s: float) -> None:
        match word:
            case "trace" | "untrace":
                self._trace = word == "trace"
            case "stop":
                self._stopped, self._holding = True, False
                self._clear_motions()
                self._motion.brake(now_s)
            case "hold" if not self._stopped:
                self._holding = True
                self._motion.brake(now_s)
            case "resume" if self._holding:
                self._holding = False
                if self._task is not None:
                    self._begin(self._task, now_s)
            case "reset":
                if self._holding:
                    self._clear_motions()
                self._stopped = self._holding = False

    def _begin(self, task: Move, now_s: float) -> None:
        self._task = task
        slower = HOMING_SPEED if task.homing else _DEMO_SPEED if self._demo is not None else 1.0
        self._motion.move(task.target, now_s, speed=self._speed * slower)

    def _clear_motions(self) -> None:
        self._queue.clear()
        self._task = None

    # ------------------------------------------------------------------------- state

    def _homing(self) -> bool:
        return self._task is not None and self._task.homing

    def _pause_s(self) -> float:
        """Return the time that the arm rests after the running task [s]."""
        if self._homing():
            return HOMING_REST_S
        return _DEMO_REST_S if self._demo is not None else 0.0

    def _words(self, now_s: float) -> tuple[str, ...]:
        flags = (("homed",) if self._homed else ()) + (("trace",) if self._trace else ())
        return (self._activity(now_s), "remote", *flags)

    def _activity(self, now_s: float) -> str:
        braking = (self._stopped or self._holding) and self._motion.moving(now_s)
        if braking:
            return "moving"
        if self._stopped or self._holding:
            return "stopped" if self._stopped else "holding"
        if self._homing():
            return "homing"
        return "moving" if self._task is not None or self._motion.moving(now_s) else "idle"


def _moves(order: Order) -> bool:
    """Return whether a word concerns motion and so ends a demo; traces and speeds do not."""
    return isinstance(order, Word) and order.word not in ("trace", "untrace")
