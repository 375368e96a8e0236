"""Time stamps of a controller's units, by the controller's clock where it sends one.

TCP may delay units: a cable, a sleeping process or a busy machine holds them back, and one read returns
several. Where a unit carries the controller's TIME, the fastest unit so far gives the offset of the clocks:

    stamp = TIME + the least (receipt - TIME) so far

So stamps are spaced like TIME, and a delayed unit keeps its real age. No stamp is after its receipt. Of
several units of one read without TIME, the newest is stamped with its receipt and the others before it, at
the measured rate.

A controller's clock may drift, or be set. The offset follows a drift slowly. If it cannot be followed (TIME
goes back, a unit is early by more than 1 ms, all units stay late), a new clock number begins
(`EventTime.clock`), and with it a new publisher identity. Stamps do not go back from one number to the next.
Within one number they strictly increase and are spaced like TIME; only the units of its first read may be
closer. Units that stay late for a second are taken as on time, so that no clock can make live data look old
for longer.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from protocol_gateway.seam import (
    ControllerEvent,
    JointsReceived,
    SignalsReceived,
    StatusReceived,
    UnknownReceived,
)

_MS = 1_000_000
_S = 1_000_000_000
# 300 years: no valid TIME is larger, and much more does not fit into nanoseconds.
_LONGEST_TIME_S = 1e10
# After a gap longer than this between reads, the next units may be delayed ones.
_GAP_S = 0.25
# Longest time to treat a stream after a gap as a burst: it may be a live stream without pauses.
_LONGEST_HOLD_S = 0.25
# Units later than _LATE_NS for _BURST_NS: the controller's clock was set, or is slow. A burst is shorter,
# because it arrives at the speed of the network.
_LATE_NS, _BURST_NS = 100 * _MS, _S
# A unit may be early by this much while stamps stay spaced like TIME: absolute, and share of the interval.
_SOONER_NS, _SOONER_SHARE = 900_000, 0.09
# The offset follows a slower clock by this share of the time, once the fastest unit of a window is 1 ms late.
_FOLLOWED_SHARE, _WINDOW_NS, _BEHIND_NS = 0.05, 2 * _S, _MS
# Spacing of stamps of units with the same TIME, in total within a millisecond.
_TWICE_NS = 100_000
# Spacing of units of one read before a rate is known.
_UNKNOWN_PERIOD_NS = 1000


@dataclass(frozen=True, slots=True)
class EventTime:
    """Time stamp of an event.

    Attributes:
        monotonic_s: Time on the gateway's monotonic clock, for ages.
        wall_ns: Time on the gateway's wall clock, ns since the Unix epoch, for publications.
        clock: Number of the clock. Times of different numbers cannot be compared.
    """

    monotonic_s: float
    wall_ns: int
    clock: int = 0


class Timestamper:
    """Source of time stamps for one link's events."""

    def __init__(self) -> None:
        self._clock = 0
        self._arrived_s = float("inf")
        self._gap_end_s = float("-inf")
        self._line = _Line()
        self._rate = _Rate()
        # The newest stamp of this clock number, and of all numbers before.
        self._newest_ns: int | None = None
        self._newest_before_ns: int | None = None
        # A moment without a new TIME has followed the newest TIME.
        self._behind = True

    def after_gap(self, now_s: float) -> bool:
        """Return whether units may be delayed ones after a gap, with newer ones still to come."""
        return now_s - self._gap_end_s < _LONGEST_HOLD_S

    def connected(self) -> None:
        """Discard the controller's clock, because a new connection may reach another controller."""
        self._arrived_s, self._gap_end_s = float("inf"), float("-inf")
        self._rate = _Rate()
        if self._line.time_ns is not None:
            self._begin_clock()

    def wall_clock_was_set(self) -> None:
        """Begin a new clock number, because the gateway's wall clock was set."""
        self._clock += 1

    def timestamps(self, events: Sequence[ControllerEvent], now: EventTime) -> list[EventTime]:
        """Return the time stamp of each event of a read: now, or earlier.

        Args:
            events: Events in the order of receipt.
            now: Time at which their bytes were read.
        """
        if not events:
            return []
        if now.monotonic_s - self._arrived_s > _GAP_S:
            self._gap_end_s = now.monotonic_s
        self._arrived_s = now.monotonic_s
        now_ns = round(now.monotonic_s * 1e9)
        if len(events) == 1 and self._is_of_now(events[0], now, now_ns):
            return [now]
        times_ns, moment_of = _moments(events)
        stamps = self._stamps(times_ns, now_ns)
        dates = [
            now
            if stamp_ns == now_ns and clock == now.clock
            else EventTime(stamp_ns * 1e-9, now.wall_ns - (now_ns - stamp_ns), clock)
            for stamp_ns, clock in stamps
        ]
        return [dates[moment] for moment in moment_of]

    def _is_of_now(self, event: ControllerEvent, now: EventTime, now_ns: int) -> bool:
        """Note the only event of a read, and return whether its stamp is simply its receipt.

        This is a shortcut for controllers without TIME: the general way gives the same stamp.
        """
        timed = self._line.time_ns is not None or getattr(event, "controller_time_s", None) is not None
        newest_ns = self._newest_of_all_ns
        ordered = newest_ns is None or newest_ns < now_ns
        if timed or not ordered or not self._behind or self._clock != now.clock:
            return False
        self._rate.period_ns(1, now_ns)
        self._newest_ns = now_ns
        return True

    @property
    def _newest_of_all_ns(self) -> int | None:
        return self._newest_before_ns if self._newest_ns is None else self._newest_ns

    def _begin_clock(self) -> None:
        self._clock += 1
        self._line = _Line()
        self._newest_before_ns, self._newest_ns = self._newest_of_all_ns, None

    def _stamps(self, times_ns: Sequence[int | None], now_ns: int) -> list[tuple[int, int]]:
        """Return stamps on the monotonic clock [ns] and clock numbers of the moments of one read."""
        stamps: list[tuple[int, int]] = []
        begin = 0
        while begin < len(times_ns):
            end = _end_of_run(times_ns, begin, self._line.time_ns)
            if end == begin:  # TIME goes back
                self._begin_clock()
                continue
            run = self._run(times_ns[begin:end], now_ns)
            stamps += [(stamp_ns, self._clock) for stamp_ns in run]
            begin = end
        return stamps

    def _run(self, times_ns: Sequence[int | None], now_ns: int) -> list[int]:
        """Return stamps of moments with a TIME that does not go back."""
        before_ns = self._line.time_ns
        new_ns = [each for each in times_ns if each is not None and (before_ns is None or each > before_ns)]
        if new_ns and not self._line.take(new_ns[0], new_ns[-1], now_ns):
            self._begin_clock()
            self._line.take(new_ns[0], new_ns[-1], now_ns)
        period_ns = self._rate.period_ns(len(times_ns), now_ns) or self._period_since(len(times_ns), now_ns)
        twice_ns = min(_TWICE_NS, _SOONER_NS // len(times_ns))
        stamps: list[int] = []
        later_ns: int | None = None
        for wanted_ns in reversed([*self._wanted(times_ns, before_ns, twice_ns)]):
            latest_ns = now_ns if later_ns is None else later_ns - twice_ns
            if wanted_ns is None:
                later_ns = now_ns if later_ns is None else later_ns - max(period_ns, 1)
            else:
                later_ns = min(wanted_ns, latest_ns)
            stamps.append(later_ns)
        stamps.reverse()
        return self._in_order(stamps, now_ns)

    def _wanted(
        self, times_ns: Sequence[int | None], before_ns: int | None, twice_ns: int
    ) -> Iterator[int | None]:
        """Yield the stamp of each moment by its controller's clock; None: without TIME.

        A moment without a new TIME, after one with a new TIME, gets nearly the same stamp.
        """
        stamp_ns, old_ns = self._newest_ns, before_ns
        for time_ns in times_ns:
            if time_ns is not None and (before_ns is None or time_ns > before_ns):
                stamp_ns, before_ns, self._behind = self._line.stamp_ns(time_ns), time_ns, False
                yield stamp_ns
            elif stamp_ns is None or (self._behind and time_ns in (None, old_ns)):
                yield None
            else:
                stamp_ns, self._behind = stamp_ns + twice_ns, self._behind or time_ns in (None, old_ns)
                yield stamp_ns

    def _period_since(self, moments: int, now_ns: int) -> int:
        """Return the period of moments since the newest stamp [ns], before a rate is measured."""
        if self._newest_ns is None or now_ns - self._newest_ns > _S:
            return _UNKNOWN_PERIOD_NS
        return (now_ns - self._newest_ns) // moments

    def _in_order(self, stamps: list[int], now_ns: int) -> list[int]:
        """Return stamps that strictly increase, after the newest one and not after their receipt.

        The newest one may be of the clock number before: if a delayed unit began that number, the units that
        show the delay, and begin the next number, are often dated before it.
        """
        before_ns = self._newest_ns
        if before_ns is None and self._newest_before_ns is not None:
            # Both numbers may begin in this read; then there is no more room before the receipt.
            before_ns = min(self._newest_before_ns, now_ns - len(stamps))
        if self._newest_ns is None and before_ns is not None and stamps[0] <= before_ns < stamps[-1] - 1:
            room_ns, wanted_ns = stamps[-1] - before_ns - 1, stamps[-1] - stamps[0]
            stamps = [stamps[-1] - (stamps[-1] - each) * room_ns // wanted_ns for each in stamps]
        whole = stamps if before_ns is None else [before_ns, *stamps]
        if any(later <= earlier for earlier, later in pairwise(whole)) or stamps[-1] > now_ns:
            first_ns = stamps[0] - 1 if before_ns is None else before_ns
            room_ns = max(now_ns - first_ns, len(stamps))
            stamps = [first_ns + room_ns * (number + 1) // len(stamps) for number in range(len(stamps))]
        self._newest_ns = stamps[-1]
        return stamps


class _Line:
    """Linear relation between a controller's clock and the gateway's monotonic clock.

    Attributes:
        time_ns: The newest TIME; None: none yet.
    """

    def __init__(self) -> None:
        self.time_ns: int | None = None
        # The line passes through this TIME at this monotonic time.
        self._time_ns = self._at_ns = 0
        self._late_since_ns: int | None = None
        # Least delay of the reads in this window and in the one before.
        self._least_ns = self._least_before_ns = 0
        self._window_ends_ns = 0
        self._behind_ns = 0

    def stamp_ns(self, time_ns: int) -> int:
        """Return the monotonic time of a TIME."""
        return self._at_ns + time_ns - self._time_ns

    def take(self, first_ns: int, newest_ns: int, now_ns: int) -> bool:
        """Take the TIMEs of the first new unit and the newest of a read; return whether they fit."""
        if self.time_ns is None:
            self._begin(newest_ns, now_ns)
            return True
        since_ns = first_ns - self.time_ns
        late_ns = now_ns - self.stamp_ns(newest_ns)
        if late_ns < 0:
            if -late_ns > max(_SOONER_NS, round(_SOONER_SHARE * since_ns)):
                return False
            self._begin(newest_ns, now_ns)
            return True
        if late_ns <= _LATE_NS:
            self._late_since_ns = None
        elif self._late_since_ns is None:
            self._late_since_ns = now_ns
        elif now_ns - self._late_since_ns > _BURST_NS:
            return False
        self.time_ns = newest_ns
        self._follow(late_ns, since_ns, now_ns)
        return True

    def _begin(self, time_ns: int, now_ns: int) -> None:
        self.time_ns = self._time_ns = time_ns
        self._at_ns = now_ns
        self._late_since_ns = None
        self._least_ns = self._least_before_ns = self._behind_ns = 0
        self._window_ends_ns = now_ns + _WINDOW_NS

    def _follow(self, late_ns: int, since_ns: int, now_ns: int) -> None:
        """Move the line towards the fastest unit of the last windows, slowly, to keep TIME's spacing."""
        self._least_ns = min(self._least_ns, late_ns)
        if now_ns >= self._window_ends_ns:
            least_ns = min(self._least_ns, self._least_before_ns)
            self._behind_ns = max(least_ns - _BEHIND_NS, 0)
            self._least_before_ns, self._least_ns = self._least_ns, late_ns
            self._window_ends_ns = now_ns + _WINDOW_NS
        step_ns = min(self._behind_ns, round(_FOLLOWED_SHARE * since_ns), late_ns)
        self._behind_ns -= step_ns
        self._at_ns += step_ns
        self._least_ns -= step_ns
        self._least_before_ns -= step_ns


class _Rate:
    """Measurement of a controller's send rate, over about a second."""

    def __init__(self) -> None:
        self._begin_ns: int | None = None
        self._moments = 0
        self._period_ns = 0

    def period_ns(self, moments: int, now_ns: int) -> int:
        """Add the moments of one read; return the period [ns], 0: unknown."""
        if self._begin_ns is None or now_ns - self._begin_ns > 2 * _S:
            self._begin_ns, self._moments, self._period_ns = now_ns, 0, 0
            return 0
        self._moments += moments
        elapsed_ns = now_ns - self._begin_ns
        if elapsed_ns >= _S:
            self._period_ns = elapsed_ns // self._moments
            self._begin_ns, self._moments = now_ns, 0
        return self._period_ns


def _moments(events: Sequence[ControllerEvent]) -> tuple[list[int | None], list[int]]:
    """Return the TIMEs of a read's moments [ns], None without, and each event's moment number.

    A moment is a group of consecutive events. It ends where TIME changes, or where a type of event that is
    published with its stamp repeats.
    """
    times_ns: list[int | None] = []
    moment_of: list[int] = []
    said: set[type] = set()
    for event in events:
        time_ns: int | None = None
        published = False
        match event:
            case JointsReceived() | UnknownReceived():
                time_ns, published = _ns(event.controller_time_s), True
            case StatusReceived() | SignalsReceived():
                time_ns = _ns(event.controller_time_s)
            case _:
                pass
        known = times_ns[-1] if times_ns else None
        another = time_ns is not None and known is not None and time_ns != known
        if not times_ns or another or (published and type(event) in said):
            times_ns.append(time_ns)
            said = set()
        elif known is None:
            times_ns[-1] = time_ns
        if published:
            said.add(type(event))
        moment_of.append(len(times_ns) - 1)
    return times_ns, moment_of


def _ns(seconds: float | None) -> int | None:
    return None if seconds is None or abs(seconds) > _LONGEST_TIME_S else round(seconds * 1e9)


def _end_of_run(times_ns: Sequence[int | None], begin: int, before_ns: int | None) -> int:
    """Return the end of the moments before TIME goes back; `begin` itself if it does so first."""
    for number in range(begin, len(times_ns)):
        time_ns = times_ns[number]
        if time_ns is None:
            continue
        if before_ns is not None and time_ns < before_ns:
            return number
        before_ns = time_ns
    return len(times_ns)
