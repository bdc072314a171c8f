"""Which places a repair may end at."""

from __future__ import annotations

import pytest

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.communication.control.places import KnownPlaces
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.repair.options import RepairOptions
from drone_mesh.communication.repair.spots import (
    Landing,
    TakenPlaces,
    own_spot,
    spot_beside_rivals,
)
from drone_mesh.communication.timing import UNDISTURBED, Deadlines
from drone_mesh.drone.fence import Fence, Zone
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


def test_a_spot_beside_one_drone_is_clear_of_the_rounded_place_of_another():
    neighbours = Neighbours(UNDISTURBED, 10.0, 9.0)
    gone, told = Location(0.0, 0.0, 0.0), Location(latitude=0.0, longitude=2.1, height=0.0)
    neighbours.set_place(7, gone, 0.0)
    neighbours.set_place(8, told, 0.0)  # of a drone at 2.05
    options, landing = RepairOptions(clearance_m=1.0), Landing(Location(0.0, 5.0, 0.0))
    taken = TakenPlaces(1, Deadlines(), neighbours, KnownPlaces(), options)
    others, east = [gone, told], Location(0.0, 3.0, 0.0)
    for spot in (
        taken.at_or_beside(gone, landing),
        spot_beside_rivals(Location(0.0, 1.2, 0.0), 1, [2], landing, options, others),
        own_spot(east, 1, options, [*others, Location(0.0, 2.15, 0.0)]),  # its own spot: 1.1
    ):
        assert spot.distance_m(told._replace(longitude=2.05)) >= 1.0


@pytest.mark.parametrize("side", [1, -1])
def test_a_way_aside_and_a_spot_beside_are_on_the_side_that_the_fence_allows(side):
    neighbours = Neighbours(UNDISTURBED, 30.0, 9.0)
    neighbours.set_place(7, Location(latitude=0.0, longitude=10.0, height=10.0), 0.0)
    options, places = RepairOptions(clearance_m=1.0, range_m=30.0), KnownPlaces()

    def allows(place: Location) -> bool:
        return side * place.latitude >= 0.0

    taken = TakenPlaces(1, Deadlines(), neighbours, places, options, allows)
    here, end = Location(0.0, 0.0, 0.0), Location(0.0, 20.0, 0.0)
    assert not taken.is_clear(taken.way(here, end))
    aside = taken.aside(here, end)
    assert aside != end
    assert allows(aside)
    gone = Location(latitude=-side * 0.2, longitude=15.0, height=0.0)
    assert allows(taken.at_or_beside(gone, Landing(here)))


def test_a_way_that_leads_round_a_fence_is_judged_where_it_leads():
    pond = Zone("pond", (((8.0, -9.0), (12.0, -9.0), (12.0, 3.0), (8.0, 3.0)),))
    plan = Obstacles((), fence=Fence.of([], [pond])).plan_flight
    here, end = Location(0.0, 0.0, 0.0), Location(0.0, 20.0, 0.0)
    for beside, is_clear in (((0.0, 10.0, 10.0), True), ((3.5, 10.0, 10.0), False)):
        neighbours = Neighbours(UNDISTURBED, 30.0, 9.0)
        neighbours.set_place(7, Location(*beside), 0.0)
        taken = TakenPlaces(
            1,
            Deadlines(),
            neighbours,
            KnownPlaces(),
            RepairOptions(clearance_m=1.0, range_m=30.0),
            plan=lambda start, goal, now_s: plan(start, goal, now_s, 2.0),
        )
        assert taken.is_clear(taken.way(here, end)) is is_clear
