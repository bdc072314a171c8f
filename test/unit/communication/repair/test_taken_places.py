"""Which places a repair may end at."""

from __future__ import annotations

from drone_mesh.communication.control.places import KnownPlaces
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.repair.options import RepairOptions
from drone_mesh.communication.repair.spots import TakenPlaces
from drone_mesh.communication.timing import UNDISTURBED, Deadlines
from drone_mesh.drone.location import Location


def test_a_spot_that_is_clear_of_a_rounded_place_is_clear_of_the_drone_itself():
    deadlines, places = Deadlines(), KnownPlaces()
    neighbours = Neighbours(UNDISTURBED, 10.0, 9.0)
    drone = Location(latitude=0.951, longitude=0.0, height=0.0)
    told = Location(latitude=round(drone.latitude, 1), longitude=0.0, height=0.0)  # in a beacon
    neighbours.set_place(7, told, 0.0)
    options = RepairOptions(clearance_m=1.0)
    taken = TakenPlaces(1, deadlines, neighbours, places, options)
    spot = Location(latitude=-0.05, longitude=0.0, height=0.0)
    assert spot.distance_m(told) > 1.0 > 0.96
    assert not taken.is_free(spot)
    assert taken.is_free(Location(latitude=-0.1, longitude=0.0, height=0.0))
