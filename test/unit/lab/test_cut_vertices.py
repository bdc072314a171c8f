"""What `nearest` and `inward` fly for one dead node, beside what ideal information allows."""

from __future__ import annotations

from pathlib import Path

import pytest

from drone_mesh.drone.location import Location
from drone_mesh.lab.experiment import load_experiment
from drone_mesh.lab.ideal_plans import IDEAL_PLANS, cut_off
from drone_mesh.lab.plan import Plan
from drone_mesh.lab.worker import execute

RANGE_M = 9.0
LINE = [0.0, 8.0, 16.0, 24.0]  # x of the drones; node 0 is the gateway
SUITE = Path(__file__).resolve().parents[3] / "experiments" / "cut_vertices.yaml"


def survivors(line, dead):
    return {n: Location.from_vector((x, 0.0, 0.0)) for n, x in enumerate(line) if n != dead}


def flown(rule, line, dead=1):
    hole = Location.from_vector((line[dead], 0.0, 0.0))
    return IDEAL_PLANS[rule](survivors(line, dead), hole, RANGE_M)[1]


def test_the_drones_behind_the_dead_node_are_cut_off():
    assert cut_off(survivors(LINE, 1), RANGE_M) == {2, 3}


def test_the_nearest_takes_the_place_and_those_that_it_leaves_repeat_that():
    assert flown("nearest", LINE) == {2: pytest.approx(8.0), 3: pytest.approx(8.0)}


def test_if_all_may_move_inward_both_neighbours_go_to_half_the_range_and_others_follow():
    assert flown("inward_of_all", [-8.0, 0.0, 8.0, 16.0]) == {
        0: pytest.approx(3.5), 2: pytest.approx(3.5), 3: pytest.approx(2.5)
    }  # fmt: skip


def test_if_only_those_behind_move_inward_the_neighbour_goes_on_to_the_place():
    assert flown("inward", LINE) == {2: pytest.approx(8.0), 3: pytest.approx(7.0)}


def flown_in_draws_that_split(repair):
    """(with packets, with ideal information): metres of all drones, for each draw."""
    where = f"where=repair == '{repair}' and layout.drones == 20"
    runs, metres = iter(Plan(load_experiment(SUITE, ["seeds=20", where]))), []
    for mesh, ideal in zip(runs, runs):
        known = execute(ideal.spec).values
        if known["split"]:
            values = execute(mesh.spec).values
            assert (values["split"], values["healed"], known["healed"]) == (1.0, 1.0, 1.0)
            metres.append((values["distance_total_m"], known["distance_total_m"]))
    assert len(metres) >= 5
    return zip(*metres)


def test_over_packets_nearest_flies_exactly_as_far_as_with_ideal_information():
    packets, ideal = flown_in_draws_that_split("nearest")
    assert packets == pytest.approx(ideal, rel=1e-3)


def test_over_packets_inward_never_flies_farther_and_mostly_as_far():
    """Its drones notice the loss one after another; those that are connected by then stay."""
    packets, ideal = flown_in_draws_that_split("inward")
    assert all(a <= b * 1.001 for a, b in zip(packets, ideal))
    assert sum(a == pytest.approx(b, rel=1e-3) for a, b in zip(packets, ideal)) > len(ideal) / 2
