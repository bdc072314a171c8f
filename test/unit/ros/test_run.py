"""What an earlier run of a simulation left behind."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from drone_mesh.ros.graph.run import is_left_behind, new_run, run_headers, run_of


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
