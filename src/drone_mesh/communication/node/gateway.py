"""MeshnetworkGateway: connects the mesh to the outside world (docs/protocol.md, "Gateway")."""

from __future__ import annotations

import math
import random

from drone_mesh.communication.control.control_plane import ITechnique
from drone_mesh.communication.control.places import PlaceRequests
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.interfaces import (
    MAX_NODE_ID,
    NO_ROUTE,
    IGatewayCommands,
    IInternetConnection,
    IWirelessCommunication,
    KnownNode,
    OrderRecord,
)
from drone_mesh.communication.node.component import (
    AS_IN_THE_DOCUMENT,
    MeshnetworkComponent,
    NodeSettings,
)
from drone_mesh.communication.node.flights import Flights
from drone_mesh.communication.node.whereabouts import Whereabouts
from drone_mesh.communication.orders.book import OrderBook
from drone_mesh.communication.orders.final_places import FinalPlaces
from drone_mesh.communication.reports import ReportBook, ReportedNode
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused

SEARCH_WITHIN_S = 3600.0  # a busy relay may send nothing of its own for a quarter of an hour


class MeshnetworkGateway(MeshnetworkComponent, IGatewayCommands):
    """A node that answers heartbeats and sends orders from outside into the mesh."""

    def __init__(
        self,
        node_id: int,
        antenna: IWirelessCommunication,
        engine: IDroneEngine,
        routing: ITechnique,
        internet: IInternetConnection,
        rng: random.Random,
        settings: NodeSettings = AS_IN_THE_DOCUMENT,
    ) -> None:
        """Like MeshnetworkComponent; orders arrive through `internet`."""
        super().__init__(node_id, antenna, engine, routing, rng, None, settings)
        control, deadlines, medium = self.control, self._deadlines, antenna.medium
        self._internet = internet
        self._internet_works = True
        self._heartbeats: dict[int, tuple[int, float]] = {}  # by creator: hops, when
        self._reports = ReportBook(deadlines)
        self._book = OrderBook(
            node_id, control, deadlines, medium, self.complaints, self._report, self._may_find
        )
        self._orders.tell_own = self._book.on_outcome
        self._final_places = FinalPlaces(
            node_id, control, deadlines, self._pilot, self._options.clearance_m
        )
        self._whereabouts = Whereabouts(
            node_id,
            control,
            deadlines,
            self._pilot,
            antenna,
            self.places,
            self._frame,
            self._options.clearance_m,
            self._has_key,
        )
        requests = PlaceRequests(node_id, self._pilot, antenna, control.delivery, deadlines)
        self._flights = self._orders.flights = Flights(
            self._pilot, control, self._orders, self._report, requests, deadlines
        )
        self._parts += [self._book, self._reports, self._whereabouts, self._flights]

    def start(self, now_s: float) -> None:
        super().start(now_s)
        self._internet.connect(self)

    def stop(self) -> None:
        self._internet.disconnect()
        super().stop()

    def set_internet(self, works: bool, now_s: float) -> None:
        """Its connection to the outside world works again, or no longer.

        Without one it is a router of another gateway, as far as the connection is concerned; it
        does not fly for it.
        """
        self._deadlines.now_s = now_s
        if works != self._internet_works:
            self._internet_works = works
            self.control.on_internet(works)
            kind = MeshEventKind.CONNECTED if works else MeshEventKind.DISCONNECTED
            self._report(kind, self._node_id)

    def send_goal_request_to_drone(
        self,
        node_id: int,
        latitude: float,
        longitude: float,
        height: int,
        now_s: float,
        allow_shared_place: bool = False,
    ) -> bool:
        """See IGatewayCommands; its own drone is asked at once.

        True also for that one. GoalRefused: an invalid node id or place, or it cannot fly.
        """
        self._deadlines.now_s = now_s
        if not 0 <= node_id <= MAX_NODE_ID:
            raise GoalRefused(f"invalid drone id {node_id}: must be 0..{MAX_NODE_ID}")
        check_goal(latitude, longitude, height, self._engine.fence)
        if height != int(height):
            raise GoalRefused(f"invalid height {height} m: must be in whole metres")
        goal = Location(latitude, longitude, height)
        if not allow_shared_place:
            orders, reports = self._book.records(), self._reports.nodes()
            self._final_places.check(node_id, goal, orders, reports)
        number = self._book.enter(node_id, goal)
        if node_id != self._node_id:
            return self._book.send(number)
        self._orders.take(node_id, goal, number)
        return True

    def get_orders(self) -> list[OrderRecord]:
        return self._book.records()

    def get_node_reports(self) -> list[ReportedNode]:
        """What other nodes have reported, by id. Any thread."""
        return self._reports.nodes()

    def get_known_nodes(self) -> list[KnownNode]:
        nodes = []
        reported = {one.node_id: one.report.hops for one in self._reports.nodes()}
        for node in range(MAX_NODE_ID + 1):
            if node == self._node_id:
                continue
            next_hop = self.control.routes.get_direction_to_node(node)
            unheard = reported.get(node, NO_ROUTE), -math.inf
            hops, heard_s = self._heartbeats.get(node, unheard)
            heard_s = max(heard_s, self.control.heard_s(node))
            heard_s = max(heard_s, self._neighbours.last_heard_s(node, otherwise=-math.inf))
            if next_hop != NO_ROUTE or heard_s > -math.inf:
                nodes.append(KnownNode(node, next_hop, hops, heard_s))
        return nodes

    def on_node_missing(self, node: int, told: bool) -> None:
        """A relay that cannot forward an order reports this to the gateway."""
        super().on_node_missing(node, told)
        self._book.on_missing(node, told)

    def on_node_heard(self, node: int, hops: int) -> None:
        """Its path works: send it what waits."""
        self._heartbeats[node] = (min(hops, NO_ROUTE), self._deadlines.now_s)
        self._book.on_found(node)

    def _may_find(self, node: int) -> bool:
        """Whether a search could find this node.

        A relay learns from the packets of others that it is connected, so it may send nothing to
        the gateway for minutes.
        """
        _hops, heard_s = self._heartbeats.get(node, (NO_ROUTE, -math.inf))
        ago_s = self._deadlines.now_s - heard_s
        return ago_s < self._antenna.medium.stretched(SEARCH_WITHIN_S)
