"""BeaconPlane: the control plane of one node by beacons (docs/protocol.md, "Beacons")."""

from __future__ import annotations

import math

from drone_mesh.communication import messages
from drone_mesh.communication.beacon.losses import LUCKY
from drone_mesh.communication.beacon.neighbour import Neighbour
from drone_mesh.communication.beacon.own_motion import OwnMotion
from drone_mesh.communication.beacon.packets import (
    Beacon,
    Found,
    Motion,
    Search,
    names_gateway,
    newer,
)
from drone_mesh.communication.beacon.proofs import Proofs
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.beacon.search import HOPS_AROUND, MOST_HOPS, Searches
from drone_mesh.communication.beacon.trickle import Trickle
from drone_mesh.communication.control_plane import IControlHost, IControlPlane, IControlTechnique
from drone_mesh.communication.courier import DROP, HOLD, Courier, Transit
from drone_mesh.communication.deadlines import Due
from drone_mesh.communication.interfaces import BROADCAST, MAX_NODE_ID, NO_ROUTE
from drone_mesh.communication.observer import MeshEventKind, in_hops
from drone_mesh.communication.packet_types import MessageType
from drone_mesh.communication.parts import NodeBasics
from drone_mesh.communication.router_states import RepairState, RouterEvent, RouterStates
from drone_mesh.drone.location import Location

HELD_S = 2.5  # our choice: a packet without a next hop waits this long
RETRY_S = 0.15  # our choice: so often it asks again, beside each beacon that arrives
LOOK_S = 0.2  # our choice: links change that slowly
CHECK_S = 1.0  # our choice: how often a router without a gateway considers its repair
BIDS_WITHIN_S = 3.0  # our choice: routers that lose one parent notice it within two intervals
LATE = 1.25  # intervals, with their jitter: then a beacon of the parent was lost, or it is dead
TURN_HOPS = 8  # for each neighbour: children ask one after the other, and the answer is for all
LATE_S = 2.0  # our choice: one lost beacon of a frequent sender says little
GATEWAY_PLACE_EVERY = 4  # beacons: one of so many carries the gateway's place
DIGEST_EVERY = 4  # beacons: one of so many carries the digest of the origin
MOST_WAYS = 3  # our choice: to which one node sends a packet down; after that it searches
SEARCHES_S = 0.6  # our choice: a relay without a way searches for so long, then returns a packet
WITHOUT_BEACONS_S = 5.0  # our choice: 2.5 of the longest intervals, and more
NOT_HELD = (MessageType.MOVEMENT_NEGOTIATION, MessageType.FOUND)  # soon sent again
SEALED_ROOM = 20  # bytes of a beacon with a seal
MOVED = 0.05  # of the range: a drone that is further from where it stood flies; from where the
# others expect it, it has turned
DRIVER_TRIES = 4  # per hop: more delay the packet, which another neighbour may take at once


class BeaconPlane(IControlPlane):
    """Neighbours, connection and routes of one node by beacons."""

    def __init__(self, basics: NodeBasics, host: IControlHost, states: RouterStates | None) -> None:
        self._basics, self._host, self._states = basics, host, states
        self._me, self._antenna = basics.node_id, basics.antenna
        self._deadlines = basics.deadlines
        self.bids_within_s = self._antenna.medium.stretched(BIDS_WITHIN_S)
        room = self._room = messages.BODY_BYTES - basics.seals.reserved_bytes(MessageType.BEACON)
        self._body = slice(messages.HEADER_BYTES, messages.HEADER_BYTES + room)
        self._routes = self.routes = BeaconRoutes(
            self._me,
            states is None,
            basics.range_m,
            basics.neighbours.place_of,
            self._antenna.medium.shared,
        )
        self._step_m = MOVED * basics.range_m
        self._motion = OwnMotion(basics.pilot.place, self._step_m)
        self._shown: tuple[float, Motion] | None = None  # what the others expect of this drone
        self._courier = self.delivery = Courier(
            self._me,
            self._antenna,
            self._deadlines,
            basics.timing.send_attempts,
            self._verdict,
            self._routes.alive,
            self._failed,
            lambda from_, node: self._routes.leads_not_to(node, from_),
            basics.seals.without_proof,
        )
        self._proofs = Proofs(basics, self._routes, self._courier, states is None)
        self._trickle = Trickle(self._antenna.medium, basics.rng)
        self._searches = Searches(
            self._me, self._routes, self._broadcast, self._antenna.medium.hop_s
        )
        self._sent = 0  # beacons
        self._look_s = -math.inf  # when it looks at everything anew, whatever a beacon says
        self._probed_s = self._retry_s = self._check_s = -math.inf
        self._turn = basics.rng.random()  # among the children of its parent
        self._asks = True  # whether its next beacon asks for those of the neighbours
        self._was_connected = self._told = False
        self._heard_place: Location | None = None  # of the gateway: what the latest beacon said
        self._told_place: Location | None = None  # what this node's beacons have said
        self._unproven: int | None = None  # the gateway's newest number when the parent was chosen
        self.learn = self._learn
        self.forward = self._courier.forward

    # Time and surroundings -------------------------------------------------------------------

    def start(self) -> None:
        """Send the first beacon, each node at another moment."""
        self._set_time()
        self._antenna.limit_tries(DRIVER_TRIES)
        self._trickle.start(self._routes.now_s)
        self._plan()

    def on_time(self, now_s: float) -> None:
        """Do what is due."""
        if now_s < self._deadlines.get(Due.ROUTING):
            return
        self._set_time()
        self._look_round()
        if self._courier.holds and now_s >= self._retry_s:
            self._retry(now_s)
        if now_s >= self._trickle.due_s:
            self._send_beacon()
        self._proofs.on_time()
        self._plan()

    def check(self, due_s: float) -> None:
        """Everything is checked at its own time."""

    def on_power(self, on: bool) -> None:
        """Ask for the beacons of the neighbours; forget them when the antenna is off."""
        self._set_time()
        if on:
            self._asks = True
            self._trickle.start(self._routes.now_s)
        else:
            self._routes.neighbours.clear()
            self._basics.neighbours.forget_all()  # it is this node that has fallen silent
            self._look_round()
        self._plan()

    def on_registered(self) -> None:
        """Ask for the beacons of the neighbours."""
        if self._antenna.on():
            self.on_power(True)

    def on_internet(self, works: bool) -> None:
        """The next beacon says so, soon."""
        self._set_time()
        before = self._routes.gateway
        self._routes.set_internet(works)
        self._gateway_was(before)
        self._trickle.hurry(self._routes.now_s)
        self._plan()

    def introduce(self) -> None:
        """Send a beacon soon."""
        self._set_time()
        self._trickle.hurry(self._routes.now_s)
        self._plan()

    def neighbour_leaves(self, neighbour: int) -> None:
        """Its places and velocity show this in time."""

    def gateway_sent_place(self) -> None:
        """Nothing depends on it."""

    def _look_round(self) -> None:
        """Forget who is silent, choose the parent, tell the node what has changed."""
        routes, now_s = self._routes, self._routes.now_s
        for node in routes.expired():
            self._trickle.reset(now_s)
            self._lost(node)
        heard = self._basics.neighbours
        for node in heard.ids().difference(routes.neighbours):  # it has sent other packets
            if now_s - heard.last_heard_s(node, now_s) > WITHOUT_BEACONS_S:
                heard.forget(node)
                self._left(node)
        parent = routes.neighbours.get(routes.parent)
        if parent is not None and parent.usable and self._is_silent(parent):
            self._probed_s = now_s
            me, to = self._me, parent.node
            self._courier.send(messages.packet(MessageType.PROBE, me, me, to, to), to)
        self._choose()
        states = self._states
        if states is not None and not states.connected and now_s >= self._check_s:
            self._check_s = now_s + CHECK_S
            if self._may_repair(states, now_s):
                self._host.on_unconnected_check(now_s)

    def _is_silent(self, parent: Neighbour) -> bool:
        """Whether it is time to probe the parent, again perhaps."""
        now_s = self._routes.now_s
        again_s = self._probed_s + parent.beacon.interval_s
        return now_s >= self._late_s(parent) and now_s > again_s

    def _late_s(self, parent: Neighbour) -> float:
        """From when on the parent, if it stays silent, has to acknowledge a probe."""
        interval_s = parent.beacon.interval_s
        silent_s = max(LATE * interval_s, min(2.0 * interval_s, LATE_S))
        turns_s = TURN_HOPS * self._antenna.medium.hop_s * len(self._routes.neighbours)
        return parent.alive_s + silent_s + self._turn * turns_s

    def _may_repair(self, states: RouterStates, now_s: float) -> bool:
        """Whether a lost connection counts: not in flight, whoever flies the drone."""
        if states.repair is RepairState.FLYING or not self._motion.stands(now_s):
            return False
        if self._routes.parent != NO_ROUTE:
            return False  # its gateway is in reach and has no internet: a flight repairs nothing
        return self._antenna.on() and self._host.may_connect(NO_ROUTE, False)

    def _choose(self) -> None:
        before = self._routes.gateway, self._routes.hops, self._routes.offline
        parent = self._routes.parent
        if not self._routes.choose():
            if not self._told and self._was_connected:
                self._tell()
            return
        now_s, gateway = self._routes.now_s, self._routes.gateway
        if self._routes.parent != parent:
            self._unproven = self._routes.newest_number
        if (gateway, self._routes.hops, self._routes.offline) != before:
            self._trickle.hurry(now_s)
        else:
            self._trickle.reset(now_s)
        self._gateway_was(before[0])
        self._show()

    def _gateway_was(self, before: int) -> None:
        """If it prefers another one now: report it, and forget where that one was."""
        gateway = self._routes.gateway
        if before not in (gateway, NO_ROUTE):
            self._basics.report(MeshEventKind.GATEWAY_CHANGED, gateway)
            self._basics.places.forget_gateway()
            self._heard_place = None
            self._proofs.begin()

    def _show(self) -> None:
        """Tell the node whether a gateway is reached."""
        states, parent = self._states, self._routes.parent
        connected = parent != NO_ROUTE and not self._routes.offline
        if states is None:
            return
        if self._unproven is not None and newer(self._routes.number, self._unproven) > 0:
            self._unproven = None
        flies = states.repair is RepairState.FLYING  # over links that it leaves behind
        places, here = self._basics.places, self._routes.motion
        if parent != NO_ROUTE and not flies:
            places.connected_here(None if here is None else here.place, self._routes.hops)
        is_proven = self._unproven is None or places.good is None
        if parent != NO_ROUTE and is_proven and not flies:
            neighbour = self._routes.neighbours[parent]
            if neighbour.motion is not None:
                place, seen_s = neighbour.motion.place, neighbour.reported_s
                places.update_next_hop(parent, place, seen_s)
        if connected == self._was_connected:
            return
        self._was_connected = connected
        if connected:
            states.happened(RouterEvent.GATEWAY_ANSWERED)
            self._basics.report(
                MeshEventKind.CONNECTED, self._routes.gateway, in_hops(self._routes.hops)
            )
            self._told = False
            self._tell()
            if self._proofs.due_s == math.inf:
                self._proofs.begin()
        else:
            states.happened(RouterEvent.ROUTE_LOST)
            self._basics.report(MeshEventKind.DISCONNECTED, self._routes.gateway)
            self._check_s = self._routes.now_s

    def _tell(self) -> None:
        """Tell the repair of a connection; during some of its flights it wants to hear of none."""
        if self._host.may_connect(self._routes.parent, True):
            self._told = True
            self._host.on_connected()

    def _set_time(self) -> None:
        self._routes.now_s = now_s = self._deadlines.now_s
        self._routes.motion = motion = self._motion.at(now_s)
        if motion is None or self._shown is None:
            return
        shown_s, shown = self._shown
        if shown.apart_m(now_s - shown_s, motion, 0.0) > self._step_m:
            self._motion.has_turned(now_s)
            self._shown = None
            self._look_s = now_s
            self._trickle.hurry(now_s)

    def _plan(self) -> None:
        """Schedule the next call of `on_time`."""
        due_s = self._trickle.due_s
        routes = self._routes
        due_s = min(due_s, routes.first_end_s() + 1e-3)
        parent = routes.neighbours.get(routes.parent)
        if parent is not None:
            again_s = self._probed_s + parent.beacon.interval_s + 1e-3
            due_s = min(due_s, max(self._late_s(parent), again_s))
        if self._courier.holds:
            due_s = min(due_s, self._retry_s)
        if self._states is not None and not self._states.connected:
            due_s = min(due_s, self._check_s)
        due_s = min(due_s, self._proofs.next_s)
        self._deadlines.set(Due.ROUTING, max(due_s, routes.now_s))

    # Beacons ---------------------------------------------------------------------------------

    def _send_beacon(self) -> None:
        routes, basics, now_s = self._routes, self._basics, self._routes.now_s
        self._trickle.sent(now_s)
        self._sent += 1
        self._turn = basics.rng.random()
        if routes.is_root:
            routes.next_number()
        beacon = Beacon(
            routes.gateway if routes.hops != NO_ROUTE else NO_ROUTE,
            routes.number,
            routes.hops,
            routes.parent,
            routes.ancestors,
            self._trickle.interval_s,
            routes.motion,
            self._gateway_place(),
            basics.frame.digest if self._asks or self._is_digests_turn() else 0,
            self._asks or routes.hops == NO_ROUTE,
            offline=routes.offline,
        )
        self._asks = False
        if beacon.room_below(self._room) < 0:  # a seal leaves room for one of the two
            beacon = beacon._replace(motion=None)
        elif beacon.room_below(self._room) < len(routes.below()) and self._sent % 2 == 0:
            beacon = beacon._replace(motion=beacon.motion if self._room > SEALED_ROOM else None)
        below = routes.to_announce(beacon.room_below(self._room))
        beacon = beacon._replace(below=below)
        near = routes.to_show(beacon.room_near(self._room))
        body = beacon._replace(near=near).to_body(self._room)
        if beacon.motion is not None:
            self._shown = now_s, beacon.motion
        self._broadcast(MessageType.BEACON, self._me, body)

    def _is_digests_turn(self) -> bool:
        """With a seal, a beacon has room for it and the gateway's place, or for its own place."""
        turn = 0 if self._room <= SEALED_ROOM else 1
        return self._sent % DIGEST_EVERY == turn

    def _gateway_place(self) -> Location | None:
        """The gateway's place, if it is this beacon's turn to spread it."""
        place, told = self._heard_place, self._told_place
        if self._routes.is_root or place is None:
            return None
        every = GATEWAY_PLACE_EVERY
        if told is None or told.distance_m(place) > self._step_m:
            every = 2 if self._room <= SEALED_ROOM else 1  # with a seal, instead of its own
        if self._sent % every:
            return None
        self._told_place = place
        return place

    def _broadcast(self, kind: int, creator: int, body: bytes) -> None:
        self._antenna.broadcast_message(
            messages.packet(kind, creator, self._me, BROADCAST, BROADCAST, body)
        )

    def receive_beacon(self, payload: bytes, creator: int, from_: int) -> None:
        """A neighbour's beacon."""
        if creator != from_:
            return
        self._set_time()
        routes, now_s = self._routes, self._routes.now_s
        if self._basics.complaints.is_foreign(creator, now_s):  # readable, but it takes no packets
            self._basics.complaints.dropped("a beacon of another mesh", payload, now_s)
            return
        beacon = Beacon.from_body(payload[self._body], self._motion.region)
        if beacon is None:
            self._basics.complaints.dropped("a damaged beacon", payload, now_s)
            return
        if beacon.digest:
            self._basics.heard_origin(creator, beacon.digest)
        if self._basics.frame.refuses(creator):
            beacon = beacon._replace(motion=None, gateway_place=None)
        elif beacon.motion is not None and not self._is_in_reach(beacon.motion.place):
            reason = "a neighbour's place that is out of reach"
            self._basics.complaints.add(reason, beacon.motion.place.in_words(), now_s)
            beacon = beacon._replace(motion=None)
        is_quiet = now_s < self._look_s and not routes.is_news(creator, beacon)
        is_new = routes.heard(creator, beacon)
        self._take_place(creator, beacon)
        if self._courier.holds or not is_quiet:  # few beacons
            self._consider(creator, beacon, is_new)
        self._take_gateway_place(creator, beacon)

    def _is_in_reach(self, place: Location) -> bool:
        own = self._routes.motion
        return own is None or own.place.distance_m(place) <= LUCKY * self._basics.range_m

    def _consider(self, creator: int, beacon: Beacon, is_new: bool) -> None:
        """What a neighbour's beacon changes."""
        routes, now_s = self._routes, self._routes.now_s
        self._look_s = now_s + LOOK_S
        self._basics.neighbours.named(beacon.named(), now_s)
        if is_new:
            self._trickle.reset(now_s)
        if routes.has_news and not routes.is_root:
            self._trickle.hurry(now_s)
        self._choose()
        if creator == routes.parent:
            self._show()
        if beacon.looks and routes.hops != NO_ROUTE:
            self._trickle.answer(now_s, alone=False)
        if self._courier.holds:
            self._courier.retry()
        self._plan()

    def _take_place(self, node: int, beacon: Beacon) -> None:
        neighbours = self._basics.neighbours
        neighbours.set_hops(node, beacon.hops)
        if beacon.gateway <= MAX_NODE_ID:
            neighbours.set_gateway(node, beacon.gateway)
        if beacon.motion is not None:
            neighbours.set_place(node, beacon.motion.place, self._routes.now_s)

    def _take_gateway_place(self, node: int, beacon: Beacon) -> None:
        """Where the gateway is, as it says itself or the parent does."""
        places, now_s, place = self._basics.places, self._routes.now_s, beacon.gateway_place
        if node == self._routes.gateway:
            place = None if beacon.motion is None else beacon.motion.place
        elif node != self._routes.parent:
            return
        if place is None or not self._basics.may_be_at(place, gateway=True):
            return
        self._heard_place = place
        if not self._proofs.has_key:
            places.update_gateway(place, now_s)
            return
        # Any node with the key can send a beacon in another's name; only an answer has a proof.
        places.hear_of_gateway(place, now_s, connected=False)
        if places.gateway is not None and places.gateway.distance_m(place) > self._step_m:
            self._proofs.ask_soon()

    def receive_probe(self, payload: bytes, creator: int, from_: int) -> None:
        """The radio has acknowledged it; a beacon spares the other children the same question."""
        self._set_time()
        self._trickle.answer(self._routes.now_s, alone=True)
        self._plan()

    def receive_heartbeat(self, payload: bytes, creator: int, from_: int) -> None:
        """A node tells this gateway the nonce of its seals, or the gateway answers."""
        self._set_time()
        self._proofs.heard(payload, creator)
        self._plan()

    # Packets ---------------------------------------------------------------------------------

    def _learn(self, creator: int, from_: int, kind: int, payload: bytes) -> bool:
        routes = self._routes
        routes.now_s = self._deadlines.now_s
        routes.alive(from_)
        if creator != from_:
            routes.led_to(creator, from_)
        return True

    def own_came_back(self, from_: int) -> None:
        """The courier sends it another way."""
        self._routes.now_s = self._deadlines.now_s
        self._routes.alive(from_)

    def says_connected(self, kind: int, payload: bytes) -> bool:
        """Whether it is the beacon of a connected node."""
        return kind == MessageType.BEACON and names_gateway(payload)

    def on_delivered(self, neighbour: int, tries: int) -> None:
        """It is alive."""
        self._routes.now_s = self._deadlines.now_s
        self._routes.alive(neighbour)

    def on_undelivered(self, payload: bytes, tries: int) -> None:
        """Send it another way."""
        self._set_time()
        self._courier.undelivered(payload)
        self._plan()

    def _failed(self, node: int) -> None:
        """A neighbour did not take a packet: do without it until it is heard again."""
        self._routes.now_s = self._deadlines.now_s
        self._routes.failed(node)
        if node == self._routes.parent:
            self._choose()
            self._plan()

    def _lost(self, node: int) -> None:
        if self._basics.neighbours.lost(node, self._routes.now_s):
            self._left(node)
        else:
            self._host.on_neighbour_lost(node)

    def _left(self, node: int) -> None:
        self._basics.report(MeshEventKind.NEIGHBOUR_LOST, node)
        self._host.on_neighbour_lost(node)

    def _verdict(self, transit: Transit) -> int:
        """The next hop of a packet, HOLD or DROP."""
        routes = self._routes
        routes.now_s = now_s = self._deadlines.now_s
        is_up = transit.addressee == routes.gateway
        ways = routes.next_hops(transit.addressee, transit.came_from)
        for to, shown_s in ways if is_up or len(transit.sent_s) < MOST_WAYS else ways[:1]:
            if to == transit.came_from or shown_s <= transit.sent_s.get(to, -math.inf):
                continue
            failed_s = transit.failed_s.get(to)
            if failed_s is None or routes.neighbours[to].alive_s > failed_s:
                return to
        if now_s - transit.seen_s >= HELD_S or transit.kind in NOT_HELD:
            return DROP
        if not is_up:
            is_own = transit.came_from == NO_ROUTE
            if not is_own and now_s - transit.seen_s >= SEARCHES_S and self._may_return(transit):
                return transit.came_from
            self._searches.search(transit.addressee, MOST_HOPS if is_own else HOPS_AROUND)
        if self._retry_s <= now_s:
            self._retry_s = now_s + RETRY_S
        due_s = min(self._retry_s, self._deadlines.get(Due.ROUTING))
        self._deadlines.set(Due.ROUTING, due_s)
        return HOLD

    def _may_return(self, transit: Transit) -> bool:
        """Whether the sender of a packet, who may know another way, can get it back."""
        to = transit.came_from
        return (
            to in self._routes.neighbours
            and to not in transit.sent_s
            and to not in transit.failed_s
        )

    def _retry(self, now_s: float) -> None:
        self._retry_s = now_s + RETRY_S
        self._courier.retry()

    # Searches --------------------------------------------------------------------------------

    def search(self, node: int) -> bool:
        """A packet for a node without a route is held, and searched for by itself."""
        return False

    def receive_search(self, payload: bytes, creator: int, from_: int) -> None:
        """Another node looks for one."""
        self._set_time()
        if self._searches.heard(creator, from_, messages.body(payload)):
            me, found = self._me, Found(Search.from_body(messages.body(payload)).node)
            body = found.to_body()
            self._courier.send_own(
                messages.packet(MessageType.FOUND, me, me, creator, creator, body)
            )

    def receive_found(self, payload: bytes, creator: int, from_: int) -> None:
        """A node that was looked for is that way."""
        self._set_time()
        node = Found.from_body(messages.body(payload)).node
        self._searches.found(node)
        self._routes.led_to(node, from_)
        self._courier.retry()
        self._plan()

    # The connection --------------------------------------------------------------------------

    @property
    def gateway(self) -> int:
        """The preferred gateway."""
        return self._routes.gateway

    @property
    def hops(self) -> int:
        """Hops to it; NO_ROUTE also if it has no internet."""
        return NO_ROUTE if self._routes.offline else self._routes.hops

    def next_hop(self) -> int:
        """The parent."""
        return self._routes.parent

    def heard_s(self, node: int) -> float:
        """When a packet of it came last over a relay, or a relay named it."""
        return self._routes.led_s(node)

    def may_use(self, gateway: int) -> bool:
        """Whether it is the preferred one."""
        return gateway == self._routes.gateway

    def end(self, event: RouterEvent) -> None:
        """A flight or an election begins or ends: the connection is what the beacons say."""
        if self._states is None:
            return
        self._states.happened(event)
        reached = self._routes.parent != NO_ROUTE and not self._routes.offline
        if reached and event is not RouterEvent.ANTENNA_OFF:
            self._states.happened(RouterEvent.GATEWAY_ANSWERED)

    def give_up_routes(self) -> None:
        """There are none."""


class BeaconTechnique(IControlTechnique):
    """The technique `beacon`, by name."""

    connection_lost_after_s = 10.0  # it notices a loss within seconds

    def control_plane(
        self, basics: NodeBasics, host: IControlHost, states: RouterStates | None
    ) -> BeaconPlane:
        """The control plane of one node."""
        return BeaconPlane(basics, host, states)
