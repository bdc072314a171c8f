"""A fence wherever a goal is accepted: orders, repairs, formations, missions, other engines."""

from __future__ import annotations

import math

import pytest
from scenarios import placed

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.interfaces import OrderState
from drone_mesh.drone.engines import FlightOptions, create_engine
from drone_mesh.drone.fence import Fence, Zone
from drone_mesh.drone.fleet import StartPlace
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.errors import GoalRefused
from drone_mesh.formations.departures import FlightRules
from drone_mesh.formations.missions import Mission
from drone_mesh.formations.preview import preview
from drone_mesh.inprocess.drone import PositionErrors
from drone_mesh.state.condition import find_trouble
from drone_mesh.world.factory import DroneFactory
from drone_mesh.world.worlds import World

YARD = Zone("yard", (((-10, -10), (30, -10), (30, 10), (-10, 10)),), highest_m=8.0)
POND = Zone.circle("pond", (8.0, 0.0), 1.5, inside=False)
FENCE = Fence.of([YARD], [POND])


def fenced(places=((0.0, 0.0), (4.0, 0.0)), fence=FENCE, **options):
    network = placed(places, seed=1, fence=fence, **options)
    network.run_for(20.0)
    return network


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ((31.0, 0.0, 0), "outside fence yard"),
        ((4.0, 0.0, 9), "above fence yard: 9 m, and it ends at 8 m"),
        ((8.0, 1.0, 0), "inside fence pond, which drones stay out of"),
    ],
)
def test_an_order_outside_is_refused_by_the_gateway_and_by_a_drone_whose_gateway_has_no_fence(
    goal, words
):
    network = fenced()
    with pytest.raises(GoalRefused, match=words):
        network.order(1, *goal)
    network.nodes[0].drone.fence = network.nodes[1].drone.fence = Fence()
    network.nodes[1].drone.fences = lambda: FENCE  # as one with an autopilot, which has its own
    network.order(1, *goal)
    network.run_for(5.0)
    (order,) = network.nodes[0].component.get_orders()
    assert (order.state, order.reason) == (OrderState.REFUSED, words)
    assert MeshEventKind.FLIGHT_ORDERED not in [event.kind for event in network.events]


def test_a_drone_with_a_receiver_keeps_the_fence_of_its_network():
    network = fenced(positions=PositionErrors(sigma_m=0.1))
    with pytest.raises(GoalRefused, match="pond"):
        network.order(1, 8.0, 0.0)


def test_an_ordered_flight_goes_round():
    network = fenced(((0.0, 0.0), (4.0, 0.0)))
    network.order(1, 12.0, 0.0)
    places = []
    for _ in range(200):
        network.run_for(0.1)
        places.append(network.location(1).to_vector())
    assert places[-1] == (12.0, 0.0, 0.0)
    assert not any(FENCE.why_not(place) for place in places)


def test_a_drone_outside_is_told_and_flies_inside_only():
    network = fenced(((0.0, 0.0), (4.0, 0.0), (0.0, 12.0)), max_distance_m=20.0)
    told = {
        node: [words for words in one.component.complaints.counts if "may not be" in words]
        for node, one in network.nodes.items()
    }
    assert told == {0: [], 1: [], 2: ["the drone is where it may not be"]}
    with pytest.raises(GoalRefused, match="outside fence yard"):
        network.order(2, 0.0, 11.0)
    network.order(2, 0.0, 4.0)
    outside = []
    for _ in range(100):
        network.run_for(0.1)
        outside.append(bool(FENCE.why_not(network.location(2).to_vector())))
    assert outside == sorted(outside, reverse=True)  # until it is inside, and never again
    assert network.location(2) == Location(4.0, 0.0, 0.0)


@pytest.mark.parametrize("repair", ["thesis", "inward", "named_backup", "virtual_spring"])
def test_a_repair_ends_at_the_nearest_place_inside(repair):
    """Its relay dies above the pond, where it may not fly."""
    network = fenced(((0.0, 0.0), (8.0, 0.0), (16.0, 0.0)), fence=Fence(), repair=repair)
    assert network.all_connected()
    network.set_fence(FENCE)
    network.power(1, False)
    for _ in range(600):
        network.run_for(0.25)
        assert not FENCE.why_not(network.location(2).to_vector())
    assert network.connected(2)
    assert math.dist(network.location(2)[:2], (0.0, 8.0)) > 1.5


def test_a_drone_that_would_have_to_leave_for_a_repair_stays():
    home = Fence.of([Zone("home", (((15, -1), (17, -1), (17, 1), (15, 1)),))], [])
    network = fenced(((0.0, 0.0), (8.0, 0.0), (16.0, 0.0)))
    network.nodes[2].drone.fence = home
    network.power(1, False)
    network.run_for(150.0)
    assert not home.why_not(network.location(2).to_vector())


@pytest.mark.parametrize(
    ("waypoints", "here", "loop", "words"),
    [
        ([(0, 0, 3), (20, 5, 3)], (0, 5, 0), False, ""),
        ([(0, 0, 3), (40, 0, 3)], None, False, "outside fence yard"),
        ([(0, 0, 3), (16, 0, 3)], None, False, "its way passes fence pond"),
        ([(0, 0, 3), (16, 8, 3), (16, 0, 3)], None, True, "its way passes fence pond"),
        ([(0, 0, 3)], (16, 0, 0), False, "its way passes fence pond"),
        ([(0, 0, 9)], None, False, "above fence yard"),
    ],
)
def test_a_mission_whose_ways_leave_the_fence_is_refused(waypoints, here, loop, words):
    mission = Mission(waypoints, 1.0, loop)
    if not words:
        mission.pilot(FENCE, here)
        return
    with pytest.raises(GoalRefused, match=words):
        mission.pilot(FENCE, here)


def test_the_preview_of_a_formation_names_the_fence():
    network = fenced(((0.0, 0.0), (4.0, 0.0), (0.0, 4.0)))
    rules = FlightRules(Obstacles((), fence=FENCE).plan_flight, fence=FENCE)
    goals = {1: Location(0.0, 8.0, 0.0), 2: Location(4.0, 4.0, 0.0)}
    found = preview(network.status(), goals, rules)
    assert found.stays == {1: "inside fence pond, which drones stay out of"}


@pytest.mark.parametrize(
    ("role", "x", "height"),
    [
        (Role.ROUTER, 29.0, 8),  # as high as the fence, and its body is higher
        (Role.GATEWAY, 29.0, 8),
        (Role.ROUTER, 7.03, 0),  # as usual it would cross at 8.015 m
    ],
)
def test_a_drone_of_the_world_refuses_a_goal_outside_and_flies_lower_than_usual(role, x, height):
    world = World()
    fence = Fence.of([YARD], [])
    place = StartPlace(0, role, -9.0, 0.0)
    engine = DroneFactory(world, [place], obstacles=Obstacles((), fence=fence)).drones[0].engine
    with pytest.raises(GoalRefused, match="outside fence yard"):
        engine.set_goal(0.0, 31.0, 0.0)
    engine.set_goal(0.0, x, height)
    heights = []
    while not heights or engine.state.is_flying:
        world.step()
        heights.append(engine.get_location().height)
    assert engine.get_location().distance_m(Location(0.0, x, height)) < 0.01
    assert max(heights) < 8.0 + 1e-6


def test_the_engine_of_a_pi_has_the_fence_of_its_options():
    engine = create_engine(1, None, FlightOptions(fence=FENCE))
    assert engine.fence.why_not((31.0, 0.0, 0.0)) == "outside fence yard"


HALL = Zone("hall", (((-10, -10), (9, -10), (9, 10), (-10, 10)),))
WALL = Zone("wall", (((9, -9), (10, -9), (10, 9), (9, 9)),))
DITCH = Zone("ditch", (((8, -40), (9, -40), (9, 40), (8, 40)),))


@pytest.mark.parametrize(
    ("fence", "state", "words"),
    [
        (Fence.of([HALL], []), OrderState.GIVEN_UP, "outside fence hall; "),
        (Fence.of([YARD], [DITCH]), OrderState.GIVEN_UP, "its way passes fence ditch; "),
        (Fence.of([], [WALL]), OrderState.ARRIVED, ""),  # round it
        (Fence(), OrderState.ARRIVED, ""),
    ],
)
@pytest.mark.parametrize("flown_s", [0.1, 2.0])
def test_a_fence_that_changes_ends_an_order_by_name_or_its_flight_leads_round(
    fence, state, words, flown_s
):
    network = fenced(((0.0, 0.0), (4.0, 0.0)), Fence(), max_distance_m=30.0)
    network.order(1, 12.0, 0.0)
    network.run_for(flown_s)
    network.set_fence(fence)
    places = []
    for _ in range(400):
        network.run_for(0.1)
        places.append(network.location(1).to_vector())
    (order,) = network.nodes[0].component.get_orders()
    assert (order.state, order.reason[: len(words)]) == (state, words)
    assert not any(map(fence.why_not, places))
    if state is OrderState.GIVEN_UP:
        assert places[0] == places[-1]  # it stayed
        network.set_fence(Fence())
        network.order(1, 12.0, 0.0)
        network.run_for(30.0)
        assert network.location(1) == Location(0.0, 12.0, 0.0)


def test_a_fence_with_a_way_round_is_not_blamed_for_a_drone_that_does_not_set_out():
    network = fenced()
    network.nodes[1].drone.set_goal = lambda *_goal: None
    network.order(1, 12.0, 0.0)
    network.run_for(40.0)
    (order,) = network.nodes[0].component.get_orders()
    assert order.reason == "the drone did not set out; 8.0 m from the goal"


def test_a_drone_that_a_new_fence_leaves_outside_is_told_at_once():
    network = fenced(((0.0, 0.0), (4.0, 0.0)), Fence(), positions=PositionErrors(sigma_m=0.01))
    network.set_fence(Fence.of([], [Zone.circle("pond", (4.0, 0.0), 2.0, inside=False)]))
    why = "inside fence pond, which drones stay out of"
    told = [one for one in network.events if one.kind is MeshEventKind.OUTSIDE_FENCE]
    assert [(one.node, one.detail) for one in told] == [(1, why)]
    assert [(one.node, one.text) for one in find_trouble(network.status().nodes)] == [(1, why)]
    with pytest.raises(GoalRefused, match="pond"):
        network.order(1, 5.0, 0.0)
    network.order(1, 8.0, 0.0)
    network.run_for(30.0)
    assert network.location(1) == Location(0.0, 8.0, 0.0)
    assert find_trouble(network.status().nodes) == []
