"""Random faults: the repair does no harm, and heals what can be healed."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from drone_mesh.drone.fence import Fence
from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.experiment import load_experiment
from drone_mesh.lab.metrics.harm import (
    flew_connected,
    harm,
    left_able,
    left_placeless,
    outside_s,
    resting_close,
)
from drone_mesh.lab.network_sample import physical_graph
from drone_mesh.lab.plan import Plan
from drone_mesh.lab.scenario import Scenario, Streams
from drone_mesh.lab.sequence import SequenceRun, run_sequence
from drone_mesh.lab.worker import execute
from drone_mesh.state.model import EventRecord

SEQUENCES, AT_ONCE = 100, 10
LARGEST = 14  # drones: a second for ten sequences; the suite runs meshes of up to 60
LOSSES = ["silent_for_a_while", "links_cut", "cut_vertex_killed", "many_killed"]
SUITE = Path(__file__).resolve().parents[3] / "experiments" / "sequences.yaml"


def sequence(number, *incidents, density=(7.0, 9.0), drones=(8, 14), routing="child_table_tree"):
    """The run of a sequence of these incidents."""
    content = {
        "sequence": {
            "incidents": list(incidents), "density": list(density), "drones": list(drones),
        },
        "sample_s": 2,
        "routing": routing,
    }  # fmt: skip
    return SequenceRun(Scenario.model_validate(content), Streams(0, number)).run()


@pytest.mark.parametrize("first", range(0, SEQUENCES, AT_ONCE))
def test_no_sequence_ends_with_stacked_drones_or_a_needless_flight_or_a_node_given_up(first):
    numbers = range(first, first + AT_ONCE)
    harmed = [number for number in numbers if harm(run_sequence(number, largest=LARGEST))]
    assert harmed == []


@pytest.mark.parametrize("number", range(10))
def test_no_drone_rests_at_the_place_of_one_that_was_silent_or_lost_a_link(number):
    record = sequence(number, "silent_for_a_while", "links_cut")
    assert {item.action for item in record.happened} & {"silent", "cut"}
    assert resting_close(record) == 0


@pytest.mark.slow
@pytest.mark.parametrize("number", [2259, 2369])
def test_with_beacons_no_drone_rests_beside_one_whose_place_it_hears_rounded_or_not_at_all(number):
    """In one, two drones without a link took one place; in the other, one went to 6.6 m."""
    record = sequence(number, *LOSSES, density=(5, 6.5), drones=(8, 60), routing="beacon")
    assert resting_close(record) == 0


@pytest.mark.parametrize(("density", "number"), [([5, 6.5], 1520), ([7, 9], 1250)])
def test_a_lone_drone_whose_link_to_the_gateway_failed_for_good_finds_others(density, number):
    """The next ones are 9.1 and 9.2 m from where it first lands beside the gateway."""
    assert sequence(number, *LOSSES, density=density, drones=(8, 60)).left_behind == {}


def test_no_repair_is_expected_of_a_drone_whose_links_have_all_failed():
    run = SequenceRun(Scenario.model_validate({"sequence": {"drones": [8, 8]}}), Streams(0, 1))
    record = run.run()
    lost = min(record.able)
    for other in run.network.nodes.keys() - {lost, 0}:
        run.network.air.cut(lost, other)
    assert run.is_able(lost)
    assert run.could_know_a_link(lost)
    run.network.air.cut(lost, 0)
    assert not run.is_able(lost)


def test_a_drone_could_know_of_the_only_link_that_is_left_if_its_table_has_that_place():
    sparse = {"sequence": {"drones": [14, 14], "density": [5.0, 6.5]}}
    run = SequenceRun(Scenario.model_validate(sparse), Streams(0, 1))
    network = run.network
    network.run_for(60.0)
    lost = min(filter(run.is_able, network.nodes.keys() - {0}))
    routers = physical_graph(network).hops_from([0], {lost}).keys() - {0}
    helper = max(
        routers, key=lambda node: network.location(lost).distance_m(network.location(node))
    )
    for other in network.nodes.keys() - {lost, helper}:
        network.air.cut(lost, other)
    assert helper not in network.air.in_range(lost)
    assert run.is_able(lost)
    table = network.nodes[lost].component.control.neighbours
    table.places.pop(helper, None)
    assert not run.could_know_a_link(lost)
    table.set_place(helper, network.location(helper), network.now_s())
    assert run.could_know_a_link(lost)


@pytest.mark.parametrize("number", range(8))
def test_drones_that_know_where_the_gateway_moved_are_not_left_behind(number):
    record = sequence(number, "gateway_moved", drones=(8, 30))
    assert {item.action for item in record.happened} == {"gateway_moved"}
    assert left_able(record) == 0
    assert left_placeless(record) == 0


@pytest.mark.parametrize(("restarted", "flights"), [(False, 1), (True, 0)])
def test_a_drone_that_was_restarted_is_not_connected_any_more_when_it_flies(restarted, flights):
    kinds = ["connected", *(["started"] if restarted else []), "flight decided"]
    events = [EventRecord(float(at_s), 6, kind) for at_s, kind in enumerate(kinds)]
    assert flew_connected(SimpleNamespace(events=events)) == flights


def test_the_same_seed_gives_the_same_run_in_an_experiment():
    loaded = load_experiment(SUITE, ["seeds=1", "base.sequence.drones=[8, 12]"])
    dense, _, _, sparse, _, _ = Plan(loaded)
    outcome = execute(dense.spec)
    assert (outcome.failure, outcome.values["harm"]) == ("", 0.0)
    assert execute(dense.spec).event_hash == outcome.event_hash
    assert execute(sparse.spec).event_hash != outcome.event_hash


def test_an_unknown_incident_is_refused(tmp_path):
    path = tmp_path / "x.yaml"
    path.write_text("name: x\nbase:\n  sequence: {incidents: [flood]}\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"line 3.*unknown incident flood: use cut_"):
        load_experiment(path)


@pytest.mark.parametrize("routing", ["beacon", "child_table_tree"])
@pytest.mark.parametrize("number", [0, 2, 4])
def test_mute_and_deaf_radios_cut_off_nobody_else_and_make_no_connected_drone_fly(number, routing):
    record = sequence(number, "goes_mute", "goes_deaf", routing=routing)
    assert {item.action for item in record.happened} & {"mute", "deaf"}
    assert flew_connected(record) == left_able(record) == 0
    broken = {node for item in record.happened for node in item.nodes}
    assert set(record.left_behind) <= broken  # nobody else is cut off for that


@pytest.mark.parametrize("keeps", [True, False])
def test_repairs_within_a_fence_never_leave_it_and_would_without_one(keeps):
    small = ["base.sequence.drones=[14, 20]", "sweep.repair=[thesis]"]
    spec = next(iter(Plan(load_experiment(SUITE.with_name("fences.yaml"), small)))).spec
    scenario = Scenario.model_validate_json(spec.scenario)
    total_s = 0.0
    for number in (3, 4, 5):
        run = SequenceRun(scenario, Streams(0, number))
        for node in run.network.nodes.values() if not keeps else ():
            node.drone.fence, node.drone.plan_flight = Fence(), FlightPath
        total_s += outside_s(run.run())
    assert (total_s == 0.0) is keeps
