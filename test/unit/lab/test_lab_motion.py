"""Moving drones in an experiment: the motion, the messages that measure it, and the metrics."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from drone_mesh.air.graph import Graph
from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.experiment import load_experiment
from drone_mesh.lab.metrics import measure_all
from drone_mesh.lab.network_sample import LinkWatch, NetworkSample
from drone_mesh.lab.record import RunRecord
from drone_mesh.lab.scenario import Scenario, Streams
from drone_mesh.lab.simulation import Simulation


def simulation(repetition: int = 0, **scenario: Any) -> Simulation:
    content = {
        "layout": {"kind": "uniform", "drones": 12, "mean_degree": 6},
        "mobility": {"kind": "random_waypoint", "speed_m_s": 0.5},
        "probes": {"per_s": 1.0, "from_s": 5.0},
        "duration_s": 40,
        **scenario,
    }
    return Simulation(Scenario.model_validate(content), Streams(1, repetition))


def run(**scenario: Any) -> RunRecord:
    return simulation(**scenario).run()


def places(record: RunRecord) -> list[tuple[float, float, float]]:
    return [record.end.places[node] for node in sorted(record.end.places)]


def test_routers_move_and_the_gateway_stands() -> None:
    record = run()
    moved = {n for n, place in record.end.places.items() if place != record.start.places[n]}
    assert moved == set(range(1, 12))


def test_the_same_seed_gives_the_same_motion_in_every_cell() -> None:
    one = run(probes={"per_s": 0.0})
    other = run(routing="flooding", radio={"kind": "shared", "rate": "1M"})
    assert places(one) == places(other) != places(simulation(1).run())


def test_told_drones_get_their_legs_as_orders() -> None:
    record = run(
        mobility={"kind": "random_waypoint", "told": True, "steady": False},
        layout={"kind": "grid", "drones": 9, "spacing_m": 3},
        duration_s=60,
    )
    assert {order.node for order in record.orders} >= set(range(1, 9))
    values = measure_all(record)
    assert values["order_delivery"] > 0.5
    assert {leg.node for leg in record.legs} <= set(range(1, 9))


def test_a_mesh_at_rest_delivers_every_probe_and_its_links_live() -> None:
    values = measure_all(run(mobility={"kind": "none"}))
    assert values["pdr_up"] == values["pdr_down"] == values["pdr_echo"] == 1.0
    assert values["reachable"] == 1.0
    assert values["served"] > 0.99
    assert values["link_changes"] == 0.0
    assert math.isnan(values["link_life_s"])
    assert 0.0 < values["delay_ms"] < 100.0
    assert values["detours"] >= 0.0


def test_probes_between_any_two_nodes_arrive_at_rest_and_others_are_not_sent() -> None:
    record = run(mobility={"kind": "none"}, probes={"between": "any", "per_s": 2, "from_s": 20})
    values = measure_all(record)
    assert values["pdr_any"] == 1.0
    assert 0.0 < values["delay_ms"] < 100.0
    assert math.isnan(values["pdr_up"])
    assert {probe.kind for probe in record.probes} == {"any"}
    assert len({probe.node for probe in record.probes}) > 6


def test_reliable_probes_are_sent_again_until_they_arrive() -> None:
    """Radio 1 hears nothing for six seconds."""
    shares = [
        measure_all(
            run(
                layout={"kind": "line", "drones": 3, "spacing_m": 6},
                mobility={"kind": "none"},
                faults=[{"at_s": 20, "deaf": {"ids": [1], "for_s": 6}}],
                probes={"per_s": 2, "from_s": 19, "within_s": 20, "reliable": reliable},
                duration_s=60,
            )
        )["pdr_down"]
        for reliable in (False, True)
    ]
    assert shares[0] < shares[1] == 1.0


def test_probes_of_cut_off_drones_do_not_count() -> None:
    """Drones 2 to 4 lose their only relay; the others still get every message."""
    layout = {"kind": "line", "drones": 5, "spacing_m": 6}
    values = run(
        layout=layout,
        mobility={"kind": "none"},
        repair="stay",
        faults=[{"at_s": 2, "kill": {"ids": [2]}}],
        probes={"per_s": 2.0, "from_s": 3.0},
    )
    assert {probe.node for probe in values.probes} == {1}
    assert measure_all(values)["reachable"] == pytest.approx(1 / 3)


def test_a_message_that_comes_too_late_is_lost() -> None:
    in_time = run(mobility={"kind": "none"}, radio={"delay_s": 0.3})
    late = run(
        mobility={"kind": "none"},
        radio={"delay_s": 0.3},
        probes={"per_s": 1.0, "from_s": 5.0, "within_s": 0.2},
    )
    assert measure_all(in_time)["pdr_up"] > 0.9
    assert measure_all(late)["pdr_up"] == 0.0


def test_frames_are_counted_by_what_they_carry() -> None:
    shared = {"kind": "shared", "rate": "250k"}
    quiet = measure_all(run(radio=shared, probes={"per_s": 0.0}))
    busy = measure_all(run(radio=shared, probes={"per_s": 5.0, "from_s": 5.0}))
    assert quiet["frame_rate"] == quiet["control_frame_rate"] > 0.1
    assert busy["frame_rate"] > busy["control_frame_rate"] + 1.0
    assert math.isnan(measure_all(run())["frame_rate"])


def test_links_that_come_and_go_are_counted_per_drone_and_minute() -> None:
    watch = LinkWatch(from_s=10.0)
    routers = frozenset({1, 2})

    def look(now_s: float, near: dict[int, list[int]], served: set[int]) -> None:
        sample = NetworkSample(now_s, routers, routers, frozenset(served))
        watch.look(sample, Graph(near), [0])

    look(5.0, {0: [1, 2], 1: [0], 2: [0]}, {1, 2})  # before it begins
    look(10.0, {0: [1], 1: [0, 2], 2: [1]}, {1, 2})
    look(20.0, {0: [1], 1: [0], 2: []}, {1})
    look(30.0, {0: [1, 2], 1: [0], 2: [0]}, {1})
    assert (watch.appeared, watch.disappeared, watch.link_s) == (1, 1, 30.0)
    assert (watch.drone_s, watch.router_s, watch.reachable_s) == (60.0, 40.0, 30.0)
    assert watch.served_s == 20.0


def test_a_trace_is_read_beside_the_experiment(tmp_path: Path) -> None:
    (tmp_path / "flight.csv").write_text(
        "t,id,x,y,z\n0,2,1,0,0\n10,2,4,0,0\n0,0,9,9,0\n", encoding="utf-8"
    )
    file = tmp_path / "motion.yaml"
    file.write_text(
        "name: motion\nbase:\n  layout: {kind: line, drones: 3}\n  duration_s: 12\n"
        "  mobility: {kind: trace, path: flight.csv}\n",
        encoding="utf-8",
    )
    (cell,) = load_experiment(file).cells
    record = Simulation(cell.scenario, Streams(1, 0)).run()
    assert record.end.places[2] == pytest.approx((4.0, 0.0, 0.0))
    assert record.end.places[0] == pytest.approx((9.0, 9.0, 0.0))  # the gateway
    (tmp_path / "flight.csv").write_text("t,id,x,y,z\n0,3,1,0,0\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"line 5: .*drone 3; the layout has 0\.\.2"):
        load_experiment(file)
    (tmp_path / "flight.csv").write_text("t,id,x,y,z\n12,2,1,0,0\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"mobility\.path: begins at 12 s, after the end"):
        load_experiment(file)
    (tmp_path / "flight.csv").write_text("t,id\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"mobility\.path: trace .*flight\.csv"):
        load_experiment(file)


@pytest.mark.parametrize(
    ("mobility", "words"),
    [
        ({"kind": "trace"}, "needs path"),
        ({"kind": "patrol", "area": [0.0, 0.0, 0.0, 5.0]}, "above 0"),
        ({"kind": "random_waypoint", "speed_m_s": [2.0, 1.0]}, "lower first"),
        ({"kind": "hover"}, "random_waypoint"),
        ({"speed_m_s": 1.0}, "nothing moves without a kind"),
        (
            {"kind": "patrol", "path": "ok.csv"},
            "mobility patrol has no path: it has area, gateways",
        ),
        ({"kind": "trace", "path": "ok.csv", "gateways": True}, "mobility trace has no gateways"),
        ({"kind": "random_waypoint", "radius_m": 3.0}, "mobility random_waypoint has no radius_m"),
        ({"kind": "oval", "speed_m_s": [1.0, 2.0, 3.0]}, "give one speed above 0, or two"),
        ({"kind": "oval", "speed_m_s": 0.0}, "give one speed above 0, or two"),
        ({"kind": "oval", "speed_m_s": [1.0, "fast"]}, "give one speed above 0, or two"),
        (
            {"kind": "group", "climbs": True, "height_m": 5.0, "cruise_height_m": 3.0},
            "cruise_height_m 3.0: must be from height_m, 5,",
        ),
    ],
)
def test_motion_that_cannot_be_is_refused(mobility: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Scenario.model_validate({"mobility": mobility})


def test_without_packets_only_repairs_move_drones() -> None:
    with pytest.raises(ValueError, match="model ideal: only repairs move drones there"):
        Scenario.model_validate({"model": "ideal", "mobility": {"kind": "oval"}})


def test_an_axis_may_compare_motion_with_rest() -> None:
    numbers = {"speed_m_s": 0.5, "radius_m": 2.0}
    for kind in ("none", "oval"):
        Scenario.model_validate({"mobility": {"kind": kind, **numbers}})


def test_many_drones_at_once_are_switched_off_and_on_again_each_minute() -> None:
    record = run(
        mobility={"kind": "none"},
        probes={"from_s": 5.0},
        key=True,
        faults=[{"at_s": 10, "churn": {"switched": 4, "every_s": 10}}],
    )
    batches = {at_s: 0 for at_s in (10.0, 20.0, 30.0)}
    off: set[int] = set()
    for item in record.happened:
        if item.action in ("death", "birth"):
            assert off.isdisjoint(item.nodes) == (item.action == "death" or not item.nodes)
            off ^= set(item.nodes)
            batches[item.at_s] += len(item.nodes)
    assert set(batches.values()) == {4}


def test_lapses_are_the_times_in_which_a_router_has_a_path_and_is_not_served_or_connected() -> None:
    watch = LinkWatch(0.0)
    line = Graph({0: [1], 1: [0, 2], 2: [1]})
    nobody: frozenset[int] = frozenset()
    both, first = frozenset({1, 2}), frozenset({1})
    served = (both, first, first, both, nobody, both)
    connected = (both, both, first, both, nobody, first)
    for now_s, (states, served_now) in enumerate(zip(connected, served)):
        watch.look(NetworkSample(float(now_s), both, states, served_now), line, [0])
    watch.look(NetworkSample(6.0, both, both, both), line, [0])
    assert sorted(watch.service.lapses_s(6.0)) == [1.0, 1.0, 2.0]
    assert watch.service.shares == [0.5, 0.5, 1.0, 0.0, 1.0, 1.0]
    assert sorted(watch.connection.lapses_s(6.0)) == [1.0, 1.0, 2.0]
    assert watch.connection.shares == [1.0, 0.5, 1.0, 0.0, 0.5, 1.0]


def test_a_lapse_that_never_ends_counts_up_to_the_end() -> None:
    watch = LinkWatch(0.0)
    for now_s in range(5):
        alone, nobody = frozenset({1}), frozenset()
        watch.look(NetworkSample(float(now_s), alone, nobody, nobody), Graph({0: [1], 1: [0]}), [0])
    assert watch.service.lapses_s(9.0) == watch.connection.lapses_s(9.0) == [8.0]


CHANNEL = {"kind": "shared", "rate": "1M"}
AT_REST: dict[str, Any] = {"kind": "none"}


def tries_per_packet(**scenario: Any) -> float:
    line = {"kind": "line", "drones": 3}
    record = run(
        layout=line, radio=CHANNEL, mobility=AT_REST, routing="beacon", duration_s=20, **scenario
    )
    assert record.air is not None
    return record.air.tries / record.air.sent


def test_links_of_the_shared_channel_fade() -> None:
    assert tries_per_packet(obstacles={"fading": "rayleigh"}) > 1.2 * tries_per_packet()


def test_boxes_stand_between_radios_of_the_shared_channel() -> None:
    wall = {"boxes": [{"center": [3, 0, 50], "size": [1, 200, 100]}]}
    line = {"kind": "line", "drones": 2}
    record = run(layout=line, radio=CHANNEL, mobility=AT_REST, duration_s=10, obstacles=wall)
    assert record.samples[-1].served == set()


def test_a_jammer_of_the_shared_channel_cuts_its_surroundings_for_its_time() -> None:
    line = {"kind": "line", "drones": 4}
    jam = {"at_s": 10, "jam": {"center": [18, 0], "radius_m": 4, "for_s": 15}}
    record = run(
        layout=line, radio=CHANNEL, mobility=AT_REST, routing="beacon", faults=[jam], duration_s=35
    )
    served = {round(sample.now_s): sample.served for sample in record.samples}
    assert served[9] == served[34] == {1, 2, 3}
    assert 3 not in served[24]
    assert 1 in served[24]
