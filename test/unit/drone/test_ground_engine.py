"""The drone of a node that stands on the ground."""

from __future__ import annotations

import pytest

from drone_mesh.drone import Location
from drone_mesh.drone.engines import GroundEngine
from drone_mesh.errors import GoalRefused, LocationUnknown

HERE = Location(latitude=52.5, longitude=-3.0, height=2.0)


def test_it_refuses_each_goal_and_stays_where_it_was_put():
    engine = GroundEngine(7, HERE)
    with pytest.raises(GoalRefused, match="drone 7 cannot fly: it stands on the ground"):
        engine.set_goal(10.0, 20.0, 30)
    assert engine.get_location() == HERE


def test_without_a_position_it_invents_none():
    with pytest.raises(LocationUnknown, match="use --latitude and --longitude"):
        GroundEngine(7, None).get_location()


def test_it_cannot_fly_and_gives_the_reason():
    engine = GroundEngine(7, HERE)
    assert not engine.can_fly()
    assert engine.why_not_fly() == "it stands on the ground"
