"""A fence that changes while drones of the world fly, kinematic and with physics."""

from __future__ import annotations

import pytest

from drone_mesh.air.obstacles import Box, Obstacles
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.drone.fence import Fence, Zone
from drone_mesh.drone.fleet import StartPlace
from drone_mesh.drone.roles import Role
from drone_mesh.errors import FleetRefused, GoalRefused
from drone_mesh.formations.missions import Mission
from drone_mesh.world.bullet_world import BulletWorld
from drone_mesh.world.factory import DroneFactory

PLACE = StartPlace(0, Role.ROUTER, 0.0, 0.0)
HALL = Zone("hall", (((-9, -9), (9, -9), (9, 9), (-9, 9)),))
WALL = Zone("wall", (((6, -9), (7, -9), (7, 9), (6, 9)),))
THIN = Zone("thin", (((8.98, -9), (8.99, -9), (8.99, 9), (8.98, 9)),))  # within a step of a pilot


@pytest.fixture(params=[None, (0.0, 0.0, 0.0)], ids=["kinematic", "dynamic"])
def factory(request):
    with BulletWorld() as world:
        boxes = Obstacles([Box((0.0, 30.0, 1.0), (2.0, 2.0, 2.0))])
        factory = DroneFactory(world, [PLACE], request.param, boxes)
        factory.world, factory.noted = world, []
        factory.drones[0].engine.observe(lambda *event: factory.noted.append(event))
        yield factory


def fly(factory, seconds):
    """The drone's places."""
    places = []
    for _ in range(round(seconds * 100)):
        factory.world.step()
        places.append(factory.drones[0].engine.get_location().to_vector())
    return places


@pytest.mark.parametrize(
    ("fence", "end", "words"),
    [
        (Fence.of([HALL], []), None, "outside fence hall"),
        (Fence.of([], [WALL]), (12.0, 0.0), ""),
        (Fence(), (12.0, 0.0), ""),
    ],
)
def test_a_flight_ends_where_it_is_or_leads_round(factory, fence, end, words):
    engine = factory.drones[0].engine
    engine.set_goal(0.0, 12.0, 0.0)
    before = fly(factory, 1.5)[-1]
    factory.keep_to(fence)
    places = fly(factory, 40.0)
    assert not any(map(fence.why_not, places))
    assert places[-1][:2] == pytest.approx(end or before[:2], abs=0.5)
    assert [words in detail for _kind, _now_s, detail in factory.noted] == [True] * bool(words)
    assert engine.state.path is None
    if words:
        with pytest.raises(GoalRefused, match=words):
            engine.set_goal(0.0, 12.0, 0.0)
        with pytest.raises(FleetRefused, match=words):
            factory.add(Role.ROUTER, 20.0, 20.0)
    factory.keep_to(Fence())
    engine.set_goal(0.0, 14.0, 0.0)
    assert fly(factory, 40.0)[-1][:2] == pytest.approx((14.0, 0.0), abs=0.2)


def test_the_way_that_a_drone_has_left_to_fly_counts_not_the_one_of_a_quicker_drone(factory):
    """One with physics climbs half as fast as a kinematic one, which would be past the gate."""
    engine = factory.drones[0].engine
    factory.keep_to(Fence.of([], [Zone("dam", (((22, -60), (23, -60), (23, 8), (22, 8)),))]))
    engine.set_goal(0.0, 40.0, 0.0)
    fly(factory, 19.5 if engine.battery_percent() else 10.0)
    assert engine.get_location().longitude < 21.0
    gate = Fence.of([], [Zone("gate", (((22, 7), (23, 7), (23, 14), (22, 14)),))])
    factory.keep_to(gate)
    assert not any(map(gate.why_not, fly(factory, 40.0)))
    assert engine.get_location().longitude == pytest.approx(40.0, abs=0.2)


@pytest.mark.parametrize(
    ("fence", "words"),
    [
        (Fence.of([HALL], []), "outside fence hall"),
        (Fence.of([], [THIN]), "fence thin"),
    ],
)
def test_a_pilot_pauses_at_the_fence(factory, fence, words):
    engine = factory.drones[0].engine
    engine.fly_with(Mission([(0.0, 0.0, 2.0), (12.0, 0.0, 2.0)], 1.0, False).pilot())
    fly(factory, 4.0)
    factory.keep_to(fence)
    assert max(x for x, _y, _z in fly(factory, 30.0)) == pytest.approx(9.0, abs=0.3)
    ((kind, _now_s, detail),) = factory.noted
    assert kind == MeshEventKind.GOAL_REFUSED
    assert detail.startswith("its pilot pauses: ")
    assert words in detail
    assert engine.pilot.paused
