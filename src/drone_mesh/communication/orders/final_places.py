"""Where each drone is going to stand, as far as its gateway knows.

docs/protocol.md, "Orders".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Iterable, NamedTuple

from drone_mesh.communication.control.control_plane import IControlPlane
from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.interfaces import NO_ROUTE, OrderRecord, OrderState
from drone_mesh.communication.reports import ReportedNode
from drone_mesh.communication.timing import Deadlines
from drone_mesh.drone.goal import ROUNDING_M
from drone_mesh.drone.location import Location
from drone_mesh.errors import PlaceTaken


class _Place(NamedTuple):
    """Where a drone is or will be."""

    since_s: float  # the newest counts; infinity: it is on its way there
    place: Location


@dataclass(eq=False)
class FinalPlaces:
    """Checks the goals of a gateway's orders."""

    _node_id: int
    _control: IControlPlane
    _deadlines: Deadlines
    _pilot: Pilot
    _clearance_m: float

    def check(
        self,
        drone: int,
        goal: Location,
        orders: Iterable[OrderRecord],
        reports: Iterable[ReportedNode],
    ) -> None:
        """Raise PlaceTaken if another drone stands at `goal`, flies there or was heard there.

        `orders` and `reports` are all that the gateway knows.
        """
        places = self._places(orders, reports)
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
        is_here = other == self._node_id
        if is_here or self._control.routes.get_direction_to_node(other) != NO_ROUTE:
            return "stands"
        return "was last heard"

    def _places(
        self, orders: Iterable[OrderRecord], reports: Iterable[ReportedNode]
    ) -> dict[int, _Place]:
        """The newest place of each drone; only the final place of one on its way counts."""
        places: dict[int, _Place] = {}

        def note(drone: int, since_s: float, place: Location | None) -> None:
            known = places.get(drone)
            if place is not None and (known is None or since_s >= known.since_s):
                places[drone] = _Place(since_s, place)

        here, others = self._pilot.place(), self._control.neighbours.places
        note(self._node_id, self._deadlines.now_s, here)
        for node, heard in others.items():
            note(node, heard.heard_s, heard.place)
        for reported in reports:
            note(reported.node_id, reported.heard_s, reported.report.place)
        for order in orders:
            if order.state.is_open or order.state is OrderState.LOST_CONTACT:
                note(order.drone, math.inf, order.goal)
            elif order.state is OrderState.ARRIVED:
                note(order.drone, order.changed_s, order.goal)
        return places
