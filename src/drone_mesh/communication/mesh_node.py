"""MeshNode: the parts of one node, and the functions that others may call.

Any thread may call the getters of IMeshDebugInfo; everything else belongs to the thread that drives
the component.
"""

from __future__ import annotations

import abc
import random
from typing import Sequence

from drone_mesh.communication import messages
from drone_mesh.communication.complaints import Complaints
from drone_mesh.communication.data.transport import Transport
from drone_mesh.communication.deadlines import Deadlines, Due
from drone_mesh.communication.delivery import Delivery
from drone_mesh.communication.flight import Pilot
from drone_mesh.communication.forwarding import Forwarding
from drone_mesh.communication.frames import CommonFrame
from drone_mesh.communication.interfaces import (
    BROADCAST,
    MAX_NODE_ID,
    NO_ROUTE,
    NO_SEALS,
    IMeshDebugInfo,
    IMeshSeals,
    IWirelessCommunication,
)
from drone_mesh.communication.introduction import Introduction
from drone_mesh.communication.medium import ChannelUse, Medium
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.node_search import NodeSearch
from drone_mesh.communication.observer import MeshObserver, Reporter, ignore_events
from drone_mesh.communication.orders.intake import OrderIntake
from drone_mesh.communication.packet_types import DATA_TYPES
from drone_mesh.communication.parts import NodeParts
from drone_mesh.communication.places import KnownPlaces
from drone_mesh.communication.repair.status import NOTHING_TO_REPAIR, RepairStatus
from drone_mesh.communication.reports.node_reports import NodeReporter
from drone_mesh.communication.routing.interfaces import IRoutingEssentials, IRoutingTechnique
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location


class MeshNode(IMeshDebugInfo, IRoutingEssentials):
    """Owns the parts; MeshnetworkComponent passes them packets and deadlines."""

    def __init__(
        self,
        node_id: int,
        antenna: IWirelessCommunication,
        engine: IDroneEngine,
        routing: IRoutingTechnique,
        rng: random.Random,
        timing: MeshTiming | None = None,
        observer: MeshObserver = ignore_events,
        debug: bool = True,
    ) -> None:
        """`rng` spreads simultaneous actions of many nodes; `debug`: the antenna displays the node.

        Raises ValueError for a node id outside 0..253.
        """
        if not 0 <= node_id <= MAX_NODE_ID:
            raise ValueError(f"invalid node id {node_id}: must be 0..{MAX_NODE_ID}")
        self._node_id = node_id
        self._antenna = antenna
        self._shared = antenna.medium.shared
        seals = antenna if isinstance(antenna, IMeshSeals) else NO_SEALS
        self._routing = routing
        self._rng = rng
        self._timing = timing or MeshTiming()
        self._debug = debug
        self._deadlines = Deadlines()
        self._neighbours = Neighbours(self._timing.check_period_s, noticed_late=self._shared)
        self._report = Reporter(node_id, self._deadlines, observer)
        self.complaints = Complaints(node_id)
        self._delivery = Delivery(
            node_id,
            antenna,
            routing,
            self._neighbours,
            self._deadlines,
            self._timing.send_attempts,
            self._report,
            self._on_neighbour_lost,
        )
        self._forwarding = Forwarding(
            node_id, routing, self._delivery, self.complaints, self._report, antenna.medium
        )
        self.places = KnownPlaces()
        self._frame = CommonFrame(engine.frame_digest())
        self._pilot = Pilot(engine, self._deadlines, self.complaints)
        self._parts = NodeParts(
            node_id,
            self._timing,
            self._deadlines,
            self._report,
            routing,
            self._neighbours,
            self._delivery,
            self.places,
            self._pilot,
            antenna,
            seals,
        )
        self._introduction = Introduction(
            self._parts, self, self._frame, rng, lambda neighbour: self.send_heartbeat(neighbour)
        )
        self._search = NodeSearch(self._parts, self._answer_search)
        self._orders = OrderIntake(self._parts, self.complaints, self._took_off)
        self._reporter = NodeReporter(self._parts, self)
        room = messages.BODY_BYTES - seals.reserved_bytes(DATA_TYPES.start)
        self.data = Transport(self._parts, self.complaints, rng, self.get_preferred_gateway, room)

    # Snapshots -------------------------------------------------------------------------------

    def get_node_id(self) -> int:
        """This node's id, 0..253."""
        return self._node_id

    def get_total_message_sent(self) -> int:
        """Packets sent successfully, own and forwarded ones, broadcasts not counted."""
        return self._delivery.total_sent

    def get_last_good_known_location_id(self) -> int:
        """Id of the node whose place this one would fly to, or NO_ROUTE."""
        return self.places.good_id

    def get_last_good_known_location_seen_s(self) -> float:
        """When that node was there, on the clock of the component; meaningless with NO_ROUTE."""
        return self.places.good_seen_s

    def get_router_tech_table_size(self) -> int:
        """Known nodes; one that is known through two neighbours counts twice."""
        return self._routing.get_table_size()

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
        return self._routing.get_direction_to_node(node)

    def get_repair_status(self) -> RepairStatus:
        """What the node does about a lost connection, and why."""
        return NOTHING_TO_REPAIR

    def get_channel_use(self) -> ChannelUse:
        """The antenna's use of a shared channel."""
        return self._antenna.channel_use()

    # For the routing technique --------------------------------------------------------------

    def search_other_nodes_in_range(self) -> None:
        """Send PRESENT to each node in range."""
        self._introduction.broadcast()

    def send_heartbeat(self, other: int) -> bool:
        """Send a heartbeat to `other`."""
        return self._delivery.send_own(messages.addressed(self._heartbeat(), other))

    def send_heartbeats(self, others: Sequence[int]) -> None:
        """Send a heartbeat to each of these; those for direct neighbours leave together.

        On a busy channel, skip neighbours that were heard recently.
        """
        patience = self._antenna.patience()
        if patience > 0.0:
            since_s = self._deadlines.now_s - patience * self._timing.check_period_s
            heard_s = self._neighbours.last_heard_s
            others = [other for other in others if heard_s(other, otherwise=since_s) <= since_s]
        self._delivery.send_own_to_each(self._heartbeat(), others)

    def now_s(self) -> float:
        """The time of the component's latest call."""
        return self._deadlines.now_s

    @property
    def medium(self) -> Medium:
        """The properties of the antenna's medium."""
        return self._antenna.medium

    def wake_at(self, at_s: float) -> None:
        """Call the technique's `on_time` at this time."""
        self._deadlines.set(Due.ROUTING, at_s)

    def send_packet(self, kind: int, neighbour: int, body: bytes) -> bool:
        """Send a packet of the technique's own type to a neighbour."""
        me = self._node_id
        return self._delivery.send(
            messages.packet(kind, me, me, neighbour, neighbour, body), neighbour
        )

    def broadcast_packet(self, kind: int, body: bytes) -> None:
        """Send a packet of the technique's own type to each node in range."""
        me = self._node_id
        self._antenna.broadcast_message(messages.packet(kind, me, me, BROADCAST, BROADCAST, body))

    def own_place(self) -> Location | None:
        """The drone's position, if it can report it."""
        return self._pilot.location()

    def place_of(self, node: int) -> Location | None:
        """The last place reported by `node`, or None."""
        if node == self.get_preferred_gateway():
            return self.places.gateway
        return self.places.good if node == self.places.good_id else None

    # For the parts ---------------------------------------------------------------------------

    def _answer_search(self, gateway: int) -> bool:
        """Send a heartbeat even if one is under way: that one may have been lost."""
        return self._delivery.send_own(messages.addressed(self._heartbeat(), gateway))

    def _heartbeat(self) -> bytes:
        me = self._node_id
        connected, gateway = self.get_connected_to_gateway(), self.get_preferred_gateway()
        return self._parts.heartbeat(me, me, connected, gateway)

    @abc.abstractmethod
    def _took_off(self) -> None:
        """The drone leaves its place because of an order."""

    def _on_neighbour_lost(self, node: int) -> None:
        """A neighbour did not take a packet; the routes are already updated."""
