"""The legend in rviz: what it names, and where it stands."""

from __future__ import annotations

from drone_mesh.ros.views.marker_legend import ROUND_TO_M, legend_rows
from drone_mesh.state.condition import Condition
from drone_mesh.view.palette import DARK


def test_each_condition_and_link_has_a_row_in_its_colour_south_of_the_mesh() -> None:
    rows = legend_rows([(-12.0, 3.0, 0.0), (8.0, 26.0, 4.0)])
    colours = {row.text: row.colour for row in rows}
    assert {condition.value for condition in Condition} | {"gateway"} <= set(colours)
    assert {"route to a gateway", "known link", "lost link", "flight path"} <= set(colours)
    assert colours["disconnected"] == DARK.disconnected
    assert max(row.place[1] for row in rows) < 0.0
    assert len({row.place for row in rows}) == len(rows)


def test_it_stays_while_drones_move_a_little() -> None:
    before = legend_rows([(1.0, 1.0, 0.0), (9.0, 9.0, 0.0)])
    assert legend_rows([(1.5, 1.2, 0.0), (8.0, 9.9, 7.0)]) == before
    assert legend_rows([(1.0, 1.0, 0.0), (9.0 + ROUND_TO_M, 9.0, 0.0)]) != before
