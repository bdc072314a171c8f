"""TrackPilot: flies one drone along a track, pauses, and brings it back to the track."""

from __future__ import annotations

import bisect
import itertools
import math
from typing import NamedTuple, Sequence

from drone_mesh.drone.flight_path import Vector, between
from drone_mesh.mobility.track import Legs, Loop, Track, legs_between


class Stops(NamedTuple):
    """When the track of a mission is at its waypoints, in s."""

    at_s: Sequence[float]
    round_s: float  # until it is at the first one again; inf: never


class TrackPilot:
    """The flight of a drone that the mesh does not steer. Its caller moves the drone.

    The time of the track passes only while the drone is on it. To its start, and back to it after a
    pause in which an order moved the drone, it flies straight: first up or down to the height of
    the track, then level. All places are those of the drone's underside.
    """

    def __init__(self, track: Track, speed_m_s: float, stops: Stops | None = None) -> None:
        """`speed_m_s`: on the way to the track. `stops`: of a mission."""
        self._track, self._speed_m_s, self._stops = track, speed_m_s, stops
        self._track_s = 0.0
        self._last_s: float | None = None
        self._on_track = False
        # Any thread may read these two:
        self.paused = False  # the drone stays where it is
        self.has_arrived = False  # the track has ended, and the drone rests there

    def pause(self) -> None:
        """Stay, or leave the drone to an order."""
        self.paused = True
        self._last_s = None

    def resume(self) -> None:
        """Fly on, from wherever the drone is."""
        self.paused, self._on_track = False, False

    @property
    def heading(self) -> Vector | None:
        """Where it flies to in a straight line; None: it rests or is paused."""
        if self.paused:
            return None
        if not self._on_track:
            return self._track.position_at(self._track_s)
        leg = self._track.leg_at(self._track_s)
        return leg.end if any(leg.velocity) else None

    def mission_in_words(self, place: Vector) -> str:
        """How far the drone at this place has come; empty without a mission. Any thread."""
        if self._stops is None:
            return ""
        at_s, round_s = self._stops
        track_s, is_away = self._track_s, self.paused or not self._on_track
        passed = bisect.bisect_right(at_s, track_s % round_s) if track_s else 0
        number = passed % len(at_s) if math.isfinite(round_s) else min(passed, len(at_s) - 1)
        left = f"waypoint {number + 1} of {len(at_s)}, "
        if math.isfinite(round_s):
            left += "in a loop"
        else:
            corners = [place, *self.way_back(place)] if is_away else [place]
            back_m = sum(map(math.dist, corners, corners[1:]))
            left += f"{max(0.0, at_s[-1] - track_s + back_m / self._speed_m_s):.0f} s left"
        return f"mission, {left}{'; paused' if self.paused else ''}"

    def move(self, place: Vector, now_s: float) -> Vector:
        """The next place of the drone, which was at `place` when this was called last."""
        passed_s = 0.0 if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        if not self._on_track:
            return self._approach(place, self._speed_m_s * passed_s)
        self._track_s += passed_s
        leg = self._track.leg_at(self._track_s)
        self.has_arrived = leg.end_s == math.inf and not any(leg.velocity)
        return leg.position_at(self._track_s)

    def wait(self, now_s: float) -> None:
        """The drone falls behind: let no time of the track pass."""
        self._last_s = now_s

    def way_back(self, place: Vector) -> list[Vector]:
        """The corners of the way from this place to the track."""
        track = self._track.position_at(self._track_s)
        return [(place[0], place[1], track[2]), track]

    def _approach(self, place: Vector, budget_m: float) -> Vector:
        for corner in self.way_back(place):
            way_m = math.dist(place, corner)
            if way_m > budget_m:
                return between(place, corner, budget_m / way_m)
            place, budget_m = corner, budget_m - way_m
        self._on_track = True
        return place


def along(waypoints: Sequence[Vector], speed_m_s: float, loop: bool) -> Track:
    """The track over these waypoints, once or in a loop."""
    if loop and len(set(waypoints)) > 1:
        return Loop(waypoints, speed_m_s)
    return Legs(legs_between(zip(stops_along(waypoints, speed_m_s, False).at_s, waypoints)))


def stops_along(waypoints: Sequence[Vector], speed_m_s: float, loop: bool) -> Stops:
    """When the track `along` these waypoints is at each of them."""
    ring = [*waypoints, *waypoints[:1]]
    steps_s = [math.dist(a, b) / speed_m_s for a, b in zip(ring, ring[1:])]
    *at_s, round_s = itertools.accumulate(steps_s, initial=0.0)
    return Stops(at_s, round_s if loop and round_s else math.inf)
