"""Pace: simulated against wall time, both given by the test."""

from __future__ import annotations

import pytest

from drone_mesh.world.pace import Pace


def run(pace, simulated_s, wall_s, until_s, step_s=0.01, busy_s=0.0):
    """Step a world that takes `busy_s` for a step; returns the wall time at `until_s`."""
    while simulated_s < until_s - 1e-9:
        wall_s += pace.wait_s(simulated_s, wall_s)
        wall_s += busy_s
        simulated_s += step_s
    return wall_s


@pytest.mark.parametrize(("factor", "wall_s"), [(1.0, 10.0), (4.0, 2.5), (0.5, 20.0)])
def test_simulated_time_goes_at_the_factor(factor, wall_s):
    assert run(Pace(factor), 0.0, 1000.0, until_s=10.0) == pytest.approx(1000.0 + wall_s, abs=0.03)


def test_factor_zero_never_waits():
    assert Pace(0.0).wait_s(100.0, 0.0) == 0.0


def test_a_short_delay_is_made_up_for():
    pace = Pace(1.0)
    wall_s = run(pace, 0.0, 0.0, until_s=1.0) + 0.3
    assert run(pace, 1.0, wall_s, until_s=2.0) == pytest.approx(2.0, abs=0.02)


def test_a_long_delay_is_not_made_up_for():
    pace = Pace(1.0)
    wall_s = run(pace, 0.0, 0.0, until_s=1.0) + 5.0
    assert run(pace, 1.0, wall_s, until_s=2.0) == pytest.approx(wall_s + 1.0, abs=0.03)


def test_a_world_that_is_too_slow_runs_without_waiting():
    assert run(Pace(1.0), 0.0, 0.0, until_s=1.0, busy_s=0.02) == pytest.approx(2.0, abs=0.03)


def test_a_new_factor_counts_from_where_it_was_set():
    pace = Pace(1.0)
    wall_s = run(pace, 0.0, 0.0, until_s=1.0) + 60.0
    pace.restart(2.0)
    assert run(pace, 1.0, wall_s, until_s=3.0) == pytest.approx(wall_s + 1.0, abs=0.02)


def test_the_factor_is_measured_at_one_speed_for_long_enough():
    pace = Pace(1.0)
    assert pace.achieved(0.0, 100.0) is None
    assert pace.achieved(9.0, 109.0) is None
    pace.restart(5.0)  # what was before does not count
    assert pace.achieved(10.0, 110.0) is None
    assert pace.achieved(55.0, 119.0) is None
    assert pace.achieved(58.0, 120.0) == 4.8
    assert pace.achieved(63.0, 121.0) is None
    assert pace.achieved(108.0, 130.0) == 5.0
