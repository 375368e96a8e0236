"""From what is met sample by sample to violations that last: adjacent samples of the same are one."""

from dataclasses import dataclass, field

import numpy as np

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.cells import FLOOR
from robots.joints import FloatArray
from robots.programs.steps import Violation, ViolationKind

# What is told; the rest is counted.
MOST_VIOLATIONS = 1_000
# What an arm that retreats may come nearer by meanwhile: what distances may be wrong by, and no more.
_ROUNDED_M = 1e-5
# Nearer than at the start it may not come at all: the next motion would begin there, and so on.
_SAME_M = 1e-9
_NO_POINTS: FloatArray = np.zeros((0, 3))


@dataclass
class _Run:
    """A violation that may go on."""

    line: int
    kind: ViolationKind
    pair: tuple[str, ...]
    begin_s: float
    until_s: float
    sample: int
    value: float
    points: FloatArray
    limit: float
    stops: bool
    # Of a clearance: the pair touches before, meanwhile or behind; then that is told, and not this.
    touches: bool = False


@dataclass
class _Retreat:
    """A pair that has come no nearer since the start: the last sample, its distances at first and at most."""

    sample: int
    start_m: float
    farthest_m: float


@dataclass
class Runs:
    """Violations of a motion, as its samples are gone through.

    Attributes:
        untold: How many there are beyond those that are kept.
    """

    untold: int = 0
    _open: dict[tuple[int, ViolationKind, tuple[str, ...]], _Run] = field(default_factory=dict)
    _all: list[_Run] = field(default_factory=list)
    # Pairs nearer than allowed at the start, and since then not nearer.
    _retreats: dict[tuple[str, ...], _Retreat] = field(default_factory=dict)

    def met(
        self,
        *,
        line: int,
        sample: int,
        time_s: float,
        kind: ViolationKind,
        value: float,
        limit: float,
        pair: tuple[str, ...] = (),
        points: FloatArray = _NO_POINTS,
        stops: bool = True,
        within: int = 1,
    ) -> None:
        """Something is wrong at a sample; samples come in order, and count from 0 through the whole motion.

        Args:
            value: How bad, the smaller the worse: a distance [m], a margin, a speed with its sign turned.
            limit: What it should have been.
            within: So many samples on it is still the same violation.
        """
        # How far two are in each other is not known, but how far one is below the floor: it may come up.
        measured = kind is ViolationKind.CLEARANCE or FLOOR in pair
        if pair and self._retreating(pair, sample, value) and measured:
            return
        key = (line, kind, pair)
        other = ViolationKind.COLLISION if kind is ViolationKind.CLEARANCE else ViolationKind.CLEARANCE
        beside = self._open.get((line, other, pair)) if pair else None
        if beside is not None and sample - beside.sample > within:
            beside = None
        if beside is not None and kind is ViolationKind.COLLISION:
            # Who comes near, touches and goes again was near all the while.
            beside.sample, beside.until_s, beside.touches = sample, time_s, True
        run = self._open.get(key)
        if run is None or sample - run.sample > within:
            run = _Run(line, kind, pair, time_s, time_s, sample, value, points, limit, stops)
            run.touches = beside is not None and kind is ViolationKind.CLEARANCE
            self._open[key] = run
            if len(self._all) < MOST_VIOLATIONS:
                self._all.append(run)
            else:
                self.untold += 1
        if value < run.value:
            run.value, run.limit, run.points = value, limit, points
        run.stops = run.stops or stops
        run.until_s, run.sample = time_s, sample

    def _retreating(self, pair: tuple[str, ...], sample: int, distance_m: float) -> bool:
        """Whether a pair was too near at the start and has come no nearer."""
        if sample == 0:
            self._retreats[pair] = _Retreat(0, distance_m, distance_m)
            return True
        retreat = self._retreats.get(pair)
        if retreat is None:
            return False
        least = max(retreat.start_m - _SAME_M, retreat.farthest_m - _ROUNDED_M)
        if sample - retreat.sample > 1 or distance_m < least:
            del self._retreats[pair]
            return False
        retreat.sample, retreat.farthest_m = sample, max(distance_m, retreat.farthest_m)
        return True

    def violations(self) -> tuple[Violation, ...]:
        """All that were found, by time."""
        told = [run for run in self._all if not run.touches]
        runs = sorted(told, key=lambda run: (run.begin_s, run.line))
        return tuple(
            Violation(
                line=run.line,
                time_s=run.begin_s,
                until_s=run.until_s,
                kind=run.kind,
                pair=run.pair,
                points=run.points,
                distance_m=max(run.value, 0.0) if run.pair else None,
                reason=_reason(run),
                refuses=run.stops,
            )
            for run in runs
        )


def _reason(run: _Run) -> Reason:
    match run.kind:
        case ViolationKind.COLLISION if FLOOR in run.pair:
            return codes.BELOW_FLOOR(one=run.pair[0], depth_mm=-run.value * 1000)
        case ViolationKind.COLLISION:
            return codes.TOUCHES(one=run.pair[0], other=run.pair[1])
        case ViolationKind.CLEARANCE:
            code = codes.NEARER_THAN_STOP if run.stops else codes.NEARER_THAN_WARNING
            one, other = run.pair
            return code(one=one, other=other, distance_mm=run.value * 1000, limit_mm=run.limit * 1000)
        case ViolationKind.SPEED:
            return codes.TOOL_TOO_FAST(speed=-run.value * 1000, limit=-run.limit * 1000)
    return codes.NEARLY_SINGULAR(value=run.value, limit=run.limit)
