"""The gateway of a node with beacons: whether it is reached, and what proves that."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from typing import Final

from drone_mesh.communication.beacon.courier import Courier
from drone_mesh.communication.beacon.own_beacons import OwnMotion
from drone_mesh.communication.beacon.packets import newer
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.beacon.times import JITTER
from drone_mesh.communication.beacon.way_up import PROVEN_S
from drone_mesh.communication.control.control_plane import IControlHost
from drone_mesh.communication.control.places import KnownPlaces, PlaceRequests
from drone_mesh.communication.control.router_states import RepairState, RouterEvent, RouterStates
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.events.observer import MeshEventKind, Reporter, in_hops
from drone_mesh.communication.interfaces import NO_ROUTE, IMeshSeals, IWirelessCommunication
from drone_mesh.communication.wire import messages

CHECK_S: Final = 1.0  # how often a router without a gateway considers its repair
ASKS_S: Final = 10.0  # at most so often for the place of a gateway that moves
PERIOD_S: Final = 60.0  # a router and its gateway tell each other the nonces of their seals
AGAIN_S: Final = 5.0  # until the gateway has answered twice
NEW_S: Final = 20.0  # at most so often because of a new parent: in motion they change all the time
PATIENT_AFTER: Final = 3  # heartbeats without an answer; the first ones are urgent
RARER: Final = 3.0  # on a busy channel, per check period of its patience: all relays lead there


@dataclass(eq=False)
class Connection:
    """Whether this router is connected, and where its next hop is, told when that changes."""

    _host: IControlHost
    _states: RouterStates
    _routes: BeaconRoutes
    _motion: OwnMotion
    _places: KnownPlaces
    _antenna: IWirelessCommunication
    _report: Reporter

    def __post_init__(self) -> None:
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
            # Not in flight, whoever flies the drone. If its gateway has no internet and is in
            # reach, a flight repairs nothing.
            flies = self._states.repair is RepairState.FLYING or not self._motion.stands(now_s)
            may_repair = not flies and not self._routes.offline and self._antenna.on()
            if may_repair and self._host.may_connect(NO_ROUTE, False):
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
            if neighbour.at_rest is not None:
                places.update_next_hop(parent, neighbour.at_rest, neighbour.reported_s)
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


@dataclass(eq=False)
class Proofs:
    """What a node with a key exchanges with its gateway because beacons prove nothing.

    Heartbeats tell the nonces that seals of orders and reports need (docs/security.md, "End-to-end
    seal"); nothing else in a mesh with beacons depends on them. The gateway is asked for its place.
    """

    _node_id: int
    _is_gateway: bool
    _routes: BeaconRoutes
    _courier: Courier
    _requests: PlaceRequests
    _places: KnownPlaces
    _seals: IMeshSeals
    _complaints: Complaints
    _antenna: IWirelessCommunication
    _rng: random.Random

    def __post_init__(self) -> None:
        self.has_key = self._seals.has_key
        self.due_s = math.inf  # the next heartbeat
        self._asked_s, self._ask_s = -math.inf, math.inf  # for the place of the gateway: last, next
        self._proven: int | None = None  # the gateway that answered the last one
        self._vain = 0  # heartbeats since the last answer
        self._told_s, self._through = -math.inf, NO_ROUTE  # the last one: when, to whom first

    def begin(self) -> None:
        """Begin anew for another gateway, at a random moment: many nodes find it at once."""
        if self.has_key and not self._routes.is_root:
            self.due_s = self._routes.now_s + AGAIN_S * self._rng.random()

    def connected(self) -> None:
        """A gateway is reached."""
        if self.due_s == math.inf:
            self.begin()

    def has_new_parent(self) -> None:
        """Tell the gateway soon, if it has not answered through this parent yet: it may swallow."""
        parent, soon_s = self._routes.parent, max(self._routes.now_s, self._told_s + NEW_S)
        is_known = parent == NO_ROUTE or self._routes.in_vain_through(parent) is not None
        if not is_known and not self._vain and soon_s + AGAIN_S < self.due_s < math.inf:
            self.due_s = soon_s + AGAIN_S * self._rng.random()

    def ask_soon(self) -> None:
        """A beacon tells another place of the gateway than it told itself."""
        now_s = self._routes.now_s
        if self._ask_s == math.inf and now_s - self._asked_s >= ASKS_S:
            self._ask_s = now_s + AGAIN_S * self._rng.random()  # others hear the same

    @property
    def next_s(self) -> float:
        """When to call `on_time` next."""
        return min(self.due_s, self._ask_s)

    def _ask(self) -> None:
        self._asked_s, self._ask_s = self._routes.now_s, math.inf
        if self._routes.parent != NO_ROUTE:  # a question that waited may outlive the route
            self._requests.ask(self._routes.gateway)

    def on_time(self) -> None:
        now_s = self._routes.now_s
        if now_s >= self._ask_s:
            self._ask()
        if now_s < self.due_s:
            return
        me, gateway = self._node_id, self._routes.gateway
        if self._routes.parent == NO_ROUTE:
            self.due_s = math.inf
            return
        if self._vain and self._through == self._routes.parent:
            self._routes.asked(self._through, in_vain=True)
        self._vain += 1
        self._told_s, self._through = now_s, self._routes.get_direction_to_node(gateway)
        busy = 1.0 + RARER * self._antenna.patience() * (self._vain >= PATIENT_AFTER)
        self.due_s = now_s + AGAIN_S * busy * (1.0 + self._rng.random())
        self._routes.tried[gateway] += not self._seals.may_be_gateway(gateway)
        self._courier.send_own(messages.heartbeat(me, me, gateway, gateway, True, gateway))
        if self._places.asks_gateway:
            self._ask()

    def heard(self, payload: bytes, creator: int) -> None:
        """A node tells this gateway its nonce, or the gateway answers."""
        now_s, me = self._routes.now_s, self._node_id
        if not self.has_key:
            self._complaints.dropped("a heartbeat of another technique", payload, now_s)
        elif messages.preferred_gateway(payload) != creator:  # gateways do not answer each other
            if self._is_gateway:
                self._courier.send_own(messages.heartbeat(me, me, creator, creator, True, me))
        elif creator == self._routes.gateway:
            self._vain = 0
            self._routes.asked(self._through, in_vain=False)
            if self._proven == creator:  # its second answer: by now it has a proof of this node
                self.due_s = now_s + PERIOD_S * (1.0 - JITTER * self._rng.random())
            self._proven = creator
