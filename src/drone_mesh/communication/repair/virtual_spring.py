"""The strategy `virtual_spring`: neighbours push and pull each other, and the gateway pulls all."""

from __future__ import annotations

import math
from typing import Iterable

from drone_mesh.communication.repair.legs import LEG, BoundedLegs
from drone_mesh.drone.location import Location

REST = 2.0 / 3.0  # of the range: a spring without force is as long as our fleets stand apart


def force_m(
    here: Location, others: Iterable[Location], centre: Location, rest_m: float
) -> tuple[float, float, float]:
    """The force on a drone, as the stretch of a spring in metres: north, east and up.

    One spring to each of the `others`, which pushes if it is shorter than `rest_m` and pulls if it
    is longer, and one without a length to `centre`. The mean of the former counts and not their
    sum: as all drones move at once, the sum of more than a few would throw them to and fro.
    """
    pulls = []
    for other in others:
        apart_m = here.distance_m(other)
        share = 1.0 - rest_m / apart_m if apart_m else 0.0  # at one place: no direction
        pulls.append([(b - a) * share for a, b in zip(here, other)])
    means = [sum(axis) / len(pulls) for axis in zip(*pulls)] if pulls else [0.0] * 3
    north, east, up = (mean + b - a for mean, a, b in zip(means, here, centre))
    return north, east, up


class VirtualSpring(BoundedLegs):
    """Neighbours push each other under two thirds of the range, and pull each other over it.

    After Liu, Chu, Leung, Du, "Simple Movement Control Algorithm for Bi-Connectivity in Robotic
    Sensor Networks", IEEE JSAC 28(7), 2010, as the topology control of UavNetSim has it: a pull to
    the centre, which is the gateway's place here, a push between near neighbours, and a step of
    2/pi atan(force) of the longest one. The pull between far neighbours is that of spring meshes.
    In UavNetSim the force fills the longest step almost everywhere, and nothing comes to rest; here
    a small force is a small step.
    Published as a controller of all drones at all times; here only those without a gateway move.
    """

    def _next(self, here: Location, gateway: Location) -> Location | None:
        mesh = self.mesh
        rest_m = REST * mesh.range_m
        places = self._near(here, mesh.neighbours().values())
        force = force_m(here, places, gateway, rest_m)
        stretch_m = math.sqrt(sum(part * part for part in force))
        step_m = LEG * mesh.range_m * 2.0 / math.pi * math.atan(stretch_m / rest_m)
        if step_m < mesh.clearance_m:
            self.reason = "its pushes and pulls balance"
            return None
        return Location(*(at + part * step_m / stretch_m for at, part in zip(here, force)))
