"""How near drones come to each other on flights of repairs, known exactly."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from drone_mesh.air.graph import Graph
from drone_mesh.communication.events.observer import MeshEvent, MeshEventKind
from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.drone.location import Location
from drone_mesh.inprocess import Network
from drone_mesh.lab.flights import Flights, Leg
from drone_mesh.lab.metrics.harm import (
    approaches,
    avoidable_harm,
    close_ones,
    harm,
    left_placeless,
)
from drone_mesh.lab.scenario import Scenario, Streams
from drone_mesh.lab.sequence import SequenceRun
from drone_mesh.state.model import EventRecord

DECIDED, ORDERED = MeshEventKind.FLIGHT_DECIDED.value, MeshEventKind.FLIGHT_ORDERED.value


def flight(node, start, goal, start_s=0.0, replaced_s=None):
    return Leg(node, FlightPath(start, goal, start_s), True, False, replaced_s)


def record(places, *legs, kind=DECIDED, **end):
    ends = {leg.node: leg.path.goal for leg in legs}
    return SimpleNamespace(
        start=SimpleNamespace(places=places),
        end=SimpleNamespace(places={**places, **ends}, graph=end.pop("graph", Graph({}))),
        in_the_air=frozenset(),
        legs=legs,
        events=[EventRecord(leg.path.start_s, leg.node, kind) for leg in legs],
        end_s=100.0,
        scenario=Scenario(),
        **{
            "left_behind": {},
            "able": set(),
            "able_knowing": set(),
            "informed": set(),
            "endless_packets": 0,
            **end,
        },
        grounded=frozenset(),
    )


def test_a_flight_that_ends_beside_another_drone_counts_whether_that_is_on_or_not():
    run = record({1: (0, 0, 0), 2: (10, 0.9, 0)}, flight(1, (0, 0, 0), (10, 0, 0)))
    (found,) = approaches(run, 1.0)
    assert found[:2] == (1, 2)
    assert found.metres == pytest.approx(0.9)
    assert found.at_s == pytest.approx(5.0)
    assert close_ones(run) == (1, 0)


def test_an_end_outside_the_clearance_and_a_drone_far_below_the_way_do_not_count():
    places = {1: (0, 0, 0), 2: (10, 1.1, 0), 3: (5, 0, 0)}
    assert approaches(record(places, flight(1, (0, 0, 0), (10, 0, 0))), 1.0) == []


def test_two_drones_that_pass_each_other_between_two_samples_count():
    """They cross at 5 m of height, after 2.5 s, for a tenth of a second."""
    places = {1: (0, 0, 0), 2: (5, 5, 0)}
    crossing = (flight(1, (0, 0, 0), (10, 0, 0)), flight(2, (5, 5, 0), (5, -5, 0)))
    (found,) = approaches(record(places, *crossing), 1.0)
    assert found.metres == pytest.approx(0.0, abs=1e-9)
    assert found.at_s == pytest.approx(2.5)
    assert close_ones(record(places, *crossing)) == (0, 1)
    later = (crossing[0], flight(2, (5, 5, 0), (5, -5, 0), start_s=1.0))
    assert approaches(record(places, *later), 1.0) == []


def test_a_goal_that_was_replaced_in_flight_was_never_reached():
    places = {1: (0, 0, 0), 2: (10, 0, 0)}
    turned = FlightPath((0, 0, 0), (10, 0, 0), 0.0).position_at(2.0)
    legs = (
        flight(1, (0, 0, 0), (10, 0, 0), replaced_s=2.0),
        flight(1, turned, (0, 5, 0), start_s=2.0),
    )
    assert approaches(record(places, *legs), 1.0) == []


def test_one_that_turns_in_the_air_does_not_rest_there():
    """1 passes 2 just when that turns."""
    turned = FlightPath((5, 5, 0), (5, -5, 0), 0.0).position_at(2.5)
    legs = (
        flight(1, (0, 0, 0), (10, 0, 0)),
        flight(2, (5, 5, 0), (5, -5, 0), replaced_s=2.5),
        flight(2, turned, (5, 5, 0), start_s=2.5),
    )
    assert close_ones(record({1: (0, 0, 0), 2: (5, 5, 0)}, *legs)) == (0, 1)


def test_one_that_cannot_climb_higher_does_not_rest_there():
    """2 sets out at its ceiling and hangs there as long as it would climb: 1 passes just then."""
    legs = (
        flight(1, (0, 0, 0), (10, 0, 0)),
        Leg(2, FlightPath((5, 0, 5), (5, 16, 0), 2.0, ceiling_m=5.0), True, False),
    )
    assert close_ones(record({1: (0, 0, 0), 2: (5, 0, 5)}, *legs)) == (0, 1)


def test_an_ordered_flight_is_no_repair():
    places = {1: (0, 0, 0), 2: (10, 0, 0)}
    assert approaches(record(places, flight(1, (0, 0, 0), (10, 0, 0)), kind=ORDERED), 1.0) == []


def test_a_router_that_restarts_while_it_is_cut_off_with_others_is_told_a_place():
    content = {"sequence": {"incidents": ["restarted_cut_off"], "drones": [8, 14]}, "sample_s": 2}
    restarted = 0
    for number in range(10):
        run = SequenceRun(Scenario.model_validate(content), Streams(0, number)).run()
        restarted += sum(item.action == "restart" for item in run.happened)
        assert left_placeless(run) == 0
        assert not harm(run)
    assert restarted > 10


@pytest.mark.parametrize("goal", [(10, 0, 0), (20, 0, 0)])  # beside it; past it, at its height
@pytest.mark.parametrize("is_known", [False, True])
def test_harm_to_a_drone_is_avoidable_if_it_was_known(goal, is_known):
    leg = flight(1, (0, 0, 5), goal)
    leg.warned_of.update({2} if is_known else {3})
    run = record({1: (0, 0, 5), 2: (10, 0.9, leg.path.position_at(5.0)[2]), 3: (50, 50, 0)}, leg)
    assert (harm(run), avoidable_harm(run)) == (True, is_known)


def test_only_who_was_known_on_a_flight_of_a_repair_could_have_been_avoided():
    ordered, repair = flight(1, (0, 0, 5), (10, 0, 0)), flight(1, (10, 0, 0), (20, 0, 0), 60.0)
    ordered.warned_of.add(2)
    run = record({1: (0, 0, 5), 2: (20, 0.9, 0)}, ordered, repair)
    run.events[0] = EventRecord(0.0, 1, ORDERED)
    assert (harm(run), avoidable_harm(run)) == (True, False)


def test_drones_that_no_flight_brought_together_are_harm_that_somebody_could_avoid():
    run = record({1: (0, 0, 0), 2: (0.5, 0, 0)})
    assert harm(run)
    assert avoidable_harm(run)


@pytest.mark.parametrize(("informed", "is_avoidable"), [((), False), ((2,), True), ((3,), False)])
def test_a_drone_that_knows_no_place_could_ask_those_to_whom_links_lead(informed, is_avoidable):
    """1 was connected so briefly that it learned no place; no link leads to 3."""
    graph = Graph({1: [2], 2: [1], 3: []})
    run = record({}, graph=graph, left_behind={1: "knows no place to fly to"}, informed=informed)
    run.events.append(EventRecord(1.0, 1, MeshEventKind.CONNECTED.value))
    assert (harm(run), avoidable_harm(run)) == (True, is_avoidable)


@pytest.mark.parametrize("knowing", [set(), {1}])
def test_whose_only_link_leads_to_a_node_that_it_cannot_know_of_is_left_behind_without_fault(
    knowing,
):
    run = record(
        {}, left_behind={1: "is where it was connected last"}, able={1}, able_knowing=knowing
    )
    assert (harm(run), avoidable_harm(run)) == (True, bool(knowing))


def test_harm_of_other_kinds_is_always_avoidable():
    run = record({}, endless_packets=1)
    assert harm(run)
    assert avoidable_harm(run)


SILENT = (14.0, 0.0, 0.0)  # place of drone 4


def leg_of_1(knower, told=SILENT, cut=False, dead=False, goal=(14.5, 0.0, 0.0)):
    """Drone 1 sets out to 4, whose radio is off; `knower` was told a place of that one."""
    network = Network(seed=1)
    network.add_gateway(0, 0.0, 0.0)
    for node, x in ((1, 6.0), (2, 12.0), (3, 60.0), (4, SILENT[0])):
        network.add_router(node, x, 0.0)
    network.nodes[4].antenna.switch_power(False)
    network.run_for(5.0)
    flights = Flights(network)
    if cut:
        network.air.cut(1, 2)
    if dead:
        network.nodes[2].antenna.switch_power(False)
    for node in network.nodes.values():
        node.component.control.neighbours.places.clear()
    if knower is not None:
        tables = network.nodes[knower].component.control.neighbours
        tables.set_place(4, Location.from_vector(told), network.now_s())
    network.nodes[1].drone.fly_to(Location.from_vector(goal))
    return network, flights


@pytest.mark.parametrize("knower", [1, 2])
def test_a_flight_is_warned_of_a_silent_drone_by_itself_and_by_those_that_it_could_ask(knower):
    assert leg_of_1(knower)[1].legs[-1].warned_of == {4}


def test_a_flight_is_warned_of_the_live_ones_to_which_links_lead():
    assert leg_of_1(None, goal=(12.5, 0.0, 0.0))[1].legs[-1].warned_of == {2}
    assert leg_of_1(None, goal=(12.5, 0.0, 0.0), cut=True)[1].legs[-1].warned_of == set()


@pytest.mark.parametrize(
    "case",
    [
        {"knower": None},
        {"knower": 3},
        {"knower": 2, "dead": True},
        {"knower": 2, "cut": True},
        {"knower": 2, "told": (14.0, 0.98, 0.0)},  # near where it is, and clear of the flight
    ],
)
def test_nobody_warns_who_has_no_link_or_is_dead_or_was_told_another_place(case):
    assert 4 not in leg_of_1(**case)[1].legs[-1].warned_of


@pytest.mark.parametrize("kind", [MeshEventKind.FLIGHT_DECIDED, MeshEventKind.FLIGHT_ORDERED])
def test_a_repair_flight_is_warned_when_it_comes_into_reach_of_one_that_knows(kind):
    network, flights = leg_of_1(3)
    network.events.append(MeshEvent(kind, 1, network.now_s()))
    network.nodes[3].drone.speed_m_s = 100.0
    network.nodes[3].drone.fly_to(Location.from_vector((15.0, 6.0, 0.0)))
    network.run_for(1.0)
    flights.look()
    is_repair = kind is MeshEventKind.FLIGHT_DECIDED
    assert (4 in flights.legs[0].warned_of) == is_repair


def test_a_flight_away_from_one_beside_whom_the_drone_landed_unawares_is_not_warned_of_it():
    network, flights = leg_of_1(None, goal=(12.5, 0.0, 0.0))
    network.run_for(10.0)
    network.nodes[1].drone.fly_to(Location.from_vector((16.0, 3.0, 0.0)))
    assert [leg.warned_of for leg in flights.legs] == [{2}, set()]
