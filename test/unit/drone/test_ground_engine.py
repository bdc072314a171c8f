"""The drone of a node that stands on the ground."""

from __future__ import annotations

import logging

import pytest

from drone_mesh.drone import Location
from drone_mesh.drone.ground import GroundEngine
from drone_mesh.errors import GoalRefused

HERE = Location(latitude=52.5, longitude=-3.0, height=2.0)


def test_it_stays_where_it_was_put_whatever_its_goal_is():
    engine = GroundEngine(7, HERE)
    engine.set_goal(10.0, 20.0, 30)
    assert engine.get_location() == HERE


def test_each_goal_is_logged_with_its_numbers_and_the_node(caplog):
    caplog.set_level(logging.INFO)
    GroundEngine(7, HERE).set_goal(10.25, -20.0, 30)
    assert "node 7" in caplog.text
    assert "goal: latitude 10.25 m, longitude -20 m, height 30 m" in caplog.text


@pytest.mark.parametrize(
    ("latitude", "longitude", "height"),
    [(float("nan"), 0.0, 0.0), (5000.1, 0.0, 0.0), (0.0, float("inf"), 0.0), (0.0, 0.0, -1.0)],
)
def test_a_goal_that_is_no_place_is_refused_and_not_logged(caplog, latitude, longitude, height):
    caplog.set_level(logging.INFO)
    with pytest.raises(GoalRefused):
        GroundEngine(7, HERE).set_goal(latitude, longitude, height)
    assert caplog.text == ""


def test_it_cannot_fly_and_gives_the_reason():
    engine = GroundEngine(7, HERE)
    assert not engine.can_fly()
    assert engine.why_not_fly() == "it stands on the ground"
