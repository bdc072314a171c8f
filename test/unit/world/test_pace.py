"""When a step of the world is due: by the wall clock, and by the packets under way."""

from __future__ import annotations

import pytest

from drone_mesh.world.pace import PATIENCE_S, Pace, UnderWay


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


@pytest.fixture
def under_way():
    return UnderWay()


def test_it_waits_for_packets_that_are_processed_one_after_the_other(under_way):
    assert under_way.is_none(0, True, 0.0)
    counts = [3, 2, 4, 1]  # on a slow machine, each just within the patience
    assert not any(
        under_way.is_none(n, True, i * 0.9 * PATIENCE_S) for i, n in enumerate(counts, 1)
    )
    assert under_way.is_none(0, True, 5.0 * PATIENCE_S)


def test_a_packet_that_never_arrives_is_waited_for_once(under_way):
    assert not under_way.is_none(1, True, 0.0)
    assert not under_way.is_none(1, True, PATIENCE_S)
    assert under_way.is_none(1, True, PATIENCE_S + 0.1)
    assert not under_way.is_none(3, True, 2.0)  # two more, which do arrive
    assert under_way.is_none(1, True, 2.1)


def test_a_simulator_that_delivers_nothing_stops_time_for_ever_shorter_periods(under_way):
    wall_s, waited_s = 0.0, []
    for count in range(1, 12):
        begun_s = wall_s
        while not under_way.is_none(count, True, wall_s):
            wall_s += 0.001
        waited_s.append(round(wall_s - begun_s, 2))
    assert waited_s == sorted(waited_s, reverse=True)
    assert waited_s[0] >= PATIENCE_S > 0.03 > waited_s[-1]


def test_a_packet_that_arrives_restores_the_full_wait(under_way):
    wall_s = 0.0
    for count in (1, 2, 3):
        while not under_way.is_none(count, True, wall_s):
            wall_s += 0.01
    assert not under_way.is_none(4, True, wall_s)
    assert under_way.is_none(3, True, wall_s)
    assert not under_way.is_none(4, True, wall_s)
    assert not under_way.is_none(4, True, wall_s + 0.9 * PATIENCE_S)


def test_nodes_that_work_on_one_thing_for_long_have_lost_nothing(under_way):
    assert not under_way.is_none(1, True, 0.0)
    assert not under_way.is_none(1, False, 5.0 * PATIENCE_S)
    assert not under_way.is_none(1, True, 5.5 * PATIENCE_S)
    assert under_way.is_none(0, True, 5.6 * PATIENCE_S)


def test_a_packet_that_was_given_up_and_arrives_is_not_taken_for_one_that_is_missing(under_way):
    assert not under_way.is_none(730, True, 0.0)
    assert under_way.is_none(730, True, PATIENCE_S + 0.1)
    assert not any(under_way.is_none(count, True, 2.0) for count in (729, 400, 0))
    assert under_way.is_none(0, True, 2.1 + PATIENCE_S)
    assert not under_way.is_none(1, True, 4.0)
