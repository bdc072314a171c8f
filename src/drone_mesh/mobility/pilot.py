"""TrackPilot: flies one drone along a track, pauses, and brings it back to the track."""

from __future__ import annotations

import math
from typing import Sequence

from drone_mesh.drone.flight_path import Vector, between
from drone_mesh.mobility.track import Legs, Loop, Track, legs_between


class TrackPilot:
    """The flight of a drone that the mesh does not steer. Its caller moves the drone.

    The time of the track passes only while the drone is on it. To its start, and back to it after a
    pause in which an order moved the drone, it flies straight: first up or down to the height of
    the track, then level. All places are those of the drone's underside.
    """

    def __init__(self, track: Track, speed_m_s: float) -> None:
        """`speed_m_s`: on the way to the track."""
        self._track, self._speed_m_s = track, speed_m_s
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
    knots, at_s, before = [], 0.0, waypoints[0]
    for waypoint in waypoints:
        at_s += math.dist(before, waypoint) / speed_m_s
        knots.append((at_s, waypoint))
        before = waypoint
    return Legs(legs_between(knots))
