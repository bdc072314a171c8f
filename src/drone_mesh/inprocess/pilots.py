"""Pilots: they fly drones along tracks, and the mesh is not told."""

from __future__ import annotations

from typing import Iterable, Mapping

import numpy as np

from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError
from drone_mesh.inprocess.clock import Clock
from drone_mesh.inprocess.drone import InProcessDrone
from drone_mesh.inprocess.interfaces import IInProcessAir
from drone_mesh.mobility import Segment, Track

STEP_S = 0.1  # positions at 10 Hz, as a GPS receiver gives them


class Pilots:
    """Drones of a network that move as their tracks say, in steps of STEP_S.

    The mesh of a drone learns nothing but its position. A flight order ends the pilot's flight: the
    drone flies to its goal and stays there.
    """

    def __init__(
        self,
        clock: Clock,
        air: IInProcessAir,
        drones: Mapping[int, InProcessDrone],
        tracks: Mapping[int, Track],
    ) -> None:
        """From now on these drones are where their tracks say, which begin at time 0.

        Raises ConfigurationError for a track of a drone that there is not.
        """
        unknown = sorted(tracks.keys() - drones.keys())
        if unknown:
            raise ConfigurationError(f"drone {unknown[0]} has a track and is not in the network")
        self._clock, self._air = clock, air
        self._drones, self._tracks = drones, tracks
        for node in tracks:
            drones[node].under_pilot = True
        self._hold(sorted(tracks))
        self._step(None)

    @property
    def flying(self) -> list[int]:
        """The drones that still follow their tracks."""
        return [node for node in self._nodes if self._drones[node].under_pilot]

    def _hold(self, nodes: Iterable[int]) -> None:
        """Keep the current legs of these drones as arrays, one row each."""
        now_s = self._clock.now_s
        self._nodes = list(nodes)
        legs = [self._tracks[node].leg_at(now_s) for node in self._nodes]
        self._starts_s = np.array([leg.start_s for leg in legs])
        self._ends_s = np.array([leg.end_s for leg in legs])
        self._places = np.array([leg.start for leg in legs])
        self._velocities = np.array([leg.velocity for leg in legs])

    def _put(self, row: int, leg: Segment) -> None:
        self._starts_s[row], self._ends_s[row] = leg.start_s, leg.end_s
        self._places[row], self._velocities[row] = leg.start, leg.velocity

    def _step(self, _: object) -> None:
        now_s, drones = self._clock.now_s, self._drones
        if not all(drones[node].under_pilot for node in self._nodes):
            self._hold(self.flying)
        if not self._nodes:
            return
        for row in np.flatnonzero(self._ends_s <= now_s).tolist():
            self._put(row, self._tracks[self._nodes[row]].leg_at(now_s))
        places = self._places + self._velocities * (now_s - self._starts_s)[:, None]
        for node, (x, y, z) in zip(self._nodes, places.tolist()):
            drones[node].put(Location(y, x, z))
        self._air.moved(self._nodes)
        self._clock.call_at(now_s + STEP_S, self._step, None)
