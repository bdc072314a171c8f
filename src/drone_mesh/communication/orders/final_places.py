"""Where each drone is going to stand, as far as its gateway knows.

docs/protocol.md, "Orders".
"""

from __future__ import annotations

import math
from typing import Iterable, NamedTuple

from drone_mesh.communication.control.parts import NodeParts
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.order_record import OrderRecord, OrderState
from drone_mesh.communication.reports.node_reports import ReportedNode
from drone_mesh.drone.goal import ROUNDING_M
from drone_mesh.drone.location import Location
from drone_mesh.errors import PlaceTaken


class _Place(NamedTuple):
    """Where a drone is or will be."""

    since_s: float  # the newest counts; infinity: it is on its way there
    place: Location


def check_place(
    parts: NodeParts,
    orders: Iterable[OrderRecord],
    reports: Iterable[ReportedNode],
    drone: int,
    goal: Location,
    clearance_m: float,
) -> None:
    """Raise PlaceTaken if another drone stands at `goal`, flies there or was heard there.

    `parts` are those of the gateway, `orders` and `reports` all that it knows.
    """
    places = _final_places(parts, orders, reports)
    places.pop(drone, None)
    for other, (since_s, place) in sorted(places.items()):
        away_m = goal.distance_m(place)
        if away_m < clearance_m - ROUNDING_M:
            raise PlaceTaken(
                f"drone {other} {_verb(parts, other, since_s)} {away_m:.1f} m from there; "
                "allow_shared_place sends it all the same",
                other,
            )


def _verb(parts: NodeParts, other: int, since_s: float) -> str:
    if since_s == math.inf:
        return "flies to a place"
    is_here = other == parts.node_id
    if is_here or parts.routing.get_direction_to_node(other) != NO_ROUTE:
        return "stands"
    return "was last heard"


def _final_places(
    parts: NodeParts, orders: Iterable[OrderRecord], reports: Iterable[ReportedNode]
) -> dict[int, _Place]:
    """The newest place of each drone; only the final place of one on its way counts."""
    places: dict[int, _Place] = {}

    def note(drone: int, since_s: float, place: Location | None) -> None:
        known = places.get(drone)
        if place is not None and (known is None or since_s >= known.since_s):
            places[drone] = _Place(since_s, place)

    note(parts.node_id, parts.now_s, parts.pilot.place())
    for node, heard in parts.neighbours.places().items():
        note(node, heard.heard_s, heard.place)
    for reported in reports:
        note(reported.node_id, reported.heard_s, reported.report.place)
    for order in orders:
        if order.state.is_open or order.state is OrderState.LOST_CONTACT:
            note(order.drone, math.inf, order.goal)
        elif order.state is OrderState.ARRIVED:
            note(order.drone, order.changed_s, order.goal)
    return places
