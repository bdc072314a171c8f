"""Drones that physics moves."""

from __future__ import annotations

import math
from typing import Iterator

import pytest

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.drone.battery import LAND_AT_PERCENT, Crews, PowerModel
from drone_mesh.drone.fence import Fence, Zone
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused
from drone_mesh.world.body import BodyLimits
from drone_mesh.world.bullet_world import BulletWorld
from drone_mesh.world.dynamic_engine import DynamicEngine

SIZE, HALF_M = (0.2, 0.2, 0.1), 0.05


@pytest.fixture
def world() -> Iterator[BulletWorld]:
    with BulletWorld() as world:
        yield world


def drone(world: BulletWorld, x: float = 0.0, y: float = 0.0, z: float = HALF_M, **settings):
    limits = settings.get("limits", BodyLimits())
    box = world.add_body(SIZE, (x, y, z), limits.mass_kg)
    return DynamicEngine(world, box, (x, y, z), HALF_M, **settings)


def run(world: BulletWorld, seconds: float) -> None:
    for _ in range(round(seconds / world.tick_s)):
        world.step()


def run_until_arrived(world: BulletWorld, engine: DynamicEngine, within_s: float = 120.0) -> float:
    started_s = world.now_s
    world.step()
    while engine.is_flying():
        assert world.now_s - started_s < within_s, engine.get_location()
        world.step()
    return world.now_s - started_s


def test_it_flies_up_across_and_down_and_stands(world):
    engine = drone(world)
    heights = []
    engine.add_listener(lambda state: heights.append(state.position[2]))
    engine.set_goal(6.0, 0.0, 0)
    assert run_until_arrived(world, engine) > 6.0 / 2.0
    run(world, 2.0)
    assert engine.get_location().distance_m(Location(6.0, 0.0, 0.0)) < 0.2
    assert max(heights) == pytest.approx(3.0 + HALF_M, abs=0.3)
    assert not engine.crashed
    assert engine.state.path is None


def test_it_hovers_at_a_goal_in_the_air_and_uses_its_battery(world):
    engine = drone(world)
    engine.set_goal(3.0, 0.0, 4)
    run_until_arrived(world, engine)
    before = engine.battery_percent()
    run(world, 12.0)
    assert engine.get_location().distance_m(Location(3.0, 0.0, 4.0)) < 0.2
    assert before - engine.battery_percent() == pytest.approx(1.0, rel=0.01)  # 12 s of 1200


def test_a_drone_that_stands_is_looked_at_ten_times_a_second_and_each_time_once_it_shall_fly(world):
    engine, looks = drone(world), []
    look, world.body_state = world.body_state, lambda box: looks.append(box) or look(box)
    run(world, 10.0)
    assert len(looks) == pytest.approx(100, abs=2)
    looks.clear()
    engine.set_goal(0.0, 0.0, 2)
    run(world, 1.0)
    assert len(looks) == 100


def test_a_standing_drone_that_is_pushed_is_seen_to_move(world):
    engine = drone(world)
    run(world, 1.0)
    for _ in range(20):
        before, _ = world.body_state(engine._box)
        world.push(engine._box, (30.0, 0.0, 0.0), before)
        world.step()
    assert before[0] > 0.1
    assert engine.state.position == before


def test_speed_and_acceleration_have_limits(world):
    engine = drone(world)
    limits = BodyLimits()
    engine.set_goal(30.0, 0.0, 10)
    world.step()
    before = (0.0, 0.0, 0.0)
    while engine.is_flying():
        world.step()
        _, velocity = world.body_state(engine._box)
        assert math.hypot(*velocity[:2]) <= limits.max_speed_m_s + 0.1
        assert velocity[2] <= limits.max_climb_m_s + 0.1
        assert math.dist(velocity, before) / world.tick_s <= limits.max_acceleration_m_s2 + 2.0
        before = velocity


def test_wind_does_not_keep_it_from_its_goal(world):
    engine = drone(world, wind=(3.0, -2.0, 0.0))
    engine.set_goal(5.0, 5.0, 3)
    run_until_arrived(world, engine)
    run(world, 10.0)
    assert engine.get_location().distance_m(Location(5.0, 5.0, 3.0)) < 0.5


def test_two_drones_that_meet_do_not_pass_through_each_other_and_a_hard_hit_ends_the_flight(world):
    fast = BodyLimits(max_speed_m_s=5.0)
    still = drone(world, 3.0, 0.0, 2.0)
    still._hover = Location.from_vector((3.0, 0.0, 2.0))
    other = drone(world, 0.0, 0.0, 2.0, limits=fast)
    other._hover = Location.from_vector((12.0, 0.0, 2.0))  # straight through the first one
    noted = []
    other.observe(lambda kind, now_s, detail: noted.append((kind, detail)))
    nearest = math.inf
    for _ in range(600):
        world.step()
        nearest = min(nearest, math.dist(still.state.position, other.state.position))
    assert nearest > 0.19
    assert other.crashed
    assert other.why_not_fly() == "crashed"
    ((kind, detail),) = noted
    assert kind is MeshEventKind.CRASHED
    assert detail.startswith("a hit of ")
    with pytest.raises(GoalRefused, match="crashed"):
        other.set_goal(1.0, 1.0, 1)
    run(world, 5.0)
    assert other.get_location().height < 0.05  # it fell


def test_two_drones_that_press_against_each_other_in_the_air_crash_and_do_not_hang_there(world):
    slow = BodyLimits(max_speed_m_s=0.4)  # they touch too gently for a hard hit
    one, other = (drone(world, x, 0.0, 3.0, limits=slow) for x in (0.0, 2.0))
    one._hover = Location.from_vector((4.0, 0.0, 3.0))
    other._hover = Location.from_vector((-2.0, 0.0, 3.0))
    noted = []
    one.observe(lambda kind, now_s, detail: noted.append((kind, detail)))
    run(world, 8.0)
    assert noted == [(MeshEventKind.CRASHED, "caught in something")]
    assert one.get_location().height < 0.2


def test_a_drone_that_runs_empty_lands_where_it_is_and_does_not_fly_again(world):
    engine = drone(world, limits=BodyLimits(power=PowerModel(hover_s=60.0)))
    engine.set_goal(0.0, 0.0, 5)
    run_until_arrived(world, engine)
    run(world, 80.0)
    assert engine.battery_percent() <= LAND_AT_PERCENT
    place = engine.get_location()
    assert place.height < 0.05
    assert math.hypot(place.latitude, place.longitude) < 0.3
    assert not engine.crashed
    with pytest.raises(GoalRefused, match="battery"):
        engine.set_goal(1.0, 1.0, 1)


def test_a_drone_that_runs_low_flies_home_where_there_are_crews_and_flies_again(world):
    engine = drone(world, limits=BodyLimits(power=PowerModel(hover_s=60.0)), crews=Crews(5.0))
    engine.set_goal(0.0, 6.0, 4)
    run(world, 70.0)
    place = engine.get_location()
    assert math.hypot(place.latitude, place.longitude) < 0.3
    assert place.height < 0.05
    assert engine.battery_percent() > 95.0
    engine.set_goal(0.0, 3.0, 2)
    run(world, 10.0)
    assert engine.get_location().height > 1.9


@pytest.mark.parametrize("home_at_s", [44.0, 90.0])
def test_its_last_flight_home_is_seen_and_not_begun_anew_on_the_way(world, home_at_s):
    engine = drone(world, limits=BodyLimits(power=PowerModel(hover_s=60.0)), crews=Crews(90.0))
    engine.set_goal(0.0, 6.0, 4)
    flights, heights = [], {}

    def note(state):
        heights[state.now_s] = state.position[2]
        if state.path and state.path not in flights:
            flights.append(state.path)

    engine.add_listener(note)
    run(world, min(home_at_s, 50.0))  # it runs low after 48 s
    if home_at_s < 48.0:
        engine.set_goal(0.0, 0.0, 0)
        run(world, 3.8)
    high_m = engine.get_location().height
    run(world, 30.0)
    assert [path.goal for path in flights] == [(6.0, 0.0, 4.0 + HALF_M), (0.0, 0.0, HALF_M)]
    assert engine.get_location().height < 0.05
    if home_at_s < 48.0:
        assert max(heights[now_s] for now_s in heights if now_s > 47.8) < high_m + 0.5


def test_a_fence_that_closes_the_last_way_home_lets_it_land_where_it_is(world):
    ring = ((-9.0, -9.0), (6.0, -9.0), (6.0, 9.0), (-9.0, 9.0))
    fence = Fence.of([], [Zone("pads", (ring,))])
    limits = BodyLimits(power=PowerModel(hover_s=60.0))

    def plan(*flight):
        return Obstacles((), fence=engine.fence).plan_flight(*flight)

    engine = drone(world, limits=limits, crews=Crews(90.0), plan_flight=plan)
    engine.set_goal(0.0, 12.0, 2)
    run(world, 49.0)  # it has begun to fly home
    engine.keep_to(fence)
    run(world, 30.0)
    place = engine.get_location()
    assert (place.longitude > 7.0, place.height < 0.05) == (True, True)


@pytest.mark.parametrize(
    "go",
    [
        lambda one: one.leave(),
        lambda one: one.set_goal(0.0, 0.0, 2),
        lambda one: setattr(one, "crashed", True),
    ],
    ids=["removed", "ordered away", "crashed"],
)
def test_a_crew_does_not_wait_for_a_drone_that_is_gone(world, go):
    settings = {"limits": BodyLimits(power=PowerModel(hover_s=10.0)), "crews": Crews(5.0)}
    one, two = drone(world, **settings), drone(world, x=3.0, **settings)
    run(world, 16.0)  # on the ground, below 95 %
    go(one)
    run(world, 8.0)
    assert two.battery_percent() > 95.0


def test_a_drone_is_flat_when_standing_has_used_the_rest_and_this_is_reported_once(world):
    engine = drone(world, limits=BodyLimits(power=PowerModel(hover_s=0.16)))
    told, noted = [], []
    engine.add_listener(lambda _state: told.append(engine.is_flat))
    engine.observe(lambda kind, now_s, detail: noted.append(kind))
    run(world, 4.0)
    assert not engine.is_flat
    run(world, 3.0)
    assert engine.is_flat
    assert told.count(True) == 1
    assert noted == [MeshEventKind.BATTERY_EMPTY]


def test_where_it_comes_to_rest_is_reported_even_to_a_listener_that_skips_most_of_it(world):
    engine = drone(world, z=2.0)  # it falls, and bounces
    told = []

    def thinned(state):
        if not told or state.now_s - told[-1].now_s >= 0.05:
            told.append(state)

    engine.add_listener(thinned)
    run(world, 3.0)
    position, _ = world.body_state(engine._box)
    assert math.dist(told[-1].position, position) < 1e-3
    count = len(told)
    run(world, 3.0)
    assert len(told) == count  # it lies still
