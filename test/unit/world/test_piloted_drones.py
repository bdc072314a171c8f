"""Drones of the world that pilots fly, kinematic and with physics."""

from __future__ import annotations

import math

import pytest

from drone_mesh.drone.battery import PowerModel
from drone_mesh.drone.fleet import StartPlace
from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.roles import Role
from drone_mesh.formations.mission_files import read_mission
from drone_mesh.formations.missions import Mission
from drone_mesh.mobility.pilot import TrackPilot, along
from drone_mesh.world.body import BodyLimits
from drone_mesh.world.bullet_world import BulletWorld
from drone_mesh.world.dynamic_engine import DynamicEngine
from drone_mesh.world.factory import RouterDrone

SQUARE = [(4.0, 0.0, 2.0), (4.0, 4.0, 2.0), (0.0, 4.0, 2.0), (0.0, 0.0, 2.0)]


def pilot(speed_m_s=1.0, loop=True):
    return TrackPilot(along(SQUARE, speed_m_s, loop), speed_m_s)


def drone(world, wind=None):
    return RouterDrone(world, StartPlace(3, Role.ROUTER, 0.0, 0.0), wind).engine


def run(world, seconds, engine=None):
    """The drone's places during this time, ten each second."""
    places = []
    for tick in range(round(seconds * 100)):
        world.step()
        if engine is not None and tick % 10 == 0:
            places.append(engine.get_location().to_vector())
    return places


@pytest.fixture
def world():
    with BulletWorld() as world:
        yield world


@pytest.fixture(params=[None, (0.0, 0.0, 0.0)], ids=["kinematic", "dynamic"])
def engine(request, world):
    return drone(world, request.param)


def test_a_piloted_drone_passes_its_waypoints_at_one_height(world, engine):
    engine.fly_with(pilot())
    places = run(world, 40.0, engine)
    for waypoint in SQUARE:
        assert min(math.dist(place, waypoint) for place in places) < 0.5
    assert all(abs(place[2] - 2.0) < 0.3 for place in places[60:])
    assert engine.state.path is None  # it is on no ordered flight


def test_an_order_pauses_the_pilot_who_takes_over_again_when_told(world, engine):
    flown = pilot()
    engine.fly_with(flown)
    run(world, 6.0)
    engine.set_goal(-3.0, -3.0, 0)
    run(world, 0.5)
    assert flown.paused
    assert engine.state.is_flying
    run(world, 30.0)
    assert math.dist(engine.get_location().to_vector(), (-3.0, -3.0, 0.0)) < 0.3
    engine.pause_pilot(False)
    places = run(world, 40.0, engine)
    assert min(math.dist(place, SQUARE[1]) for place in places) < 0.5


def test_a_pause_holds_the_drone_where_it_is(world, engine):
    engine.fly_with(pilot())
    run(world, 8.0)
    engine.pause_pilot(True)
    run(world, 8.0)  # physics swings
    places = run(world, 5.0, engine)
    assert max(math.dist(place, places[0]) for place in places) < 0.1


def test_without_a_pilot_the_drone_stays(world, engine):
    engine.fly_with(pilot())
    run(world, 6.0)
    engine.fly_with(None)
    run(world, 8.0)
    places = run(world, 3.0, engine)
    assert max(math.dist(place, places[0]) for place in places) < 0.1
    assert places[0][2] > 1.0


def test_a_kinematic_pilot_moves_the_drone_ten_times_a_second(world):
    engine = drone(world)
    states = []
    engine.add_listener(states.append)
    engine.fly_with(pilot())
    run(world, 5.0)
    assert 45 <= len(states) <= 51


def test_a_pilot_lets_physics_land_a_drone_whose_battery_is_low(world):
    box = world.add_body((0.2, 0.2, 0.1), (0.0, 0.0, 0.05), BodyLimits().mass_kg)
    limits = BodyLimits(power=PowerModel(hover_s=30.0))
    engine = DynamicEngine(world, box, (0.0, 0.0, 0.05), 0.05, limits=limits)
    engine.fly_with(pilot())
    run(world, 60.0)
    assert engine.why_not_fly()
    assert engine.get_location().height < 0.05


def test_a_ceiling_lowers_a_flight_but_takes_no_longer():
    free = FlightPath((0.0, 0.0, 0.0), (20.0, 0.0, 0.0), 0.0)
    low = FlightPath((0.0, 0.0, 0.0), (20.0, 0.0, 0.0), 0.0, ceiling_m=3.0)
    assert free.above_start[2] == 10.0
    assert low.above_start[2] == low.above_goal[2] == 3.0
    assert low.duration_s == free.duration_s
    high = FlightPath((0.0, 0.0, 5.0), (20.0, 0.0, 0.0), 0.0, ceiling_m=3.0)
    assert high.above_start[2] == 5.0


WAYPOINTS = """QGC WPL 110
0 1 0 16 0 0 0 0 52.0907 5.1214 3 1
1 0 3 22 0 0 0 0 0 0 5 1
2 0 2 178 1 2 0 0 0 0 0 1
3 0 3 16 0 0 0 0 52.0907 5.1215460 4 1
4 0 3 16 0 0 0 0 52.0907898 5.1215460 4 1
5 0 2 20 0 0 0 0 0 0 0 1
"""


def test_a_mission_of_a_file_is_flown_whole_and_says_how_far_it_is(world):
    """Up 4 m and 10 m east at 2 m/s; 10 m north, back over the home in 14.1 m, and down 4 m."""
    found = read_mission(WAYPOINTS, "a.waypoints", Origin(52.0907, 5.1214, 3.0))
    engine, flown = drone(world), Mission.drawn(found, None, None, False).pilot()
    engine.fly_with(flown)

    def after(seconds: float) -> str:
        run(world, seconds)
        return flown.mission_in_words(engine.get_location().to_vector())

    assert after(1.0) == "mission, waypoint 1 of 4, 20 s left"
    assert after(8.0) == "mission, waypoint 2 of 4, 12 s left"
    engine.pause_pilot(True)
    assert after(20.0) == "mission, waypoint 2 of 4, 12 s left; paused"
    engine.set_goal(4.0, 10.0, 4)  # an order, 4 m along the leg
    assert "waypoint 2 of 4" in after(20.0)
    assert engine.pilot is flown  # and it is not over
    engine.pause_pilot(False)
    assert after(0.5).startswith("mission, waypoint 2 of 4")
    run(world, 7.0)
    assert after(0.1).startswith("mission, waypoint 3 of 4")
    run(world, 15.0)
    assert engine.pilot is None
    assert engine.get_location().to_vector() == pytest.approx((0.0, 0.0, 0.0), abs=0.01)


def test_a_loop_has_no_end_and_a_model_no_mission():
    loop = Mission(SQUARE, 1.0, True).pilot()
    place = SQUARE[0]
    for tenth in range(1, 175):  # 16 m round, and 1.3 m
        place = loop.move(place, tenth / 10)
    assert loop.mission_in_words(place) == "mission, waypoint 2 of 4, in a loop"
    assert pilot().mission_in_words(place) == ""


def test_a_mission_that_has_ended_is_gone_and_one_that_an_order_ended_early_is_not(world, engine):
    engine.fly_with(pilot(speed_m_s=2.0, loop=False))
    run(world, 3.0)
    engine.pause_pilot(True)
    assert engine.pilot is not None
    engine.pause_pilot(False)
    run(world, 20.0)
    assert engine.pilot is None
    there = engine.get_location()
    engine.pause_pilot(False)
    run(world, 3.0)
    assert engine.get_location().distance_m(there) < 0.3
