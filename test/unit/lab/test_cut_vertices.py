"""What `nearest` and `inward` fly for one dead node, beside what ideal information allows."""

from __future__ import annotations

import pytest

from drone_mesh.lab.cut_vertices import main
from drone_mesh.lab.ideal_moves import cut_off, inward, nearest, place, without

RANGE_M = 9.0
LINE = [(0.0, 0.0), (8.0, 0.0), (16.0, 0.0), (24.0, 0.0)]  # node 0 is the gateway


def test_the_drones_behind_the_dead_node_are_cut_off():
    assert cut_off(without(LINE, 1), RANGE_M, 0) == {2, 3}


def test_the_nearest_takes_the_place_and_those_that_it_leaves_repeat_that():
    flown = nearest(without(LINE, 1), place(LINE[1]), RANGE_M, {2, 3})
    assert flown == {2: pytest.approx(8.0), 3: pytest.approx(8.0)}


def test_if_all_may_move_inward_both_neighbours_go_to_half_the_range_and_others_follow():
    points = [(-8.0, 0.0), (0.0, 0.0), (8.0, 0.0), (16.0, 0.0)]
    flown = inward(without(points, 1), place(points[1]), RANGE_M, {0, 2, 3})
    assert flown == {0: pytest.approx(3.5), 2: pytest.approx(3.5), 3: pytest.approx(2.5)}


def test_if_only_those_behind_move_inward_the_neighbour_goes_on_to_the_place():
    flown = inward(without(LINE, 1), place(LINE[1]), RANGE_M, {2, 3})
    assert flown == {2: pytest.approx(8.0), 3: pytest.approx(7.0)}


@pytest.mark.parametrize("repair", ["nearest", "inward"])
def test_over_packets_they_fly_as_far_as_with_ideal_information(repair, capsys):
    main(["--drones", "20", "--layouts", "6", "--repair", repair])
    row = [cell.strip() for cell in capsys.readouterr().out.splitlines()[-1].split("|")]
    healed, deaths = row[7].split(" of ")
    assert healed == deaths == row[2]
    assert float(row[8]) == pytest.approx(1.0, abs=0.15)
