"""DroneEngine: goals, flights, arrival, snapshots, reports of others that fly the drone."""

from __future__ import annotations

import math
import threading

import pytest

from drone_mesh.drone.fleet import StartPlace
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.errors import GoalRefused
from drone_mesh.world.engine import DroneState
from drone_mesh.world.factory import RouterDrone
from drone_mesh.world.worlds import World


@pytest.fixture
def world():
    return World()


@pytest.fixture
def drone(world):
    """A router that stands at (0, 0, 0); its centre is 0.05 m up."""
    return RouterDrone(world, StartPlace(3, Role.ROUTER, 0.0, 0.0))


@pytest.fixture
def engine(drone):
    return drone.engine


def step_until(world, now_s):
    while world.now_s < now_s:
        world.step()


def fly(world, engine):
    """Step until the drone has landed; returns the duration of the flight in ticks of 0.01 s."""
    world.step()
    ticks = 0
    while engine.state.is_flying:
        world.step()
        ticks += 1
        assert ticks < 1_000_000, "the drone never lands"
    return ticks


def test_latitude_is_y_and_longitude_is_x(world, engine):
    engine.set_goal(latitude=4.0, longitude=-3.0, height=2.0)
    fly(world, engine)
    assert engine.state.position == (-3.0, 4.0, 2.05)
    assert engine.get_location() == pytest.approx(
        Location(latitude=4.0, longitude=-3.0, height=2.0)
    )


def test_ten_metres_take_five_seconds(world, engine):
    engine.set_goal(6.0, 8.0, 0.0)
    assert fly(world, engine) == 500


def test_the_corners_of_a_flight_are_flown_in_simulated_time(world, engine):
    engine.set_goal(0.0, 20.0, 0.0)
    world.step()  # leaves at 0.01 s, takes 10 s
    step_until(world, 1.01)
    assert engine.state.position == pytest.approx((0.0, 0.0, 10.05))
    step_until(world, 5.01)
    assert engine.state.position == pytest.approx((10.0, 0.0, 10.05))
    step_until(world, 9.01)
    assert engine.state.position == pytest.approx((20.0, 0.0, 10.05))
    step_until(world, 10.01)
    assert engine.state == DroneState((20.0, 0.0, 0.05), None, 10.01)


def test_the_body_in_the_world_is_where_the_engine_says(world, drone):
    drone.engine.set_goal(5.0, 5.0, 1.0)
    for _ in range(200):
        world.step()
        assert world.centres[drone.box] == drone.engine.state.position


def test_a_flight_straight_up_does_not_stop_when_it_passes_its_goal(world, engine):
    engine.set_goal(0.0, 0.0, 10.0)
    assert fly(world, engine) == 500
    assert engine.state.position == (0.0, 0.0, 10.05)


def test_a_new_goal_replans_from_where_the_drone_is(world, engine):
    engine.set_goal(0.0, 20.0, 0.0)
    step_until(world, 5.01)
    engine.set_goal(0.0, 10.0, 0.0)  # straight below: 10 m down
    world.step()
    path = engine.state.path
    assert path.start == pytest.approx((10.0, 0.0, 10.05), abs=0.03)
    assert path.goal == (10.0, 0.0, 0.05)
    assert path.start_s == 5.02
    fly(world, engine)
    assert engine.state.position == (10.0, 0.0, 0.05)


def test_the_goal_it_already_flies_to_changes_nothing(world, engine):
    engine.set_goal(0.0, 20.0, 0.0)
    step_until(world, 5.0)
    path = engine.state.path
    engine.set_goal(0.0, 20.004, 0.0)  # within 0.01 m: the same place
    world.step()
    assert engine.state.path is path


def test_the_goal_it_stands_on_makes_no_flight(world, engine):
    engine.set_goal(0.009, -0.009, 0.009)
    world.step()
    assert not engine.state.is_flying
    assert engine.state.position == (0.0, 0.0, 0.05)


def test_a_goal_just_further_than_arrived_is_flown_to(world, engine):
    engine.set_goal(0.0, 0.011, 0.0)
    fly(world, engine)
    assert engine.state.position == (0.011, 0.0, 0.05)


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        ((math.nan, 0.0, 0.0), "latitude nan"),
        ((0.0, math.inf, 0.0), "longitude inf"),
        ((0.0, 0.0, -math.inf), "height -inf"),
        ((5000.1, 0.0, 0.0), r"latitude 5000.1 m is outside -5000..5000 m"),
        ((0.0, -5000.1, 0.0), "longitude -5000.1 m is outside"),
        ((0.0, 0.0, -0.1), r"height -0.1 m is outside 0..500 m"),
        ((0.0, 0.0, 501), "height 501 m is outside"),
    ],
)
def test_an_invalid_goal_is_refused_with_the_reason(world, engine, goal, why):
    with pytest.raises(GoalRefused, match=why):
        engine.set_goal(*goal)
    world.step()
    assert not engine.state.is_flying


@pytest.mark.parametrize("goal", [(5000.0, -5000.0, 0.0), (-5000.0, 5000.0, 500.0)])
def test_the_bounds_themselves_are_allowed(world, engine, goal):
    engine.set_goal(*goal)
    world.step()
    assert engine.state.is_flying


def test_goals_take_effect_in_the_next_step_and_the_last_one_wins(world, engine):
    for longitude in (10.0, 20.0, 30.0):
        engine.set_goal(0.0, longitude, 0.0)
    assert not engine.state.is_flying
    fly(world, engine)
    assert engine.state.position == (30.0, 0.0, 0.05)


def test_a_listener_hears_each_step_of_a_flight_and_last_the_landing(world, engine):
    states: list[DroneState] = []
    engine.add_listener(states.append)
    engine.set_goal(0.0, 2.0, 0.0)  # 1 s
    fly(world, engine)
    for _ in range(50):
        world.step()
    assert len(states) == 101
    assert [state.is_flying for state in states] == [True] * 100 + [False]
    assert [round(state.now_s * 100) for state in states] == list(range(1, 102))


def test_goals_from_many_threads_all_reach_the_world(world):
    engines = [
        RouterDrone(world, StartPlace(i, Role.ROUTER, float(i), 0.0)).engine for i in range(20)
    ]

    def order(engine, x):
        for latitude in range(1, 101):
            engine.set_goal(float(latitude), x, 0.0)

    threads = [
        threading.Thread(target=order, args=(engine, float(i))) for i, engine in enumerate(engines)
    ]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        world.step()
    for thread in threads:
        thread.join()
    world.step()
    assert [engine.state.path.goal for engine in engines] == [
        (float(i), 100.0, 0.05) for i in range(20)
    ]


def test_a_followed_drone_is_where_it_was_last_reported_and_its_listeners_are_notified(
    world, drone
):
    states = []
    drone.engine.add_listener(states.append)
    drone.engine.follow((3.0, 4.0, 2.05))
    drone.engine.follow((3.0, 5.0, 2.05))
    world.step()
    assert world.centres[drone.box] == (3.0, 5.0, 2.05)
    assert drone.engine.get_location().distance_m(Location(5.0, 3.0, 2.0)) < 1e-9
    assert [state.position for state in states] == [(3.0, 5.0, 2.05)]
    world.step()
    assert len(states) == 1
