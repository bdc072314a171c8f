"""The outcome of the orders of a layout, in one line."""

from __future__ import annotations

import pytest

from drone_mesh.ros.services.order_summary import OrderSummary


@pytest.mark.parametrize(
    ("summary", "line"),
    [
        (OrderSummary([3, 2, 1], [], []), "ordered 3 of 3 drones"),
        (OrderSummary([1], [], []), "ordered 1 of 1 drone"),
        (
            OrderSummary(list(range(16, 0, -1)), [], [17]),
            "ordered 16 of 17 drones; drone 17 is not in this fleet",
        ),
        (
            OrderSummary([1, 2], [3, 9, 5, 4], list(range(18, 101))),
            "ordered 2 of 89 drones; no route yet to drones 3..5, 9; "
            "drones 18..100 are not in this fleet",
        ),
        (
            OrderSummary([1], [], [], later=[2, 3]),
            "ordered 1 of 3 drones; drones 2..3 will set out later",
        ),
        (OrderSummary([], [7], []), "ordered 0 of 1 drone; no route yet to drone 7"),
        (
            OrderSummary([], [], [], there=[1, 2], flying=[3]),
            "ordered 0 of 3 drones; drones 1..2 are at their places; drone 3 flies there already",
        ),
        (
            OrderSummary([4], [], [], there=[1], flying=[2, 3]),
            "ordered 1 of 4 drones; drone 1 is at its place; drones 2..3 fly there already",
        ),
    ],
)
def test_a_summary_counts_the_orders_and_names_the_drones_without_one(summary, line):
    assert summary.in_words() == line


def test_a_summary_is_complete_when_nobody_is_left_without_the_order():
    assert OrderSummary([1], [], [], later=[2], there=[3], flying=[4]).is_complete
    assert OrderSummary([], [], [], there=[3]).is_complete
    assert not OrderSummary([1], [2], []).is_complete
    assert not OrderSummary([1], [], [2]).is_complete
    assert not OrderSummary([1], [], [], refused={2: "drone 3 is in the way"}).is_complete
