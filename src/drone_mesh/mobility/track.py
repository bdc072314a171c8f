"""Track: where a drone is at each time, in straight legs."""

from __future__ import annotations

import abc
import bisect
import itertools
import math
from typing import Iterable, Iterator, NamedTuple, Sequence

from drone_mesh.drone.flight_path import CLIMB_ENDS_AT, DESCENT_STARTS_AT, Vector

MOST_LEGS_KEPT = 512  # of the past; a longer look back raises ValueError


class Segment(NamedTuple):
    """Constant velocity for a while, or rest. Times in s, places in m, world frame."""

    start_s: float
    end_s: float  # inf: for ever
    start: Vector
    velocity: Vector  # m/s

    def position_at(self, t_s: float) -> Vector:
        """The place at this time, which should be within the leg."""
        passed_s = t_s - self.start_s
        (x, y, z), (u, v, w) = self.start, self.velocity
        return x + u * passed_s, y + v * passed_s, z + w * passed_s

    @property
    def end(self) -> Vector:
        """The place at its end; its start if it lasts for ever."""
        return self.start if self.end_s == math.inf else self.position_at(self.end_s)


def leg_to(start_s: float, end_s: float, start: Vector, end: Vector) -> Segment:
    """The leg between these times and places."""
    share = 1.0 / (end_s - start_s)
    u, v, w = ((b - a) * share for a, b in zip(start, end))
    return Segment(start_s, end_s, start, (u, v, w))


def rest(start_s: float, place: Vector, end_s: float = math.inf) -> Segment:
    """A leg without motion."""
    return Segment(start_s, end_s, place, (0.0, 0.0, 0.0))


def legs_between(knots: Iterable[tuple[float, Vector]]) -> Iterator[Segment]:
    """The legs between these times and places, in order of time."""
    last: tuple[float, Vector] | None = None
    for at_s, place in knots:
        if last is not None and at_s > last[0]:
            yield leg_to(last[0], at_s, last[1], place)
        last = (at_s, place)
    if last is not None:
        yield rest(*last)


class Track(abc.ABC):
    """The motion of one drone as a function of time (s, from 0 on)."""

    @abc.abstractmethod
    def leg_at(self, t_s: float) -> Segment:
        """The leg that holds at this time: `start_s <= t_s < end_s`."""

    def position_at(self, t_s: float) -> Vector:
        """x, y, z in metres."""
        return self.leg_at(t_s).position_at(t_s)

    def velocity_at(self, t_s: float) -> Vector:
        """Metres per second along x, y, z."""
        return self.leg_at(t_s).velocity


class Legs(Track):
    """The legs that a model draws, one after the other, as far as time has come."""

    def __init__(self, legs: Iterable[Segment]) -> None:
        """`legs` adjoin in time; the first begins at 0 or before. After the last the drone rests.

        Raises ValueError if there is none, or if the first begins after 0.
        """
        self._coming = iter(legs)
        first = next(self._coming, None)
        if first is None or first.start_s > 0.0:
            raise ValueError("a track begins at time 0 or before")
        self._legs = [first]
        self._starts = [first.start_s]

    def leg_at(self, t_s: float) -> Segment:
        latest = self._legs[-1]
        if latest.start_s <= t_s < latest.end_s:
            return latest
        while t_s >= self._legs[-1].end_s:
            self._add(next(self._coming, rest(self._legs[-1].end_s, self._legs[-1].end)))
        index = bisect.bisect_right(self._starts, t_s) - 1
        if index < 0:
            raise ValueError(f"the track no longer knows {t_s:g} s")
        return self._legs[index]

    def _add(self, leg: Segment) -> None:
        self._legs.append(leg)
        self._starts.append(leg.start_s)
        if len(self._legs) > 2 * MOST_LEGS_KEPT:
            del self._legs[:-MOST_LEGS_KEPT], self._starts[:-MOST_LEGS_KEPT]


class Loop(Track):
    """A closed line of corners, round and round at one speed."""

    def __init__(self, corners: Sequence[Vector], speed_m_s: float, ahead_m: float = 0.0) -> None:
        """At time 0 the drone is `ahead_m` metres along the line. Raises ValueError without one."""
        ring = [*corners, *corners[:1]]
        steps = [(a, b) for a, b in zip(ring, ring[1:]) if a != b]
        if not steps:
            raise ValueError("a loop needs two corners at different places")
        self._steps = steps
        self._ends_m = list(itertools.accumulate(math.dist(a, b) for a, b in steps))
        self._speed_m_s = speed_m_s
        self._ahead_m = ahead_m

    @property
    def length_m(self) -> float:
        """Once round."""
        return self._ends_m[-1]

    def leg_at(self, t_s: float) -> Segment:
        rounds, here_m = divmod(self._ahead_m + t_s * self._speed_m_s, self.length_m)
        index = min(bisect.bisect_right(self._ends_m, here_m), len(self._steps) - 1)
        base_m = rounds * self.length_m - self._ahead_m
        start_m = base_m + (self._ends_m[index - 1] if index else 0.0)
        end_s = (base_m + self._ends_m[index]) / self._speed_m_s
        return leg_to(start_m / self._speed_m_s, end_s, *self._steps[index])


class Together(Track):
    """The sum of two motions, for example of a group and of a drone within it."""

    def __init__(self, one: Track, other: Track) -> None:
        self._one, self._other = one, other

    def leg_at(self, t_s: float) -> Segment:
        one, other = self._one.leg_at(t_s), self._other.leg_at(t_s)
        start_s = max(one.start_s, other.start_s)
        x, y, z = (a + b for a, b in zip(one.position_at(start_s), other.position_at(start_s)))
        u, v, w = (a + b for a, b in zip(one.velocity, other.velocity))
        return Segment(start_s, min(one.end_s, other.end_s), (x, y, z), (u, v, w))


def climbing(leg: Segment, ceiling_m: float) -> Iterator[Segment]:
    """The same leg by the document's profile: half its length up, across, down again.

    Under a ceiling it climbs less, in the same time, or not at all.
    """
    up_m = min(math.dist(leg.start, leg.end) / 2, max(0.0, ceiling_m - leg.start[2]))
    if not up_m:
        yield leg
        return
    (x, y, z), (u, v, w) = leg.start, leg.end
    above_start, above_end = (x, y, z + up_m), (u, v, w + up_m)
    climbed_s, descends_s = (
        leg.start_s + (leg.end_s - leg.start_s) * share
        for share in (CLIMB_ENDS_AT, DESCENT_STARTS_AT)
    )
    yield leg_to(leg.start_s, climbed_s, leg.start, above_start)
    yield leg_to(climbed_s, descends_s, above_start, above_end)
    yield leg_to(descends_s, leg.end_s, above_end, leg.end)
