"""Connection: what the router of a node with beacons is told about its gateway."""

from __future__ import annotations

import math

from drone_mesh.communication.beacon.own_motion import OwnMotion
from drone_mesh.communication.beacon.packets import newer
from drone_mesh.communication.beacon.routes import PROVEN_S, BeaconRoutes
from drone_mesh.communication.control.control_plane import IControlHost
from drone_mesh.communication.control.places import KnownPlaces
from drone_mesh.communication.control.router_states import RepairState, RouterEvent, RouterStates
from drone_mesh.communication.events.observer import MeshEventKind, Reporter, in_hops
from drone_mesh.communication.interfaces import NO_ROUTE, IWirelessCommunication

CHECK_S = 1.0  # how often a router without a gateway considers its repair


class Connection:
    """Whether this router is connected, and where its next hop is, told when that changes."""

    def __init__(
        self,
        host: IControlHost,
        states: RouterStates,
        routes: BeaconRoutes,
        motion: OwnMotion,
        places: KnownPlaces,
        antenna: IWirelessCommunication,
        report: Reporter,
    ) -> None:
        self._host, self._states = host, states
        self._places, self._antenna, self._report = places, antenna, report
        self._routes, self._motion = routes, motion
        self._check_s = -math.inf
        self._was_connected = False
        self._told = False  # the repair, of this connection
        self._unproven: int | None = None  # the gateway's newest number when the parent was chosen

    @property
    def due_s(self) -> float:
        """When to call `check` next."""
        if self._was_connected:
            return self._routes.proved_s + PROVEN_S + 1e-3
        return self._check_s

    def check(self) -> None:
        """Check whether the parent still hears this node, and whether the repair is due."""
        now_s = self._routes.now_s
        if self._was_connected and not self._reaches_gateway:
            self.show()
        if not self._states.connected and now_s >= self._check_s:
            self._check_s = now_s + CHECK_S
            if self._may_repair():
                self._host.on_unconnected_check(now_s)

    def has_new_parent(self) -> None:
        """Begin anew for another parent, which proves itself by the gateway's next beacon."""
        self._unproven = self._routes.newest_number

    def show(self) -> bool:
        """Tell the node whether a gateway is reached. Returns whether that is new."""
        states, parent = self._states, self._routes.parent
        connected = self._reaches_gateway
        if self._unproven is not None and newer(self._routes.number, self._unproven) > 0:
            self._unproven = None
        flies = states.repair is RepairState.FLYING  # over links that it leaves behind
        places, here = self._places, self._routes.motion
        if parent != NO_ROUTE and self._routes.is_proved and not flies:
            places.connected_here(None if here is None else here.place, self._routes.hops)
        is_good = self._unproven is None and self._routes.is_proved
        if parent != NO_ROUTE and not flies and (is_good or places.good is None):
            neighbour = self._routes.neighbours[parent]
            if neighbour.motion is not None:
                place, seen_s = neighbour.motion.place, neighbour.reported_s
                places.update_next_hop(parent, place, seen_s)
        if connected == self._was_connected:
            return False
        self._was_connected = connected
        if connected:
            states.happened(RouterEvent.GATEWAY_ANSWERED)
            self._report(MeshEventKind.CONNECTED, self._routes.gateway, in_hops(self._routes.hops))
            self._told = False
            self.tell_repair()
        else:
            states.happened(RouterEvent.ROUTE_LOST)
            self._report(MeshEventKind.DISCONNECTED, self._routes.gateway)
            self._check_s = self._routes.now_s
        return connected

    def tell_repair(self) -> None:
        """Tell the repair of a connection, unless it does not want to connect now."""
        if self._was_connected and not self._told:
            self._told = self._host.may_connect(self._routes.parent, True)
            if self._told:
                self._host.on_connected()

    def end(self, event: RouterEvent) -> None:
        """Called when a flight or an election begins or ends; the beacons decide the connection."""
        self._states.happened(event)
        if self._reaches_gateway and event is not RouterEvent.ANTENNA_OFF:
            self._states.happened(RouterEvent.GATEWAY_ANSWERED)

    @property
    def _reaches_gateway(self) -> bool:
        """Whether packets pass in both directions, to a gateway with internet."""
        routes = self._routes
        return routes.parent != NO_ROUTE and not routes.offline and routes.is_proved

    def _may_repair(self) -> bool:
        """Whether a lost connection counts: not in flight, whoever flies the drone."""
        if self._states.repair is RepairState.FLYING:
            return False
        if not self._motion.stands(self._routes.now_s):
            return False
        if self._routes.offline:
            return False  # its gateway is in reach and has no internet: a flight repairs nothing
        return self._antenna.on() and self._host.may_connect(NO_ROUTE, False)
