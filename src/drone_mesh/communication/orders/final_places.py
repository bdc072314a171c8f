"""FinalPlaces: where each drone is going to stand, as far as its gateway knows.

docs/protocol.md, "Orders".
"""

from __future__ import annotations

import math
from typing import Callable, Iterable, NamedTuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.order_record import OrderRecord, OrderState
from drone_mesh.communication.parts import NodeParts
from drone_mesh.communication.reports.node_reports import ReportedNode
from drone_mesh.drone.location import Location
from drone_mesh.errors import PlaceTaken

ROUNDING_M = 0.01  # our choice: places travel as float32 and in steps


class _Place(NamedTuple):
    """Where a drone is or will be."""

    since_s: float  # the newest counts; infinity: it is on its way there
    place: Location


class FinalPlaces:
    """Refuses orders onto the place of another drone."""

    def __init__(
        self,
        parts: NodeParts,
        orders: Callable[[], Iterable[OrderRecord]],
        reports: Callable[[], Iterable[ReportedNode]],
        clearance_m: float,
    ) -> None:
        """`orders` and `reports`: what the gateway knows of them now."""
        self._parts = parts
        self._orders = orders
        self._reports = reports
        self._clearance_m = clearance_m

    def check(self, drone: int, goal: Location) -> None:
        """Raise PlaceTaken if another drone stands at `goal`, flies there or was heard there."""
        places = self._places()
        places.pop(drone, None)
        for other, (since_s, place) in sorted(places.items()):
            away_m = goal.distance_m(place)
            if away_m < self._clearance_m - ROUNDING_M:
                raise PlaceTaken(
                    f"drone {other} {self._verb(other, since_s)} {away_m:.1f} m from there; "
                    "allow_shared_place sends it all the same",
                    other,
                )

    def _verb(self, other: int, since_s: float) -> str:
        if since_s == math.inf:
            return "flies to a place"
        parts = self._parts
        is_here = other == parts.node_id
        if is_here or parts.routing.get_direction_to_node(other) != NO_ROUTE:
            return "stands"
        return "was last heard"

    def _places(self) -> dict[int, _Place]:
        """The newest place of each drone; only the final place of one on its way counts."""
        parts = self._parts
        places: dict[int, _Place] = {}

        def note(drone: int, since_s: float, place: Location | None) -> None:
            known = places.get(drone)
            if place is not None and (known is None or since_s >= known.since_s):
                places[drone] = _Place(since_s, place)

        note(parts.node_id, parts.now_s, parts.pilot.place())
        for node, heard in parts.neighbours.places().items():
            note(node, heard.heard_s, heard.place)
        for reported in self._reports():
            if reported.report is not None:
                note(reported.node_id, reported.heard_s, reported.report.place)
        for order in self._orders():
            if order.state.is_open or order.state is OrderState.LOST_CONTACT:
                note(order.drone, math.inf, order.goal)
            elif order.state is OrderState.ARRIVED:
                note(order.drone, order.changed_s, order.goal)
        return places
