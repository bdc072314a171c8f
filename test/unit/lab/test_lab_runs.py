"""One run: layouts, faults and what is measured, under the virtual clock."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from drone_mesh.air.graph import Graph
from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.experiment import load_experiment
from drone_mesh.lab.metrics import METRICS, measure_all
from drone_mesh.lab.metrics.traffic import jain_index
from drone_mesh.lab.places import draw_places
from drone_mesh.lab.plan import Plan
from drone_mesh.lab.record import RunRecord
from drone_mesh.lab.scenario import Layout, Scenario, Streams
from drone_mesh.lab.scenario_network import obstacles_of, success
from drone_mesh.lab.simulation import Simulation
from drone_mesh.state.model import MeshStatus


def run(repetition: int = 0, seed: int = 1, **scenario: Any) -> RunRecord:
    content = {"layout": {"kind": "line", "drones": 5}, "duration_s": 40, **scenario}
    return Simulation(Scenario.model_validate(content), Streams(seed, repetition)).run()


def kill(at_s: float = 20, **pick: Any) -> dict[str, Any]:
    return {"at_s": at_s, "kill": pick}


def happened(record: RunRecord) -> list[tuple[float, str, tuple[int, ...]]]:
    return [tuple(item) for item in record.happened]


def test_the_last_layout_is_a_ring_of_all_routers_that_the_gateway_closes() -> None:
    flown = {"at_s": 15, "layouts": {"cases": [201], "apart_s": 5, "ring_m": 4}}
    record = run(
        layout={"kind": "line", "drones": 4}, routing="beacon", faults=[flown], duration_s=90
    )
    assert record.formations.missing == []
    places = record.end.places
    center = (places[0][0] + 4.0, places[0][1])
    assert [math.dist(places[node][:2], center) for node in range(4)] == pytest.approx([4.0] * 4)


# Layouts


def test_uniform_layouts_are_connected_and_as_dense_as_asked() -> None:
    degrees = []
    for repetition in range(10):
        layout = Layout(kind="uniform", drones=100, mean_degree=8)
        places = draw_places(layout, 9.0, Streams(1, repetition).generator("layout"))
        points = [(place.x, place.y) for place in places]
        near = {
            i: [j for j, q in enumerate(points) if j != i and math.dist(p, q) < 9.0]
            for i, p in enumerate(points)
        }
        assert Graph(near).is_connected()
        degrees.append(Graph(near).mean_degree())
    assert 7.0 < sum(degrees) / len(degrees) < 9.5  # connected draws are denser than all


def test_the_gateway_stands_in_the_middle_and_has_the_lowest_id() -> None:
    places = draw_places(Layout(drones=50), 9.0, Streams(1, 0).generator("layout"))
    assert [place.gateway for place in places] == [True] + [False] * 49
    middle_x = (min(p.x for p in places) + max(p.x for p in places)) / 2
    middle_y = (min(p.y for p in places) + max(p.y for p in places)) / 2
    distances = [math.dist((p.x, p.y), (middle_x, middle_y)) for p in places]
    assert distances[0] == min(distances)


@pytest.mark.parametrize(
    "layout",
    [
        {"kind": "grid", "drones": 10},
        {"kind": "line", "drones": 4},
        {"kind": "clusters", "drones": 30},
        {"kind": "casus", "case": 101},
        {"kind": "uniform", "drones": 20, "width_m": 20, "gateways": 2, "ids": "shuffled"},
    ],
)
def test_every_kind_of_layout_gives_ids_and_gateways(layout: dict[str, Any]) -> None:
    places = draw_places(Layout.model_validate(layout), 9.0, Streams(1, 0).generator("layout"))
    assert len({place.node_id for place in places}) == len(places)
    assert sum(place.gateway for place in places) == layout.get("gateways", 1)


def test_a_layout_that_is_never_connected_is_an_error() -> None:
    layout = Layout(kind="uniform", drones=3, width_m=5000.0)
    with pytest.raises(ConfigurationError, match="none of 2000 draws was connected"):
        draw_places(layout, 9.0, Streams(1, 0).generator("layout"))


# Faults


def test_a_killed_relay_splits_the_line_and_the_next_drone_repairs_it() -> None:
    record = run(faults=[kill(ids=[2])], duration_s=150)
    measured = measure_all(record)
    assert measured["split"] == 1
    assert measured["cut_off"] == 2
    assert measured["victims"] == 1
    assert measured["healed"] == 1
    assert measured["parts_before"] == measured["parts_after"] == 1
    assert measured["flights"] >= 1
    assert measured["distance_total_m"] >= 6
    phases = [measured[f"t_{phase}_s"] for phase in ("detect", "decide", "fly", "reroute")]
    assert sum(phases) == pytest.approx(measured["t_total_s"])
    assert phases[0] > 1  # the router behind it notices; the relay itself does not count


def test_a_run_that_ends_before_it_is_healed_has_no_time_to_heal() -> None:
    measured = measure_all(run(faults=[kill(ids=[2])], duration_s=30))
    assert measured["healed"] == 0
    assert math.isnan(measured["t_total_s"])
    assert measured["observed_s"] == 10
    assert measured["connected_share"] == pytest.approx(1 / 3)


def test_a_smaller_share_of_victims_is_a_part_of_a_larger_one() -> None:
    layout = {"kind": "grid", "drones": 26}
    victims = [
        set(run(layout=layout, duration_s=21, faults=[kill(share=share)]).happened[0].nodes)
        for share in (0.2, 0.4)
    ]
    assert len(victims[0]) == 5
    assert victims[0] < victims[1]
    assert 0 not in victims[1]  # gateways are spared


def test_other_repetitions_have_other_victims() -> None:
    layout = {"kind": "grid", "drones": 26}
    faults = [kill(number=5)]
    found = {
        run(r, layout=layout, duration_s=21, faults=faults).happened[0].nodes for r in range(4)
    }
    assert len(found) == 4


def test_a_cut_vertex_is_found_where_there_is_one() -> None:
    record = run(faults=[kill(number=1, pick="cut_vertex")])
    (victim,) = record.happened[0].nodes
    assert victim in (1, 2, 3)  # of 0 - 1 - 2 - 3 - 4
    ring = run(layout={"kind": "grid", "drones": 5, "columns": 2},
               faults=[kill(number=1, pick="cut_vertex")])  # fmt: skip
    assert ring.happened[0].nodes == ()


@pytest.mark.parametrize(
    ("pick", "victims"),
    [
        ({"number": 1, "pick": "busiest"}, (1,)),  # next to the gateway
        ({"pick": "circle", "center": [24, 0], "radius_m": 7}, (3, 4)),
    ],
)
def test_the_busiest_or_those_in_a_circle_are_picked(
    pick: dict[str, Any], victims: tuple[int, ...]
) -> None:
    assert tuple(sorted(run(faults=[kill(**pick)]).happened[0].nodes)) == victims


# Users' messages


def test_messages_of_a_load_count_from_its_time_on() -> None:
    record = run(faults=[{"at_s": 5, "load": {"per_s": 4, "counted_after_s": 10}}])
    values = measure_all(record)
    assert record.messages_since_s == 15.0
    assert {one.sender for one in record.messages} == {1, 2, 3, 4}
    assert values["taken_rate"] == pytest.approx(4.0, rel=0.2)
    assert values["arrival_rate"] == pytest.approx(values["taken_rate"], rel=0.05)
    assert min(values["data_delivered"], values["data_fairness"]) >= 0.95


def test_the_index_of_fairness_is_1_for_equal_shares_and_half_if_one_of_two_starves() -> None:
    assert jain_index([0.7, 0.7, 0.7]) == pytest.approx(1.0)
    assert jain_index([0.9, 0.0]) == pytest.approx(0.5)


@pytest.mark.slow
@pytest.mark.parametrize(("per_s", "least"), [(5.0, 0.9), (20.0, 0.6)])
def test_users_messages_do_not_keep_a_broken_mesh_broken(per_s: float, least: float) -> None:
    record = run(
        layout={"kind": "grid", "drones": 26, "columns": 5, "spacing_m": 6},
        radio={"kind": "shared"},
        faults=[
            {"when": "10 s after all connected", "load": {"per_s": per_s, "counted_after_s": 50}},
            {"when": "30 s after all connected", "kill": {"number": 1, "pick": "busiest"}},
        ],
        duration_s=140,
    )
    values = measure_all(record)
    shares = [one.share for one in record.samples if one.now_s >= record.messages_since_s]
    assert len(shares) > 40
    assert sum(shares) / len(shares) >= 0.98
    assert values["arrival_rate"] >= least * values["taken_rate"]


def test_killed_drones_can_be_revived() -> None:
    faults = [kill(ids=[4]), {"at_s": 30, "revive": {"ids": [4]}}]
    record = run(faults=faults)
    assert happened(record) == [(20, "kill", (4,)), (30, "revive", (4,))]
    assert record.samples[-1].served == {1, 2, 3, 4}


@pytest.mark.parametrize(
    ("fault", "cut_off_s"),
    [
        ({"gateway_off": {"for_s": 5}}, 17.0),
        ({"cut_link": {"between": [0, 1], "for_s": 10}}, 16.0),
        ({"loss": {"share": 1.0, "for_s": 20}}, 31.0),
    ],
)
def test_a_fault_for_a_while_cuts_all_off_until_its_end(
    fault: dict[str, Any], cut_off_s: float
) -> None:
    record = run(faults=[{"at_s": 15, **fault}], duration_s=75)
    shares = {sample.now_s: sample.share for sample in record.samples}
    assert shares[cut_off_s] == 0.0
    assert shares[75.0] == 1.0


@pytest.mark.parametrize("broken", ["mute", "deaf"])
@pytest.mark.parametrize("radio", ["disc", "shared", "chips"])
@pytest.mark.parametrize("routing", ["child_table_tree", "beacon"])
def test_a_radio_that_is_mute_or_deaf_for_a_while_is_served_by_nobody_meanwhile(
    broken: str, radio: str, routing: str
) -> None:
    fault = {"at_s": 15, broken: {"ids": [2], "for_s": 40}}
    layout, kind = {"kind": "line", "drones": 3}, {"kind": radio}
    record = run(
        faults=[fault], layout=layout, radio=kind, routing=routing, duration_s=100,
        grounded_share=1.0,
    )  # fmt: skip
    served = {sample.now_s: sample.served for sample in record.samples}
    assert served[14.0] == served[100.0] == {1, 2}
    assert all(served[at_s] == {1} for at_s in map(float, range(16, 55)))
    connected = {sample.now_s: sample.connected for sample in record.samples}
    assert connected[54.0] == {1}
    assert measure_all(record)["split"] == 1


@pytest.mark.parametrize("kind", ["disc", "shared", "chips"])
def test_with_asymmetry_some_links_work_one_way_only_and_no_router_counts_on_them(
    kind: str,
) -> None:
    content = {
        "layout": {"kind": "line", "drones": 6},
        "radio": {"kind": kind, "asymmetry_db": 8},
        "routing": "beacon",
        "grounded_share": 1.0,
        "duration_s": 30,
    }
    simulation = Simulation(Scenario.model_validate(content), Streams(1, 0))
    hears, record = simulation.network.air.hears, simulation.run()
    assert hears is not None
    links = [(node, node + 1) for node in range(5)]
    both = [link for link in links if hears(*link) and hears(*link[::-1])]
    one_way = [link for link in links if hears(*link) != hears(*link[::-1])]
    assert both
    assert one_way
    reached = record.end.graph.hops_from([0]).keys()
    assert record.samples[-1].connected == reached - {0}
    assert record.samples[-1].served == reached - {0}


def test_a_jammed_circle_loses_packets_only_while_it_is_jammed() -> None:
    faults = [{"at_s": 12, "jam": {"center": [24, 0], "radius_m": 4, "for_s": 10}}]
    simulation = Simulation(
        Scenario.model_validate(
            {"layout": {"kind": "line", "drones": 5}, "duration_s": 60, "faults": faults}
        ),
        Streams(1, 0),
    )
    record = simulation.run()
    assert simulation.impairments.lost > 0
    assert not simulation.impairments.jams
    assert record.samples[-1].share == 1.0
    assert measure_all(record)["split"] == 0.0  # no link is missing


def test_a_battery_ends_after_its_metres_or_its_minutes() -> None:
    order = {"at_s": 11, "order": {"id": 4, "to": [24, 3]}}
    record = run(faults=[{"at_s": 10, "battery": {"fly_m": 2}}, order])
    assert [(i.action, i.nodes) for i in record.happened][2:] == [("battery empty", (4,))]
    died_s = record.happened[2].at_s
    assert record.legs[0].metres_until(died_s) == pytest.approx(2.0)
    record = run(faults=[{"at_s": 6, "battery": {"live_min": 0.5}}], duration_s=40)
    assert {item.at_s for item in record.happened[1:]} == {36.0}
    assert record.samples[-1].alive == frozenset()


def test_churn_is_random_and_the_same_for_the_same_seed() -> None:
    faults = [{"at_s": 10, "churn": {"deaths_per_min": 20, "births_per_min": 10}}]
    layout = {"kind": "grid", "drones": 16}
    one, same, other = (run(r, layout=layout, faults=faults).happened for r in (0, 0, 1))
    assert one == same
    assert one != other
    assert {item.action for item in one} >= {"churn", "death"}


def test_orders_are_counted_with_those_that_arrived() -> None:
    faults = [{"at_s": 10, "order": {"every_s": 5, "for_s": 20}}]
    pair = {"kind": "line", "drones": 2}
    measured = measure_all(run(faults=faults, layout=pair))
    assert measured["orders"] == 4
    assert measured["order_delivery"] == 1.0
    assert measured["order_delay_ms"] == pytest.approx(2.0)  # one hop
    cut = {"at_s": 9, "cut_link": {"between": [0, 1]}}
    assert measure_all(run(faults=[cut, *faults], layout=pair))["order_delivery"] == 0.0


def test_random_orders_to_places_outside_the_fence_are_not_given() -> None:
    yard = {"polygon": [[-3, -3], [9, -3], [9, 3], [-3, 3]]}
    faults = [{"at_s": 10, "order": {"every_s": 1, "within_m": 8}}]
    pair = {"kind": "line", "drones": 2}
    measured = measure_all(run(faults=faults, layout=pair, fence={"areas": [yard]}))
    assert 0 < measured["orders"] < 29


def test_each_departure_is_that_of_one_order() -> None:
    away = {"between": [0, 1], "for_s": 5}
    faults = [
        {"at_s": 9, "cut_link": away},
        {"at_s": 10, "order": {"id": 1, "to": [6, 0]}},  # lost
        {"at_s": 15, "order": {"id": 1, "to": [6, 1]}},
    ]
    measured = measure_all(run(faults=faults, layout={"kind": "line", "drones": 2}, duration_s=40))
    assert measured["orders"] == 2
    assert measured["order_delivery"] == 0.5


def test_all_messages_of_several_bursts_count() -> None:
    bursts = [
        {"at_s": at_s, "send": {"ids": [1], "number": 10, "size": 16, "reliable": False}}
        for at_s in (20, 30)
    ]
    measured = measure_all(run(faults=bursts, layout={"kind": "line", "drones": 2}))
    assert measured["data_delivered"] == 1.0
    assert measured["taken_rate"] == measured["arrival_rate"] == pytest.approx(20 / 20)


def test_messages_that_a_queue_has_no_room_for_were_not_offered() -> None:
    burst = {"at_s": 20, "send": {"ids": [1], "number": 1000, "size": 16}}
    record = run(faults=[burst], layout={"kind": "line", "drones": 2})
    assert 0 < len(record.messages) < 1000


def test_no_time_gives_no_rate_of_messages() -> None:
    pair = {"kind": "line", "drones": 2}
    itself = {"at_s": 20, "send": {"ids": [0], "number": 2, "size": 16}}
    assert math.isnan(measure_all(run(faults=[itself], layout=pair))["data_rate"])
    late = {"when": "1 s after all connected", "load": {"per_s": 5, "counted_after_s": 60}}
    measured = measure_all(run(faults=[late], layout=pair))
    assert math.isnan(measured["taken_rate"])
    assert math.isnan(measured["arrival_rate"])


def test_a_jammer_that_never_sends_disturbs_nobody() -> None:
    jam = {"at_s": 5, "jam": {"center": [0, 0], "radius_m": 9, "loss": 0}}
    jammed, quiet = (run(radio={"kind": "shared"}, faults=faults) for faults in ([jam], []))
    assert jammed.air == quiet.air


def test_a_load_waits_for_routers_that_live() -> None:
    faults = [{"at_s": 20, "load": {"per_s": 5}}, kill(25, share=1.0)]
    record = run(faults=faults, layout={"kind": "line", "drones": 3})
    assert 0 < len(record.messages) < 60


def test_links_are_watched_only_in_a_run_with_motion_churn_or_probes() -> None:
    names = list(METRICS)
    watched = names[names.index("link_changes") : names.index("unconnected_p99_s") + 1]
    quiet = measure_all(run(duration_s=8))
    assert [name for name in watched if not math.isnan(quiet[name])] == []
    assert measure_all(run(duration_s=8, probes={"per_s": 1, "from_s": 4}))["reachable"] == 1.0


def test_links_of_a_mesh_without_probes_are_watched_from_the_start() -> None:
    moving = {"kind": "random_waypoint", "speed_m_s": 2.0}
    measured = measure_all(run(mobility=moving, duration_s=15))
    assert measured["link_changes"] > 0


def test_drones_fly_at_the_speed_of_the_experiment_with_packets_too() -> None:
    order = {"at_s": 11, "order": {"id": 4, "to": [24, 6]}}
    wind = {"at_s": 5, "wind": {"speed_factor": 0.5}}
    assert run(speed_m_s=1.0, faults=[order]).legs[0].path.duration_s == pytest.approx(6.0)
    assert run(speed_m_s=1.0, faults=[wind, order]).legs[0].path.duration_s == pytest.approx(12.0)


def test_wind_slows_the_flights_that_begin_in_it() -> None:
    order = {"at_s": 11, "order": {"id": 4, "to": [24, 6]}}
    calm = run(faults=[order])
    windy = run(faults=[{"at_s": 5, "wind": {"speed_factor": 0.5}}, order])
    assert calm.legs[0].path.duration_s == pytest.approx(3.0)
    assert windy.legs[0].path.duration_s == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("when", "at_s"),
    [
        ("when all connected", 1.0),
        ("7 s after all connected", 8.0),
        ("2 s after the first flight", 22.0),
    ],
)
def test_a_condition_starts_a_fault(when: str, at_s: float) -> None:
    order = {"at_s": 20, "order": {"id": 4, "to": [24, 3]}}
    record = run(faults=[order, {"when": when, "revive": {"number": 1}}], sample_s=0.5)
    (time,) = [item.at_s for item in record.happened if item.action == "revive"]
    assert time == pytest.approx(at_s, abs=0.5)


@pytest.mark.parametrize(("victim", "others_lose"), [(4, False), (2, True)])
def test_the_first_loss_is_not_that_of_the_drone_that_was_killed(
    victim: int, others_lose: bool
) -> None:
    then = {"when": "the first loss", "wind": {"speed_factor": 0.5}}
    winds = [
        at_s for at_s, what, _ in happened(run(faults=[kill(ids=[victim]), then])) if what == "wind"
    ]
    assert len(winds) == others_lose
    assert all(at_s > 21.0 for at_s in winds)


def test_the_shared_channel_counts_its_airtime() -> None:
    layout = {"kind": "grid", "drones": 9}
    measured = measure_all(run(layout=layout, radio={"kind": "shared", "rate": "1M"}))
    assert measured["connected_share"] == 1.0
    assert 0 < measured["air_load"] < 0.5
    assert measured["own_present"] > 0
    assert math.isnan(measure_all(run())["air_load"])


# Common random numbers


def test_losses_of_a_link_do_not_depend_on_what_others_send() -> None:
    """The fate of the n-th packet of a link is the same, whatever else is in the air."""

    def fates(drones: int) -> list[bool]:
        content = {"layout": {"kind": "line", "drones": drones}, "radio": {"loss": 0.3}}
        simulation = Simulation(Scenario.model_validate(content), Streams(1, 0))
        return [simulation.impairments._is_lost(0, 1) for _ in range(50)]

    assert fates(3) == fates(6)
    assert 5 < sum(fates(3)) < 25


def test_another_technique_changes_neither_layout_nor_victims() -> None:
    records = [
        run(layout={"drones": 30}, faults=[kill(share=0.2)], timing=timing, duration_s=30)
        for timing in ({"check_period_s": 10}, {"check_period_s": 2})
    ]
    assert records[0].start.places == records[1].start.places
    assert records[0].happened == records[1].happened
    assert records[0].events != records[1].events


# Metrics


def test_every_metric_has_a_definition_and_a_finite_value_or_none() -> None:
    measured = measure_all(run())
    assert set(measured) == set(METRICS)
    assert all(metric.definition for metric in METRICS.values())
    assert not any(math.isinf(value) for value in measured.values())


def test_a_quiet_line_measures_as_it_stands() -> None:
    measured = measure_all(run())
    assert measured["healed"] == 1
    assert measured["hops_mean_after"] == 2.5
    assert measured["hops_max_after"] == 4
    assert measured["stretch"] == 1.0
    assert measured["parts_after"] == 1
    assert measured["degree_after"] == pytest.approx(8 / 5)
    assert measured["coverage"] == 1.0
    assert measured["flights"] == measured["collisions"] == measured["stacked"] == 0
    assert math.isnan(measured["min_distance_m"])


def test_a_drone_that_lands_on_another_is_a_collision_and_stacked() -> None:
    order = {"at_s": 15, "order": {"id": 4, "to": [18, 0]}}
    measured = measure_all(run(faults=[order]))
    assert measured["collisions"] == 1
    assert measured["stacked"] == 2
    assert measured["min_distance_m"] < 0.1
    assert measured["displacement_max_m"] == pytest.approx(6)
    assert measured["displaced"] == 1


def test_a_stale_route_is_an_outage_even_before_it_is_noticed() -> None:
    record = run(faults=[kill(ids=[1])], duration_s=22)
    (first, *_) = record.gaps()
    assert first.lost_s == 20.0
    assert {gap.node for gap in record.gaps()} == {2, 3, 4}


# Obstacles

HOUSE = {"center": [9, 0, 5], "size": [2, 6, 10]}


def test_a_wall_between_two_drones_ends_their_link_and_without_it_the_run_is_the_same() -> None:
    def events(**obstacles: Any) -> list[str]:
        content = {
            "layout": {"kind": "line", "drones": 3}, "duration_s": 30, "obstacles": obstacles,
        }  # fmt: skip
        simulation = Simulation(Scenario.model_validate(content), Streams(1, 0))
        record = simulation.run()
        return [simulation.event_hash(), sorted(record.samples[-1].served)]

    assert events(boxes=[HOUSE])[1] == [1]
    assert events(boxes=[{**HOUSE, "center": [9, 50, 5]}]) == events()


def test_the_states_of_a_run_show_its_boxes() -> None:
    content = {
        "layout": {"kind": "line", "drones": 3}, "duration_s": 2, "obstacles": {"boxes": [HOUSE]},
    }  # fmt: skip
    states: list[MeshStatus] = []
    Simulation(Scenario.model_validate(content), Streams(1, 0)).run(states.append)
    (box,) = states[0].obstacles
    assert (list(box.center), list(box.size)) == (HOUSE["center"], HOUSE["size"])


def test_drones_and_repairs_keep_out_of_the_boxes() -> None:
    boxes = [
        {"center": [x, y, 4], "size": [6, 6, 8]} for x in (8, 24, 40) for y in (8, 24, 40)
    ]  # fmt: skip
    content = {
        "layout": {"drones": 40, "width_m": 48, "require": "nothing"},
        "obstacles": {"boxes": boxes}, "duration_s": 120, "faults": [kill(share=0.3)],
        "timing": {"connection_lost_after_s": 5},
    }  # fmt: skip
    flown = 0
    for repetition in range(4):
        simulation = Simulation(Scenario.model_validate(content), Streams(1, repetition))
        record = simulation.run()
        free = obstacles_of(simulation.scenario).is_free
        for leg in record.legs:
            flown += 1
            for share in range(51):
                at_s = leg.path.start_s + leg.path.duration_s * share / 50
                assert free(leg.path.position_at(at_s))
        assert all(free(place) for place in record.end.places.values())
    assert flown > 3


def test_fading_loses_packets_of_weak_links_more_often() -> None:
    def lost(spacing_m: float) -> float:
        content = {
            "layout": {"kind": "line", "drones": 2, "spacing_m": spacing_m},
            "obstacles": {"fading": "rayleigh"}, "duration_s": 200,
        }  # fmt: skip
        simulation = Simulation(Scenario.model_validate(content), Streams(1, 0))
        record = simulation.run()
        return simulation.impairments.lost / measure_all(record)["packets"]

    assert lost(0.9) < 0.05  # a margin of 20 dB: 1 %
    assert 0.5 < lost(8.9) < 0.75  # no margin: 63 %


@pytest.mark.parametrize(
    ("margin_db", "fading", "k_db", "expected"),
    [
        (0, "rayleigh", 0, 0.368), (10, "rayleigh", 0, 0.904), (-3, "rayleigh", 0, 0.136),
        (0, "rician", 6, 0.436), (6, "rician", 6, 0.931), (3, "rician", 10, 0.900),
        (-math.inf, "rician", 6, 0.0), (5, "none", 0, 1.0),
    ],
)  # fmt: skip
def test_packets_arrive_as_often_as_the_fading_says(
    margin_db: float, fading: str, k_db: float, expected: float
) -> None:
    assert success(margin_db, fading, k_db) == pytest.approx(expected, abs=0.002)


def test_the_fence_of_an_experiment_may_be_a_plan_of_a_ground_station(tmp_path):
    corners = [[52.0, 5.0], [52.001, 5.0], [52.001, 5.001]]
    polygon = {"polygon": corners, "inclusion": True}
    fence = {"version": 2, "polygons": [polygon], "circles": []}
    plan = {"fileType": "Plan", "geoFence": fence}
    (tmp_path / "field.plan").write_text(json.dumps(plan), "utf-8")
    path = tmp_path / "x.yaml"
    path.write_text('name: x\nbase:\n  fence: {path: field.plan, origin: "52,5,0"}\n', "utf-8")
    entry = next(iter(Plan(load_experiment(path))))
    fence = Scenario.model_validate_json(entry.spec.scenario).fence.fence()
    assert fence.why_not((10.0, 50.0, 0.0)) == ""
    assert fence.why_not((50.0, 10.0, 0.0)) == "outside fence polygon 1"
    path.write_text("name: x\nbase:\n  fence: {path: field.plan}\n", "utf-8")
    with pytest.raises(ConfigurationError, match=r"line 3: fence.path: .*needs an origin"):
        load_experiment(path)
