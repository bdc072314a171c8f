"""A mesh that hovers for longer than its batteries last, because spares relieve it."""

from __future__ import annotations

from typing import Any, Sequence

import pytest

from drone_mesh.drone.fleet import MAX_DRONES
from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.endurance import fewest_spares
from drone_mesh.lab.metrics import measure_all
from drone_mesh.lab.scenario import Endurance, Scenario, Streams
from drone_mesh.lab.simulation import Simulation


def run(
    duration_s: float,
    obstacles: dict[str, Any] | None = None,
    faults: Sequence[dict[str, Any]] = (),
    **endurance: Any,
) -> dict[str, float]:
    scenario = Scenario(
        obstacles=obstacles or {},
        faults=list(faults),
        layout={"kind": "line", "drones": 5, "spacing_m": 6.0},
        routing="beacon",
        endurance={"hover_min": 4.0, "spares": 0.5, "swap_s": 20.0, **endurance},
        duration_s=duration_s,
    )
    return measure_all(Simulation(scenario, Streams(1, 0)).run())


def test_without_relief_the_mesh_goes_home_and_with_spares_its_posts_stay_held():
    alone = run(300.0, relief="none")
    assert 180.0 < alone["lived_s"] < 240.0  # at 20 % of 4 minutes they go
    assert (alone["reliefs"], alone["fell"], alone["landed_astray"]) == (0, 0, 0)
    held = run(600.0)
    assert held["posts_held"] > 0.99
    assert held["post_gap_s"] <= 10.0
    assert held["fell"] == held["landed_astray"] == held["collisions"] == 0
    assert held["least_charge"] > 20.0
    assert held["min_distance_m"] > 0.99
    assert held["reliefs"] > 10


@pytest.mark.parametrize("fault", ["mute", "deaf"])
def test_a_drone_that_is_mute_or_deaf_is_replaced_in_the_time_to_miss_it_and_of_a_flight(fault):
    broken = {"at_s": 20.0, fault: {"ids": [2], "for_s": 40.0}}
    seen = run(70.0, faults=[broken], hover_min=20.0)
    assert 5.0 < seen["post_gap_s"] <= 12.0  # five to miss it, six of flight, and a sample
    assert seen["min_distance_m"] > 0.99


def test_drones_whose_way_home_is_closed_land_where_they_are():
    shed = {"boxes": [{"center": [0.0, -30.0, 2.5], "size": [20.0, 20.0, 5.0]}]}
    seen = run(300.0, shed, relief="none", pads=[[0.0, -30.0]])
    assert (seen["fell"], seen["landed_astray"]) == (0, 4)


def test_fewer_spares_than_the_bound_do_not_hold_the_posts():
    part = Endurance(hover_min=20.0, swap_s=60.0, pads=[[0.0, 0.0]], at_once=4)
    assert fewest_spares(part, 50, 10.0) == 5  # 9.3 %
    assert fewest_spares(part, 50, 60.0) == 12
    assert fewest_spares(part, 61, 10.0) == MAX_DRONES  # four crews: 60 batteries in 911 s
    assert fewest_spares(part, 5, 500.0) == MAX_DRONES  # nothing is left to serve


def test_more_drones_than_ids_are_refused():
    scenario = Scenario(layout={"drones": 230}, endurance={"spares": 0.2})
    with pytest.raises(ConfigurationError, match="endurance: 276 drones are too many"):
        Simulation(scenario, Streams(1, 0))
    with pytest.raises(ValueError, match="its drones hover"):
        Scenario(model="ideal", endurance={})
