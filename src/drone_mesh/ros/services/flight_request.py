"""request_flight: orders one drone through the DroneManager, as every program here does."""

from __future__ import annotations

from drone_mesh.drone.location import Location
from drone_mesh.errors import MeshError
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.persistent_service import ServiceGone, ServiceRefused, call_once
from drone_mesh.srv import OrderFlight, OrderFlightRequest


class FlightNotOrdered(MeshError):
    """No gateway has the order; the text says why. The drone does what it did before."""


class FlightRefused(FlightNotOrdered):
    """The order is refused: it is invalid, or leads to the place of another drone."""


def request_flight(drone: int, goal: Location, allow_shared_place: bool = False) -> str:
    """Order a drone to a place, through the mesh; returns who loses the mesh by it, in words.

    Raises FlightNotOrdered. Any thread.
    """
    place = goal.latitude, goal.longitude, round(goal.height)
    request = OrderFlightRequest(drone, *place, allow_shared_place)
    try:
        answer = call_once(names.ORDER_FLIGHT_SERVICE, OrderFlight, request)
    except ServiceGone as error:
        raise FlightNotOrdered(f"{error}: is the simulation running?") from None
    except ServiceRefused as error:
        raise FlightRefused(str(error)) from None
    if not answer.success:
        raise FlightNotOrdered(answer.message)
    return str(answer.message)
