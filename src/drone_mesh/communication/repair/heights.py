"""The heights at which repairs end (docs/repair.md, "Places of silent drones")."""

from __future__ import annotations

from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused

LOWEST_M = -10.0  # a place further below the origin is a mistake


def above_ground(place: Location) -> Location:
    """`place`, not lower than the origin: altitudes err by metres, and a field may slope."""
    return place if place.height >= 0 else place._replace(height=0)


def at_whole_metres(place: Location) -> Location:
    """Where a repair ends instead of at `place`.

    A LOCATION has whole metres of height only, and a beacon tenths: from elsewhere others would not
    know how near this drone is.
    """
    return above_ground(place._replace(height=round(place.height)))


def may_be_flown_to(place: Location) -> bool:
    """Whether a drone may fly there: a LOCATION may contain any numbers."""
    if place.height < LOWEST_M:
        return False
    try:
        check_goal(*at_whole_metres(place))
    except GoalRefused:
        return False
    return True
