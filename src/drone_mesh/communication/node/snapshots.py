"""NodeSnapshots: what a component tells about itself, for display. Any thread may call it."""

from __future__ import annotations

from drone_mesh.communication.control.control_plane import IControlPlane
from drone_mesh.communication.control.places import KnownPlaces
from drone_mesh.communication.interfaces import (
    NO_ROUTE,
    IMeshDebugInfo,
    IWirelessCommunication,
)
from drone_mesh.communication.node.own_id import OwnId
from drone_mesh.communication.repair.status import NOTHING_TO_REPAIR, RepairStatus
from drone_mesh.communication.timing import ChannelUse, Deadlines


class NodeSnapshots(IMeshDebugInfo):
    """The getters of a component; the component sets the fields."""

    _node_id: int
    control: IControlPlane
    places: KnownPlaces
    _own_id: OwnId
    _deadlines: Deadlines
    _antenna: IWirelessCommunication

    def get_node_id(self) -> int:
        return self._node_id

    def get_connected_to_gateway(self) -> bool:
        return self.control.connected

    def get_preferred_gateway(self) -> int:
        return self.control.gateway

    def get_hops_from_gateway_away(self) -> int:
        return self.control.hops

    def get_total_message_sent(self) -> int:
        return self.control.delivery.total_sent

    def get_last_good_known_location_id(self) -> int:
        return self.places.good_id

    def get_last_good_known_location_seen_s(self) -> float:
        """When the node was at that place (seconds of the core's clock)."""
        return self.places.good_seen_s

    def get_router_tech_table_size(self) -> int:
        return self.control.routes.get_table_size()

    def get_neighbours(self) -> dict[int, float]:
        """Direct neighbours, and when each was last heard (seconds of the core's clock)."""
        return self.control.neighbours.heard_s()

    def get_route_to_gateway(self) -> int:
        """The neighbour that leads to the preferred gateway; a gateway returns its own id."""
        return self.get_direction_to(self.get_preferred_gateway())

    def get_direction_to(self, node: int) -> int:
        """The neighbour that leads to `node`; this node's own id for itself."""
        if node in (self._node_id, NO_ROUTE):
            return node
        return self.control.routes.get_direction_to_node(node)

    def get_shares_id(self) -> bool:
        return self._own_id.is_shared()

    def get_repair_status(self) -> RepairStatus:
        return NOTHING_TO_REPAIR

    def get_channel_use(self) -> ChannelUse:
        return self._antenna.channel_use()
