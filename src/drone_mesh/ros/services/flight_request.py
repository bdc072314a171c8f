"""request_flight: orders one drone through the DroneManager, as every program here does."""

from __future__ import annotations

from drone_mesh.drone.location import Location
from drone_mesh.errors import MeshError
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import whole_metres
from drone_mesh.ros.graph.persistent_service import ServiceGone, ServiceRefused, call_once
from drone_mesh.srv import RequestDroneFlight, RequestDroneFlightRequest


class FlightNotOrdered(MeshError):
    """No gateway has the order; the text says why. The drone does what it did before."""


class FlightRefused(FlightNotOrdered):
    """The DroneManager refuses the order: it can never be carried out."""


def request_flight(drone: int, goal: Location) -> None:
    """Order a drone to a place, through the mesh. Raises FlightNotOrdered. Any thread."""
    request = RequestDroneFlightRequest(
        drone, goal.latitude, goal.longitude, whole_metres(goal.height)
    )
    try:
        status = call_once(names.REQUEST_MOVEMENT_SERVICE, RequestDroneFlight, request).status
    except ServiceGone as error:
        raise FlightNotOrdered(f"{error}: is the simulation running?") from None
    except ServiceRefused as error:
        raise FlightRefused(str(error)) from None
    if status == 0:
        raise FlightNotOrdered("no gateway is running")
    if status == 2:
        raise FlightNotOrdered(f"no gateway has a route to drone {drone}")
