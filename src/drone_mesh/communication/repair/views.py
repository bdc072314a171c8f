"""RepairViews: a repair strategy's view of its router (IRepairActions, "Views")."""

from __future__ import annotations

import math
from typing import Mapping

from drone_mesh.communication.control_plane import IControlPlane
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.medium import Medium
from drone_mesh.communication.parts import NodeParts
from drone_mesh.communication.repair.interfaces import IRepairActions, NeighbourView, Step
from drone_mesh.communication.repair.options import RepairOptions
from drone_mesh.communication.repair.spots import NEAR, PITCH
from drone_mesh.communication.router_states import RepairState, RouterStates
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused


class RepairViews(IRepairActions):
    """The views of IRepairActions; ConnectionRepair adds the actions."""

    def __init__(
        self,
        parts: NodeParts,
        states: RouterStates,
        control: IControlPlane,
        options: RepairOptions,
    ) -> None:
        self._parts = parts
        self._states = states
        self._control = control
        self._options = options
        self._tried_goals: list[Location] = []  # goals of this drone since it was last connected
        self._tried_spots: list[Location] = []  # where it landed for these

    @property
    def node_id(self) -> int:
        """See IRepairActions; also for the functions below."""
        return self._parts.node_id

    @property
    def now_s(self) -> float:  # noqa: D102
        return self._parts.now_s

    @property
    def medium(self) -> Medium:  # noqa: D102
        return self._parts.antenna.medium

    @property
    def range_m(self) -> float:  # noqa: D102
        return self._options.range_m

    @property
    def clearance_m(self) -> float:  # noqa: D102
        return self._options.clearance_m

    @property
    def check_period_s(self) -> float:  # noqa: D102
        return self._parts.timing.check_period_s

    @property
    def bids_within_s(self) -> float:  # noqa: D102
        return self._control.bids_within_s

    @property
    def connection_lost_after_s(self) -> float:  # noqa: D102
        return self._parts.timing.connection_lost_after_s

    @property
    def connected(self) -> bool:  # noqa: D102
        return self._states.connected

    @property
    def state(self) -> RepairState:  # noqa: D102
        return self._states.repair

    @property
    def silent(self) -> bool:  # noqa: D102
        return self._parts.neighbours.silent

    def hears_power(self) -> bool | None:  # noqa: D102
        return self._parts.antenna.hears_power()

    def neighbours(self) -> Mapping[int, NeighbourView]:  # noqa: D102
        return {node: self._view(node) for node in self._parts.routing.get_set_of_children()}

    def reachable(self) -> Mapping[int, NeighbourView]:  # noqa: D102
        places = self._parts.neighbours.places()
        return {node: self._view(node) for node in places if self.reaches(node)}

    def reaches(self, node: int) -> bool:  # noqa: D102
        return self._parts.routing.get_direction_to_node(node) != NO_ROUTE

    @property
    def lost_next_hop(self) -> int:  # noqa: D102
        return self._parts.places.good_id

    @property
    def steps(self) -> list[Step]:  # noqa: D102
        places, gateway = self._parts.places, self._control.gateway
        candidates = [
            (places.good, places.good_id),
            (places.gateway, gateway),
            (places.connected_at, NO_ROUTE),
        ]
        return [
            Step(place, owner, home=owner == gateway != NO_ROUTE)
            for place, owner in candidates
            if place is not None and _may_be_flown_to(place)
        ]

    @property
    def gateway_place(self) -> Location | None:  # noqa: D102
        return self._parts.places.gateway

    def own_place(self) -> Location | None:  # noqa: D102
        return self._parts.pilot.location()

    def why_not_fly(self) -> str:  # noqa: D102
        return self._parts.pilot.why_not_repair()

    def was_at(self, step: Step) -> bool:  # noqa: D102
        radius_m = self.clearance_m * (2 * PITCH if step.home else NEAR)
        here = self._parts.pilot.place() if step.owner == NO_ROUTE else None
        places = [*self._tried_goals, *filter(None, [here])]
        return any(step.place.distance_m(place) < radius_m for place in places)

    def try_again(self) -> None:  # noqa: D102
        self._tried_goals.clear()

    def _view(self, node: int) -> NeighbourView:
        heard, hops = self._parts.neighbours.place_of(node), self._parts.neighbours.hops_of(node)
        if heard is None:
            return NeighbourView(None, math.inf, hops)
        return NeighbourView(heard.place, self.now_s - heard.heard_s, hops)


def _may_be_flown_to(place: Location) -> bool:
    """Whether a drone may fly there: a LOCATION may contain any numbers."""
    try:
        check_goal(*place)
    except GoalRefused:
        return False
    return True
