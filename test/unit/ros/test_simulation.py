"""What a simulation tells other processes: its run, its drones, and which host runs which node."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from drone_mesh.drone.roles import Role
from drone_mesh.ros.graph.simulation import (
    PresentDrones,
    is_left_behind,
    new_run,
    run_headers,
    run_of,
)

G, R = Role.GATEWAY, Role.ROUTER


def published(**headers):
    return SimpleNamespace(_connection_header={"callerid": "/mesh_host_0_4", **headers})


def test_each_world_has_a_run_of_its_own_which_its_topics_carry():
    runs = {new_run() for _ in range(100)}
    assert len(runs) == 100
    for run in runs:
        assert run_of(published(**run_headers(run))) == run


@pytest.mark.parametrize(
    ("headers", "is_old"), [({"run": "b"}, False), ({"run": "a"}, True), ({}, False)]
)
def test_a_goal_of_another_run_is_left_behind_and_that_of_a_stranger_is_not(headers, is_old):
    assert is_left_behind(published(**headers), "b") is is_old


def test_the_world_of_another_program_names_no_run():
    assert run_headers("") == {}
    assert run_of(published()) == ""


def test_drones_are_the_same_after_a_round_trip_through_a_parameter():
    drones = PresentDrones({0: R, 3: G, 7: R, 9: G}, {7: "/mesh_host_1", 9: ""})
    parameter = drones.to_parameter()
    assert parameter == {
        "gateways": [3, 9],
        "routers": [0, 7],
        "added": [7, 9],
        "hosts": ["/mesh_host_1", ""],
    }
    assert PresentDrones.from_parameter(parameter) == drones


def test_a_host_runs_its_share_of_the_drones_that_are_left():
    drones = PresentDrones({0: G, 2: R, 3: R}, {})
    assert drones.of_host("/a", range(2)) == {0: G}
    assert drones.of_host("/b", range(2, 4)) == {2: R, 3: R}


def test_a_drone_that_was_added_belongs_to_the_host_that_was_chosen():
    drones = PresentDrones({0: G, 1: R, 8: R}, {1: "/b", 8: "/a"})  # 1 came back
    assert drones.of_host("/a", range(2)) == {0: G, 8: R}
    assert drones.of_host("/b", range(2, 4)) == {1: R}


def test_a_drone_that_was_added_without_a_host_goes_to_the_host_that_is_started_for_it():
    drones = PresentDrones({0: G, 8: R}, {8: ""})
    assert drones.of_host("/a", range(2)) == {0: G}
    assert drones.of_host("/mesh_host_8_8", range(8, 9)) == {8: R}
