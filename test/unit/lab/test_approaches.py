"""How near drones come to each other on flights of repairs, known exactly."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.lab.flights import Leg
from drone_mesh.lab.metrics.harm import approaches, close_ones, harm, left_placeless
from drone_mesh.lab.scenario import Scenario, Streams
from drone_mesh.lab.sequence import SequenceRun
from drone_mesh.state.model import EventRecord

DECIDED, ORDERED = MeshEventKind.FLIGHT_DECIDED.value, MeshEventKind.FLIGHT_ORDERED.value


def flight(node, start, goal, start_s=0.0, replaced_s=None):
    return Leg(node, FlightPath(start, goal, start_s), True, False, replaced_s)


def record(places, *legs, kind=DECIDED):
    return SimpleNamespace(
        start=SimpleNamespace(places=places),
        legs=legs,
        events=[EventRecord(leg.path.start_s, leg.node, kind) for leg in legs],
        end_s=100.0,
        scenario=Scenario(),
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
