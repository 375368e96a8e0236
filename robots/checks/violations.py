"""Collector of violations: merges problems at adjacent samples to violations with a duration."""

from dataclasses import dataclass, field

import numpy as np

from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.descriptions.cells import FLOOR
from robots.kinematics.joints import FloatArray
from robots.programs.steps import Violation, ViolationKind

# Reported violations; the rest is counted.
MOST_VIOLATIONS = 1_000
# Tolerance of a retreat's approach between samples: the error of distances.
_ROUNDED_M = 1e-5
# Tolerance of a retreat's approach since its start. It is small, because the next motion could continue it.
_SAME_M = 1e-9
_NO_POINTS: FloatArray = np.zeros((0, 3))


@dataclass
class _Run:
    """A violation that may continue."""

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
    # Of a clearance: the pair also collides before, during or after it, so only the collision is reported.
    touches: bool = False


@dataclass
class _Retreat:
    """A pair that has not come nearer since the start: its last sample, first and largest distance."""

    sample: int
    start_m: float
    farthest_m: float


@dataclass
class ViolationCollector:
    """Violations of a motion, collected sample by sample.

    Attributes:
        unreported: Number of violations beyond MOST_VIOLATIONS.
    """

    unreported: int = 0
    _open: dict[tuple[int, ViolationKind, tuple[str, ...]], _Run] = field(default_factory=dict)
    _all: list[_Run] = field(default_factory=list)
    # Pairs that were too near at the start and have not come nearer since.
    _retreats: dict[tuple[str, ...], _Retreat] = field(default_factory=dict)

    def add(
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
        """Add a problem at a sample; samples are in order and count from 0 through the whole motion.

        Args:
            value: The measured value, the smaller the worse: a distance [m], a margin, a negated speed.
            limit: The limit of the value.
            within: Largest gap in samples within one violation.
        """
        # A retreat from below the floor is allowed, because its depth is known; that of a collision is not.
        measured = kind is ViolationKind.CLEARANCE or FLOOR in pair
        if pair and self._retreating(pair, sample, value) and measured:
            return
        key = (line, kind, pair)
        other = ViolationKind.COLLISION if kind is ViolationKind.CLEARANCE else ViolationKind.CLEARANCE
        related = self._open.get((line, other, pair)) if pair else None
        if related is not None and sample - related.sample > within:
            related = None
        if related is not None and kind is ViolationKind.COLLISION:
            # A pair that comes near, touches and separates is near all the time.
            related.sample, related.until_s, related.touches = sample, time_s, True
        run = self._open.get(key)
        if run is None or sample - run.sample > within:
            run = _Run(line, kind, pair, time_s, time_s, sample, value, points, limit, stops)
            run.touches = related is not None and kind is ViolationKind.CLEARANCE
            self._open[key] = run
            if len(self._all) < MOST_VIOLATIONS:
                self._all.append(run)
            else:
                self.unreported += 1
        if value < run.value:
            run.value, run.limit, run.points = value, limit, points
        run.stops = run.stops or stops
        run.until_s, run.sample = time_s, sample

    def _retreating(self, pair: tuple[str, ...], sample: int, distance_m: float) -> bool:
        """Return whether a pair was too near at the start and has not come nearer."""
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
        """Return all reported violations, by time."""
        reported = [run for run in self._all if not run.touches]
        runs = sorted(reported, key=lambda run: (run.begin_s, run.line))
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
