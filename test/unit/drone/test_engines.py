"""Which engine an option chooses."""

from __future__ import annotations

import pytest

from drone_mesh.drone.engines import FlightOptions, GroundEngine, create_engine
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.limits import FlightLimits
from drone_mesh.errors import ConfigurationError, GoalRefused, LocationUnknown

HERE = Location(1.0, 2.0, 3.0)
ORIGIN = Origin(52.0, 5.0, 0.0)


class OwnEngine(IDroneEngine):
    """The minimum of a user's own engine."""

    def __init__(self, node_id: int) -> None:
        self.node_id = node_id

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Nowhere."""

    def get_location(self) -> Location:
        return HERE


class NotAnEngine:
    def __init__(self, node_id: int) -> None:
        pass


def test_without_an_option_the_node_stands_on_the_ground() -> None:
    engine = create_engine(4, HERE, FlightOptions())
    assert isinstance(engine, GroundEngine)
    assert engine.get_location() == HERE


def test_a_node_on_the_ground_refuses_each_goal_and_stays_where_it_was_put():
    engine = GroundEngine(7, HERE)
    with pytest.raises(GoalRefused, match="drone 7 cannot fly: it stands on the ground"):
        engine.set_goal(10.0, 20.0, 30)
    assert engine.get_location() == HERE
    assert not engine.can_fly()
    assert engine.why_not_fly() == "it stands on the ground"


def test_without_a_position_a_node_on_the_ground_invents_none():
    with pytest.raises(LocationUnknown, match="use --latitude and --longitude"):
        GroundEngine(7, None).get_location()


def test_an_own_engine_is_made_with_the_id_of_the_node_and_can_fly() -> None:
    engine = create_engine(4, HERE, FlightOptions(drone=f"{__name__}:OwnEngine"))
    assert engine.node_id == 4
    assert engine.can_fly()
    assert engine.is_flying() is None
    engine.close()


@pytest.mark.parametrize(
    ("drone", "why"),
    [
        ("rocket", "use ground, mavlink:ADDRESS or package.module:Class"),
        ("no.such.module:Engine", "No module named 'no"),
        (f"{__name__}:NoSuchClass", "cannot be loaded: .*NoSuchClass"),
        (f"{__name__}:NotAnEngine", "does not implement IDroneEngine"),
        ("mavlink:serial0", "use /dev/NAME,BAUD or udpin"),
        ("mavlink:udpin:here", "use /dev/NAME,BAUD or udpin"),
        ("mavlink:/dev/no_such_port,57600", "MAVLink address /dev/no_such_port,57600: .*No such"),
        ("mavlink:tcp:127.0.0.1:1", "MAVLink address tcp:127.0.0.1:1: .*refused"),
    ],
)
def test_an_unavailable_engine_is_refused_with_a_reason(drone: str, why: str) -> None:
    with pytest.raises(ConfigurationError, match=why):
        create_engine(4, HERE, FlightOptions(drone=drone, origin=ORIGIN))


def test_a_drone_with_an_autopilot_needs_an_origin() -> None:
    with pytest.raises(ConfigurationError, match="needs --origin LAT,LON,ALT"):
        FlightOptions(drone="mavlink:udpin:127.0.0.1:14550")


@pytest.mark.parametrize(
    ("limits", "why"),
    [
        ({"max_height_m": 501.0}, "--max-height 501 is outside 1..500"),
        ({"max_distance_m": float("nan")}, "--max-distance nan is outside"),
        ({"speed_m_s": 0.0}, "--speed 0 is outside"),
        ({"min_battery_percent": 101.0}, "--min-battery 101 is outside"),
        ({"cruise_height_m": 60.0}, "--cruise-height 60 is outside 1..50"),
        ({"layer_m": -1.0}, "--layers -1 is outside"),
        ({"hover_m": 51.0}, "--hover 51 is outside"),
    ],
)
def test_invalid_limits_are_refused_by_the_name_of_their_option(limits, why) -> None:
    with pytest.raises(ConfigurationError, match=why):
        FlightLimits(**limits)
