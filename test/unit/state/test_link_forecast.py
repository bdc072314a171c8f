"""Links that will soon break."""

from __future__ import annotations

import math

import pytest

from drone_mesh.state.links import LinkForecast, link_expires_s
from drone_mesh.state.model import NodeStatus


@pytest.mark.parametrize(
    ("away", "drift", "expires_s"),
    [
        ((4.0, 0.0, 0.0), (1.0, 0.0, 0.0), 5.0),
        ((-4.0, 0.0, 0.0), (1.0, 0.0, 0.0), 13.0),  # it comes nearer first
        ((0.0, 0.0, 0.0), (0.0, 3.0, 0.0), 3.0),
        ((0.0, 5.4, 7.2), (0.0, 1.0, 0.0), 0.0),  # at the edge
        ((3.0, 0.0, 0.0), (0.0, 0.0, 0.0), math.inf),
        ((10.0, 0.0, 0.0), (-1.0, 0.0, 0.0), 0.0),  # out of range already
    ],
)
def test_a_link_expires_when_the_distance_reaches_the_range(away, drift, expires_s):
    assert link_expires_s(away, drift, 9.0) == pytest.approx(expires_s)


def forecast(*positions_of_1):
    """What is forecast for node 0, which stands at the origin, and node 1, one second apart."""
    watch, found = LinkForecast(), []
    for now_s, x in enumerate(positions_of_1):
        nodes = [NodeStatus(0, position=(0.0, 0.0, 0.0)), NodeStatus(1, position=(x, 0.0, 0.0))]
        found.append(watch.update([(0, 1)], nodes, float(now_s), 9.0))
    return found


def test_a_link_whose_ends_fly_apart_is_forecast_before_it_breaks():
    assert forecast(1.0, 2.0, 3.0, 4.0, 5.0) == [[], [], [], [], [(0, 1)]]


def test_a_link_of_standing_or_approaching_drones_is_not_forecast():
    assert not any(forecast(8.5, 8.5, 8.5))
    assert not any(forecast(8.5, 7.5, 6.5))


def test_nothing_is_forecast_after_a_jump_in_time_or_without_positions():
    watch = LinkForecast()
    for now_s, x in ((0.0, 1.0), (1.0, 3.0), (500.0, 8.0), (3.0, 8.9)):
        nodes = [NodeStatus(0, position=(0.0, 0.0, 0.0)), NodeStatus(1, position=(x, 0.0, 0.0))]
        found = watch.update([(0, 1)], nodes, now_s, 9.0)
    assert found == []
    assert watch.update([(0, 1)], [NodeStatus(0), NodeStatus(1)], 4.0, 9.0) == []
