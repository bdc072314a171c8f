"""The strategy `fiedler`: each drone flies where the mesh that it knows is connected best."""

from __future__ import annotations

import math
from typing import Callable, Mapping

from drone_mesh.communication.repair.algebraic_connectivity import fiedler, gradient, widest_gap_m
from drone_mesh.communication.repair.legs import LEG, BoundedLegs
from drone_mesh.drone.location import Location

BOUND = 0.1  # of the second eigenvalue: a line of three at two thirds of the range has 0.13
HALVINGS = 2  # of a leg that leads too far
ME = 0  # in the list of places
MOST_PLACES = 60  # the nearest: the time grows with the third power, and neighbours may lie


class Fiedler(BoundedLegs):
    """Along the gradient of the second eigenvalue of the Laplacian, until that is above a bound.

    After Yang, Freeman, Gordon, Lynch, Srinivasa, Sukthankar, "Decentralized Estimation and
    Control of Graph Connectivity for Mobile Sensor Networks", Automatica 46(2), 2010, and
    Sabattini, Chopra, Secchi, "Decentralized Connectivity Maintenance for Cooperative Control of
    Mobile Robotic Systems", IJRR 32(12), 2013. They keep a whole mesh whole, and estimate the
    eigenvector by exchanges among all. Here a drone without a gateway computes that of its news:
    itself, those within two ranges whose places it knows and that it reaches, and the gateway where
    it was. A radio then counts as reaching over the widest gap among these: beyond its range the
    published weight is 0, and a lost link would not pull.
    """

    def __init__(self, everybody: Callable[[], Mapping[int, Location]] | None = None) -> None:
        """`everybody` returns the places of all nodes: ideal information, in process only."""
        self._everybody = everybody

    def _next(self, here: Location, gateway: Location) -> Location | None:
        mesh = self.mesh
        places = [here, *self._others(here, gateway)]
        gap_m = widest_gap_m(places) if len(places) > 1 else 0.0
        if not gap_m:
            self.reason = "knows no place but its own"
            return None
        reach_m = max(mesh.range_m, gap_m)
        value, vector = fiedler(places, reach_m)
        leg_m = LEG * mesh.range_m
        if gap_m < mesh.range_m:
            leg_m *= max(0.0, 1.0 - value / BOUND)
        uphill = gradient(ME, places, reach_m, vector)
        length = math.sqrt(sum(part * part for part in uphill))
        for halving in range(HALVINGS + 1):
            step_m = leg_m / 2**halving
            if step_m < mesh.clearance_m or not length:
                break
            goal = Location(*(at + part * step_m / length for at, part in zip(here, uphill)))
            if fiedler([goal, *places[1:]], reach_m)[0] > value:
                return goal
        self.reason = "no leg connects the mesh that it knows better"
        return None

    def _others(self, here: Location, gateway: Location) -> list[Location]:
        mesh = self.mesh
        if self._everybody is not None:
            return [place for node, place in self._everybody().items() if node != mesh.node_id]
        near = self._near(here, {**mesh.reachable(), **mesh.neighbours()}.values())
        if len(near) > MOST_PLACES:
            near = sorted(near, key=here.distance_m)[:MOST_PLACES]
        return [gateway, *near]
