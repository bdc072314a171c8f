"""A layout that was ordered is kept as a goal until each drone is at its place."""

from __future__ import annotations

import json
import struct
import threading

import pytest

from drone_mesh.drone.fence import Fence, Zone
from drone_mesh.drone.fleet import ids_in_words
from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.formations.departures import FlightRules
from drone_mesh.formations.layouts import Layouts
from drone_mesh.formations.standing_order import PartState
from drone_mesh.formations.standing_orders import StandingOrders
from drone_mesh.inprocess.network import Network
from drone_mesh.inprocess.node import event_records
from drone_mesh.state.model import EventRecord, MeshStatus, NodeStatus

HOME = Location(0.0, 0.0, 0.0)
EAST = Location(latitude=0.0, longitude=6.0, height=0.0)
NORTH = Location(latitude=6.0, longitude=0.0, height=1.0)


def drone(node_id, at=HOME, to=None, connected=True):
    path = () if to is None else (*at.to_vector(), *to.to_vector())
    return NodeStatus(node_id, connected=connected, position=at.to_vector(), path=path)


def gateway():
    return NodeStatus(0, role=Role.GATEWAY, connected=True, position=(-1.0, 0.0, 0.0))


def state(now_s, *nodes):
    return MeshStatus(now_s, nodes)


def words(orders):
    return [progress.in_words() for progress in orders.all_progress()]


@pytest.fixture
def orders():
    return StandingOrders()


def test_a_drone_without_a_route_is_ordered_as_soon_as_it_has_one(orders):
    orders.give("layout 7", {4: EAST}, now_s=0.0)
    assert orders.update(state(6.0, drone(4, connected=False))) == []
    assert words(orders) == ["0 of 1 at their place, 1 without a route: 4"]
    assert orders.update(state(7.0, drone(4))) == [(4, EAST)]


def test_an_order_that_a_drone_does_not_carry_out_is_repeated_less_and_less_often(orders):
    orders.give("layout 7", {4: EAST}, now_s=0.0)
    ordered = [s for s in range(100) if orders.update(state(float(s), drone(4)))]
    assert ordered == [0, 5, 15, 35, 75]


def test_a_drone_that_flies_to_its_place_is_left_alone_until_it_is_there(orders):
    orders.give("layout 7", {4: EAST, 5: NORTH}, now_s=0.0)
    flying = state(20.0, drone(4, to=EAST), drone(5, to=NORTH))
    assert orders.update(flying) == []
    assert words(orders) == ["0 of 2 at their places, 2 flying"]
    assert orders.update(state(30.0, drone(4, at=EAST), drone(5, at=NORTH))) == []
    assert words(orders) == ["2 of 2 at their places"]
    assert orders.all_progress()[0].is_over


def test_a_drone_that_flies_elsewhere_is_ordered_when_it_has_landed(orders):
    orders.give("layout 7", {4: EAST}, now_s=0.0)
    assert orders.update(state(6.0, drone(4, to=NORTH))) == []
    assert words(orders) == ["0 of 1 at their place, 1 waiting to set out: 4"]
    assert orders.update(state(7.0, drone(4, at=NORTH))) == [(4, EAST)]


def test_a_drone_that_may_still_set_out_elsewhere_is_ordered_to_the_place_where_it_stands(orders):
    there = state(0.0, drone(4))
    first = orders.give("layout 7", {4: EAST}, now_s=0.0)
    assert orders.update(there) == [(4, EAST)]
    orders.withdraw(first)
    orders.give("layout 8", {4: HOME}, now_s=0.0)
    assert orders.update(there) == [(4, HOME)]
    assert orders.update(state(1.0, drone(4))) == []
    assert orders.all_progress()[-1].is_over


def test_a_drone_that_another_order_sent_elsewhere_is_ordered_back_to_where_it_stands(orders):
    orders.ordered(4, EAST, now_s=0.0)
    orders.give("layout 8", {4: HOME}, now_s=1.0)
    assert orders.update(state(1.0, drone(4))) == [(4, HOME)]
    orders.ordered(5, EAST, now_s=0.0)
    orders.give("layout 9", {5: HOME}, now_s=40.0)
    assert orders.update(state(40.0, drone(5))) == []


def test_at_once_a_drone_is_ordered_on_the_way_elsewhere_and_without_a_route(orders):
    orders.give("layout 7", {3: EAST, 4: EAST, 5: NORTH}, now_s=0.0, at_once=True)
    present = drone(3), drone(4, to=NORTH), drone(5, connected=False)
    assert orders.update(state(6.0, *present)) == [(5, NORTH), (4, EAST), (3, EAST)]


def test_a_drone_that_may_still_set_out_is_not_met_by_another_one(orders):
    there, across = drone(4), drone(5, at=Location(3.0, 3.0, 0.0))
    orders.give("layout 7", {4: EAST}, now_s=0.0)
    assert orders.update(state(1.0, gateway(), there, across)) == [(4, EAST)]
    orders.give("layout 8", {5: Location(-3.0, 3.0, 0.0)}, now_s=2.0)  # crosses the other path
    assert orders.update(state(3.0, gateway(), there, across)) == []
    arrived = drone(4, at=EAST)
    assert orders.update(state(9.0, gateway(), arrived, across)) == [(5, Location(-3.0, 3.0, 0.0))]


@pytest.mark.parametrize(
    ("event", "may_set_out"),
    [
        (EventRecord(1.5, 3, "no route", (4,)), True),
        (EventRecord(1.5, 0, "no route", (4,), "", 3, EAST), False),
    ],
)
def test_a_drone_is_under_way_until_its_gateway_has_no_route_whatever_a_relay_says(
    orders, event, may_set_out
):
    """A relay names no order; on a shared channel the gateway finds the drone and repeats it."""
    there, across = drone(4), drone(5, at=Location(3.0, 3.0, 0.0))
    orders.give("layout 7", {4: EAST}, now_s=0.0)
    assert orders.update(state(1.0, gateway(), there, across)) == [(4, EAST)]
    orders.on_event(event)
    west = Location(-3.0, 3.0, 0.0)  # crosses the other path
    orders.give("layout 8", {5: west}, now_s=2.0)
    ordered = orders.update(state(3.0, gateway(), there, across))
    assert ordered == ([] if may_set_out else [(5, west)])


def test_a_drone_that_has_arrived_once_is_not_ordered_back_after_a_repair(orders):
    orders.give("layout 7", {4: EAST, 5: NORTH}, now_s=0.0)
    orders.update(state(10.0, drone(4, at=EAST), drone(5)))
    assert orders.update(state(60.0, drone(4, at=HOME), drone(5))) == [(5, NORTH)]


def test_a_drone_that_found_no_mesh_at_its_place_is_ordered_back_once_it_is_connected(orders):
    orders.give("layout 7", {4: EAST, 5: NORTH}, now_s=0.0)
    orders.update(state(0.0, drone(4), drone(5)))
    late = drone(5, to=NORTH)
    orders.update(state(9.0, drone(4, at=EAST, connected=False), late))
    repaired = drone(4, at=Location(latitude=-6.0, longitude=0.0, height=0.0))
    others = [drone(n, at=Location(n - 10.0, -3.0, 0.0)) for n in range(10, 20)]  # the mesh holds
    assert orders.update(state(60.0, gateway(), repaired, late, *others)) == [(4, EAST)]


def test_a_drone_brought_back_from_a_place_out_of_reach_is_named_until_that_is_in_reach():
    far, north, back = EAST._replace(longitude=14.0), drone(5, at=NORTH), drone(4, at=HOME)
    aside = drone(5, at=NORTH, to=NORTH._replace(longitude=3.0))
    others = [gateway(), *(drone(n, at=Location(n - 10.0, -3.0, 0.0)) for n in range(10, 20))]
    orders = StandingOrders()
    orders.give("layout 7", {4: far, 5: EAST}, now_s=0.0)
    orders.update(state(0.0, drone(4), north, *others))
    orders.update(state(9.0, drone(4, at=far, connected=False), aside, *others))
    assert orders.update(state(60.0, back, aside, *others)) == []
    assert "4 refused: its place is out of reach" in words(orders)[0]
    there = drone(5, at=NORTH, to=EAST)
    assert orders.update(state(61.0, back, there, *others)) == [(4, far)]


def test_a_drone_that_finds_no_mesh_at_its_place_is_not_ordered_back_when_nobody_else_comes(orders):
    orders.give("layout 7", {4: EAST, 5: NORTH}, now_s=0.0)
    off = drone(5, connected=False)
    orders.update(state(0.0, drone(4), off))
    orders.update(state(9.0, drone(4, at=EAST, connected=False), off))
    repaired = drone(4, at=Location(latitude=-6.0, longitude=0.0, height=0.0))
    assert orders.update(state(60.0, repaired, off)) == []


def test_a_later_layout_replaces_the_goals_of_its_drones_and_no_others(orders):
    orders.give("layout 7", {4: EAST, 5: EAST}, now_s=0.0)
    orders.give("layout 8", {4: NORTH}, now_s=3.0)
    ordered = orders.update(state(60.0, drone(4), drone(5)))
    assert ordered == [(4, NORTH), (5, EAST)]
    assert "1 replaced by a later order: 4" in words(orders)[0]


def test_a_flight_ordered_at_a_gateway_replaces_the_drones_goal(orders):
    orders.give("layout 7", {4: NORTH}, now_s=10.0)
    elsewhere = Location.from_vector((9.0, 0.0, 0.0))
    orders.on_event(EventRecord(5.0, 0, "order sent", (4,), "", 2, elsewhere))  # an older one
    orders.on_event(EventRecord(10.0, 0, "order sent", (4,), "", 3, NORTH))
    assert words(orders) == ["0 of 1 at their place, 1 without a route: 4"]
    orders.on_event(EventRecord(11.0, 0, "order sent", (4,), "", 4, elsewhere))
    assert words(orders) == ["0 of 1 at their place, 1 replaced by a later order: 4"]


@pytest.mark.parametrize("x", [1.125, 2.675, 0.005, -3.315, 2.005])
@pytest.mark.parametrize("at_once", [False, True])
def test_a_drone_is_never_replaced_by_its_own_order_whatever_its_decimals(orders, x, at_once):
    goal = Location.from_vector((x, 2.045, 2.4))
    orders.give("my.csv", {4: goal}, now_s=0.0, at_once=at_once)
    assert len(orders.update(state(1.0, drone(4)))) == 1
    carried = Location(*struct.unpack("<ffh", struct.pack("<ffh", 2.045, x, 2)))
    for kind in ("order sent", "order accepted", "order arrived"):
        orders.on_event(EventRecord(1.5, 0, kind, (4,), "", 3, carried))
    orders.update(state(9.0, drone(4, at=carried)))
    assert words(orders) == ["1 of 1 at their place"]


def test_a_refusal_is_shown_with_its_reason_and_tried_again(orders):
    orders.give("layout 7", {4: EAST}, now_s=0.0)
    orders.on_event(EventRecord(1.0, 0, "order refused", (4,), "battery at 9 %", 3, EAST))
    assert words(orders) == ["0 of 1 at their place, 4 refused: battery at 9 %"]
    assert orders.update(state(6.0, drone(4))) == [(4, EAST)]


def test_a_place_that_the_fence_has_taken_is_named_and_flown_to_once_it_is_free_again(orders):
    orders.give("layout 7", {4: EAST, 5: NORTH}, now_s=0.0)
    pond = Fence.of([], [Zone.circle("pond", (6.0, 0.0), 2.0, inside=False)])
    drones = drone(4), drone(5, at=NORTH)
    for now_s in (6.0, 60.0):
        assert orders.update(state(now_s, *drones), FlightRules(fence=pond)) == []
    why = "inside fence pond, which drones stay out of"
    assert words(orders) == [f"1 of 2 at their places, 4 refused: {why}"]
    assert orders.update(state(61.0, *drones)) == [(4, EAST)]


def test_drones_that_do_not_exist_are_named(orders):
    orders.give("layout 7", {4: EAST, 9: EAST}, now_s=0.0)
    orders.update(state(1.0, drone(4, at=EAST)))
    assert words(orders) == ["1 of 2 at their places, 1 not in this fleet: 9"]
    assert orders.all_progress()[0].is_over


def test_a_withdrawn_layout_orders_nothing_more(orders):
    number = orders.give("layout 7", {4: EAST}, now_s=0.0)
    assert orders.withdraw(number).drones[PartState.WAITING] == (4,)
    assert orders.update(state(60.0, drone(4))) == []
    assert orders.withdraw(number) is None


def test_what_is_left_to_do_survives_a_restart():
    before, after = StandingOrders(), StandingOrders()
    before.give("layout 7", {4: EAST, 5: NORTH}, now_s=0.0)
    before.update(state(10.0, drone(4, at=EAST), drone(5)))
    after.restore(before.saved())
    assert after.update(state(11.0, drone(4), drone(5))) == [(5, NORTH)]
    assert after.give("layout 8", {4: EAST}, now_s=11.0) == 2


LAYOUTS = Layouts.shipped()


def order_layout(network, orders, case):
    """As the DroneManager does it: the first orders at once, the far end first."""
    present = {node.id for node in network.status().nodes}
    wanted = [(n, goal) for n, goal in LAYOUTS.orders(case) if n in present]
    orders.give(f"layout {case}", dict(wanted), network.now_s())
    for node_id, goal in wanted:
        network.order(node_id, goal.longitude, goal.latitude, int(goal.height))


def follow(network, orders, seconds):
    seen = 0
    for _ in range(int(seconds)):
        network.run_for(1.0)
        for event in event_records(network.events[seen:]):
            orders.on_event(event)
        seen = len(network.events)
        for node_id, goal in orders.update(network.status()):
            network.order(node_id, goal.longitude, goal.latitude, int(goal.height))


@pytest.mark.parametrize("pause_s", [1, 3, 8, 20])
def test_the_last_layout_ordered_is_reached_whatever_was_ordered_before(pause_s):
    network = Network(seed=1)
    network.add_gateway(0, -1.0, 0.0)
    for k in range(17):
        network.add_router(k + 1, float(k % 6), float(k // 6))
    assert network.run_until(network.all_connected, 30.0)
    orders = StandingOrders()
    for case in (0, 202, 101, 0):
        order_layout(network, orders, case)
        follow(network, orders, pause_s)
    places = dict(LAYOUTS.orders(0))

    def astray():
        return [n for n in places if network.location(n).distance_m(places[n]) > 0.5]

    for _ in range(120):
        if not astray():
            break
        follow(network, orders, 1)
    follow(network, orders, 5)  # nobody leaves it again
    last = orders.all_progress()[-1]
    assert astray() == [], f"{ids_in_words(astray())}: {last.in_words()}"


def test_no_drone_is_sent_to_the_place_of_one_that_stays_there(orders):
    orders.give("layout 7", {4: EAST}, now_s=0.0)
    orders.give("layout 8", {5: NORTH}, now_s=0.0, at_once=True)
    there = drone(6, at=EAST), drone(7, at=NORTH)
    assert orders.update(state(1.0, drone(4), drone(5), *there)) == []
    refused = "0 of 1 at their place, {} refused: drone {} is in the way"
    assert words(orders) == [refused.format(4, 6), refused.format(5, 7)]


@pytest.mark.parametrize("change", ["ordered elsewhere", "withdrawn"])
def test_while_it_plans_others_may_change_the_orders_and_what_they_did_counts(change):
    lock = threading.RLock()
    orders = StandingOrders(lock)
    number = orders.give("layout 7", {4: EAST, 5: NORTH}, now_s=0.0)
    planned = []

    def other_thread():
        with lock:
            if change == "withdrawn":
                orders.withdraw(number)
            else:
                orders.ordered(4, HOME, now_s=1.0)

    def plan(*args):
        if not planned:
            other = threading.Thread(target=other_thread, daemon=True)
            other.start()
            other.join(5.0)
            planned.append(other.is_alive())
        return FlightPath(*args)

    wanted = orders.update(state(1.0, gateway(), drone(4), drone(5, at=NORTH)), FlightRules(plan))
    assert planned == [False]
    assert 4 not in dict(wanted)


def test_a_relief_that_a_user_ended_before_a_restart_is_not_taken_up_again(orders):
    number = orders.give("relief", {4: EAST}, now_s=0.0, relieves=5)
    orders.ordered(4, NORTH, now_s=1.0)
    assert orders.give("over", {}, now_s=1.0) == number + 1
    orders.forget_complete()
    restarted = StandingOrders()
    restarted.restore(json.loads(json.dumps(orders.saved())))
    assert restarted.update(state(2.0, drone(4, at=NORTH))) == []
    assert not restarted.stands(number)
    assert restarted.give("next", {}, now_s=2.0) == number + 2  # a relief may know the others
