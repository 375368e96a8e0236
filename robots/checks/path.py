"""Downsampled samples of a motion: a bounded number for a motion of any length."""

import numpy as np

from robots.kinematics.joints import FloatArray
from robots.programs.steps import SampledPath

MOST_SAMPLES = 20_000


class PathSamples:
    """Collector of samples in order; keeps all, then every second, every fourth, and so on.

    Args:
        joints: Number of joints.
    """

    def __init__(self, joints: int) -> None:
        self._joints = joints
        self._rows: list[FloatArray] = []
        self._kept = 0
        self._count = 0
        self._stride = 1
        self._last: FloatArray | None = None

    def add(
        self,
        times_s: FloatArray,
        positions: FloatArray,
        tools: FloatArray,
        speeds: FloatArray,
        clearances: FloatArray,
        line: int,
    ) -> None:
        """Add samples: (m,), (m, n), (m, 3), (m,), (m,), and their program line."""
        lines = np.full(len(times_s), float(line))
        rows = np.column_stack([times_s, positions, tools, speeds, clearances, lines])
        # Copy, because a view would keep all rows in memory.
        kept = rows[-self._count % self._stride :: self._stride].copy()
        self._count += len(rows)
        if len(kept):
            self._kept += len(kept)
            self._rows.append(kept)
        self._last = rows[-1].copy()
        while self._kept >= MOST_SAMPLES:
            whole = np.concatenate(self._rows)[::2]
            self._rows, self._kept, self._stride = [whole], len(whole), self._stride * 2

    def sampled(self) -> SampledPath:
        """Return the kept samples, always including the last."""
        n = self._joints
        rows = np.concatenate([np.zeros((0, n + 7)), *self._rows])
        if self._last is not None and (not len(rows) or (rows[-1] != self._last).any()):
            rows = np.vstack([rows, self._last])
        return SampledPath(
            times_s=rows[:, 0],
            joint_positions=rows[:, 1 : n + 1],
            tool_positions=rows[:, n + 1 : n + 4],
            tool_speeds=rows[:, n + 4],
            clearances=rows[:, n + 5],
            lines=rows[:, n + 6].astype(np.int64),
        )
