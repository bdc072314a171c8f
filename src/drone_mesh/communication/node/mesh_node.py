"""MeshNode: the parts of one node, and the functions that others may call.

Any thread may call the getters of IMeshDebugInfo; everything else belongs to the thread that drives
the component.
"""

from __future__ import annotations

import random
from typing import TypedDict

from drone_mesh.communication.control.control_plane import (
    IControlHost,
    IControlPlane,
    IControlTechnique,
)
from drone_mesh.communication.control.delivery import ITechnique
from drone_mesh.communication.control.parts import NodeBasics, NodeParts
from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.control.router_states import RouterStates
from drone_mesh.communication.data.transport import Transport
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.events.observer import MeshObserver, Reporter, ignore_events
from drone_mesh.communication.heartbeats.gateway_plane import GatewayHeartbeats
from drone_mesh.communication.heartbeats.router_plane import RouterHeartbeats
from drone_mesh.communication.interfaces import (
    MAX_NODE_ID,
    NO_ROUTE,
    NO_SEALS,
    IMeshSeals,
    IWirelessCommunication,
)
from drone_mesh.communication.neighbours.common_frame import CommonFrame
from drone_mesh.communication.neighbours.known_places import KnownPlaces
from drone_mesh.communication.neighbours.neighbour_table import Neighbours
from drone_mesh.communication.neighbours.seen_motion import SeenMotion
from drone_mesh.communication.node.own_id import OwnId
from drone_mesh.communication.orders.intake import OrderIntake
from drone_mesh.communication.repair.options import RepairOptions
from drone_mesh.communication.repair.status import NOTHING_TO_REPAIR, RepairStatus
from drone_mesh.communication.reports.node_reports import NodeReporter
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.timing.deadlines import Deadlines
from drone_mesh.communication.timing.medium import ChannelUse
from drone_mesh.communication.timing.mesh_timing import MeshTiming
from drone_mesh.drone.interfaces import IDroneEngine


class NodeSettings(TypedDict, total=False):
    """The arguments of every MeshNode that have a default."""

    timing: MeshTiming | None
    observer: MeshObserver
    debug: bool
    options: RepairOptions | None


class MeshNode(IControlHost):
    """Owns the parts; MeshnetworkComponent passes them packets and deadlines."""

    def __init__(
        self,
        node_id: int,
        antenna: IWirelessCommunication,
        engine: IDroneEngine,
        routing: ITechnique,
        rng: random.Random,
        states: RouterStates | None,
        *,
        timing: MeshTiming | None = None,
        observer: MeshObserver = ignore_events,
        debug: bool = True,
        options: RepairOptions | None = None,
    ) -> None:
        """`rng` spreads simultaneous actions of many nodes; `debug`: the antenna displays the node.

        `states` are those of a router; a gateway has none.

        Raises ValueError for a node id outside 0..253.
        """
        if not 0 <= node_id <= MAX_NODE_ID:
            raise ValueError(f"invalid node id {node_id}: must be 0..{MAX_NODE_ID}")
        self._node_id = node_id
        self._antenna = antenna
        seals = antenna if isinstance(antenna, IMeshSeals) else NO_SEALS
        self._rng = rng
        self._timing = (timing or MeshTiming()).lost_after(routing.connection_lost_after_s)
        self._options = options or RepairOptions()
        self._debug = debug
        self._deadlines = Deadlines()
        check_s, medium = self._timing.check_period_s, antenna.medium
        asked_s = check_s * max(1.0, medium.place_periods)
        motion = SeenMotion(self._options.range_m, asked_s)
        self._neighbours = Neighbours(check_s, noticed_late=medium.shared, motion=motion)
        self._report = Reporter(node_id, self._deadlines, observer)
        self.complaints = Complaints(node_id)
        self._own_id = OwnId(rng)
        self.places = KnownPlaces()
        self._frame = CommonFrame(engine.frame_digest())
        self._pilot = Pilot(engine, self._deadlines, self.complaints)
        basics = NodeBasics(
            node_id,
            self._timing,
            self._deadlines,
            self._report,
            self._neighbours,
            self.places,
            engine,
            self._pilot,
            antenna,
            seals,
            self.complaints,
            self._frame,
            rng,
            self._options.range_m,
        )
        self.control = control = self._control_plane(basics, routing, states)
        self._learn, self._forward = control.learn, control.forward  # called for each packet
        self._parts = NodeParts(**vars(basics), routing=control.routes, delivery=control.delivery)
        self._orders = OrderIntake(self._parts, self._took_off)
        self._reporter = NodeReporter(self._parts, self)
        self.data = Transport(self._parts, self)

    def _control_plane(
        self,
        basics: NodeBasics,
        routing: ITechnique,
        states: RouterStates | None,
    ) -> IControlPlane:
        if isinstance(routing, IControlTechnique):
            return routing.control_plane(basics, self, states)
        if not isinstance(routing, IRoutingTechnique):
            raise TypeError(f"{type(routing).__name__} is no technique")
        if states is None:
            return GatewayHeartbeats(basics, routing, self)
        return RouterHeartbeats(basics, routing, self, states)

    # Snapshots -------------------------------------------------------------------------------

    def get_node_id(self) -> int:
        """This node's id, 0..253."""
        return self._node_id

    def get_preferred_gateway(self) -> int:
        """Id of the gateway that this node uses, perhaps itself; NO_ROUTE while it knows none."""
        return self.control.gateway

    def get_hops_from_gateway_away(self) -> int:
        """Hops to that gateway, 0 for a gateway with internet; 255 while unknown."""
        return self.control.hops

    def get_total_message_sent(self) -> int:
        """Packets sent successfully, own and forwarded ones, broadcasts not counted."""
        return self.control.delivery.total_sent

    def get_last_good_known_location_id(self) -> int:
        """Id of the node whose place this one would fly to, or NO_ROUTE."""
        return self.places.good_id

    def get_last_good_known_location_seen_s(self) -> float:
        """When the node was at that place (seconds of the core's clock)."""
        return self.places.good_seen_s

    def get_router_tech_table_size(self) -> int:
        """Known nodes; one that is known through two neighbours counts twice."""
        return self.control.routes.get_table_size()

    def get_neighbours(self) -> dict[int, float]:
        """Direct neighbours, and when each was last heard (seconds of the core's clock)."""
        return self._neighbours.heard_s()

    def get_route_to_gateway(self) -> int:
        """The neighbour that leads to the preferred gateway; a gateway returns its own id."""
        return self.get_direction_to(self.get_preferred_gateway())

    def get_direction_to(self, node: int) -> int:
        """The neighbour that leads to `node`; this node's own id for itself."""
        if node in (self._node_id, NO_ROUTE):
            return node
        return self.control.routes.get_direction_to_node(node)

    def get_shares_id(self) -> bool:
        """Whether another radio with this node's id was heard lately."""
        return self._own_id.is_shared(self._deadlines.now_s)

    def get_repair_status(self) -> RepairStatus:
        """What the node does about a lost connection, and why."""
        return NOTHING_TO_REPAIR

    def get_channel_use(self) -> ChannelUse:
        """The antenna's use of a shared channel."""
        return self._antenna.channel_use()

    # For the control plane --------------------------------------------------------------------

    def on_node_missing(self, node: int, told: bool) -> None:
        """Messages for it may not arrive."""
        self.data.on_node_missing(node)

    # For the parts ---------------------------------------------------------------------------

    def _took_off(self) -> None:
        """The drone leaves its place because of an order; a gateway is connected anywhere."""
