"""UnderWay: which packets the world waits for, and for how long."""

from __future__ import annotations

from drone_mesh.world.under_way import PATIENCE_S, UnderWay


def test_it_waits_for_packets_that_are_processed_one_after_the_other():
    under_way = UnderWay()
    assert under_way.is_none(0, True, 0.0)
    counts = [3, 2, 4, 1]  # on a slow machine, each just within the patience
    assert not any(
        under_way.is_none(n, True, i * 0.9 * PATIENCE_S) for i, n in enumerate(counts, 1)
    )
    assert under_way.is_none(0, True, 5.0 * PATIENCE_S)


def test_a_packet_that_never_arrives_is_waited_for_once():
    under_way = UnderWay()
    assert not under_way.is_none(1, True, 0.0)
    assert not under_way.is_none(1, True, PATIENCE_S)
    assert under_way.is_none(1, True, PATIENCE_S + 0.1)
    assert not under_way.is_none(3, True, 2.0)  # two more, which do arrive
    assert under_way.is_none(1, True, 2.1)


def test_a_simulator_that_delivers_nothing_stops_time_for_ever_shorter_periods():
    under_way = UnderWay()
    wall_s, waited_s = 0.0, []
    for count in range(1, 12):
        begun_s = wall_s
        while not under_way.is_none(count, True, wall_s):
            wall_s += 0.001
        waited_s.append(round(wall_s - begun_s, 2))
    assert waited_s == sorted(waited_s, reverse=True)
    assert waited_s[0] >= PATIENCE_S > 0.03 > waited_s[-1]


def test_a_packet_that_arrives_restores_the_full_wait():
    under_way = UnderWay()
    wall_s = 0.0
    for count in (1, 2, 3):
        while not under_way.is_none(count, True, wall_s):
            wall_s += 0.01
    assert not under_way.is_none(4, True, wall_s)
    assert under_way.is_none(3, True, wall_s)
    assert not under_way.is_none(4, True, wall_s)
    assert not under_way.is_none(4, True, wall_s + 0.9 * PATIENCE_S)


def test_nodes_that_work_on_one_thing_for_long_have_lost_nothing():
    under_way = UnderWay()
    assert not under_way.is_none(1, True, 0.0)
    assert not under_way.is_none(1, False, 5.0 * PATIENCE_S)
    assert not under_way.is_none(1, True, 5.5 * PATIENCE_S)
    assert under_way.is_none(0, True, 5.6 * PATIENCE_S)


def test_a_packet_that_was_given_up_and_arrives_is_not_taken_for_one_that_is_missing():
    under_way = UnderWay()
    assert not under_way.is_none(730, True, 0.0)
    assert under_way.is_none(730, True, PATIENCE_S + 0.1)
    assert not any(under_way.is_none(count, True, 2.0) for count in (729, 400, 0))
    assert under_way.is_none(0, True, 2.1 + PATIENCE_S)
    assert not under_way.is_none(1, True, 4.0)
