"""Timers of a driver."""

from protocol_gateway.seam.effects import SetTimer


class Timers(dict[str, float]):
    """Times at which a driver's timers end, by their names [s]."""

    def set(self, timer: SetTimer) -> None:
        """Set or clear a timer."""
        if timer.at_s is None:
            self.pop(timer.name, None)
        else:
            self[timer.name] = timer.at_s

    @property
    def next_s(self) -> float | None:
        """When the first one ends; None: there are none."""
        return min(self.values(), default=None)

    def take(self, now_s: float) -> dict[str, float]:
        """Remove and return those that have ended, with their times."""
        return {name: self.pop(name) for name, at_s in [*self.items()] if at_s <= now_s}
