"""BeaconPlane: the control plane of one node by beacons (docs/beacons.md, "Beacons")."""

from __future__ import annotations

import math
from typing import Final

from drone_mesh.communication.beacon.connection import Connection, Proofs
from drone_mesh.communication.beacon.courier import Courier, QueuedCourier
from drone_mesh.communication.beacon.neighbour import LUCKY, Neighbour
from drone_mesh.communication.beacon.own_beacons import NodesBelow, OwnBeacons, OwnMotion
from drone_mesh.communication.beacon.packets import (
    READER,
    Beacon,
    Found,
    Search,
    named_nodes,
    names_gateway,
)
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.beacon.times import ParentWatch, Trickle
from drone_mesh.communication.beacon.verdicts import Searches, Verdicts
from drone_mesh.communication.control.control_plane import (
    ControlledNode,
    IControlPlane,
    IControlTechnique,
)
from drone_mesh.communication.control.node_part import due, receives
from drone_mesh.communication.control.places import PlaceRequests
from drone_mesh.communication.control.router_states import RouterEvent
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.interfaces import BROADCAST, NO_ROUTE
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.timing import Due
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import metres_between

LOOK_S: Final = 0.2  # links change that slowly
BIDS_WITHIN_S: Final = 3.0  # routers that lose one parent notice it within two intervals
WITHOUT_BEACONS_S: Final = 5.0  # three of the longest intervals
MOVED: Final = 0.05  # of the range: a drone further from where it stood flies; from where the
# others expect it, it has turned
FLIES_M_S: Final = 0.3  # faster than the place of a drone at rest drifts
DEAF_AGAIN_S: Final = 10.0  # a neighbour that does not hear this node is asked so often
DRIVER_TRIES: Final = 4  # per hop: more delay the packet, which another neighbour may take at once


class BeaconPlane(IControlPlane):
    """Neighbours, connection and routes of one node by beacons."""

    def __init__(self, node: ControlledNode) -> None:
        self._host = node.host
        self._me, self._antenna, self._deadlines = node.node_id, node.antenna, node.deadlines
        self._report, self._complaints = node.report, node.complaints
        self._places, self._frame, self._claims = node.places, node.frame, node.claims
        medium, states, is_gateway = node.antenna.medium, node.states, node.states is None
        self._range_m, check_s = node.range_m, node.timing.check_period_s
        self.neighbours = self._neighbours = Neighbours(medium, check_s, node.range_m)
        self.bids_within_s = medium.stretched(BIDS_WITHIN_S)
        self._routes = self.routes = BeaconRoutes(
            self._me,
            is_gateway,
            node.range_m,
            self._neighbours.place_of,
            medium.policy.one_loss_counts,
            node.deadlines,
            node.seals.may_be_gateway,
        )
        self._step_m = MOVED * node.range_m
        self._motion = OwnMotion(node.pilot.place, self._step_m)
        self._below = NodesBelow(self._me, self._routes)
        self._own = OwnBeacons(
            node.seals, node.frame, self._routes, self._below, self._motion, self._step_m
        )
        self._body_end = messages.HEADER_BYTES + self._own.room
        self._trickle = Trickle(medium, node.rng)
        self._searches = Searches(self._me, self._routes, self._broadcast, medium.hop_s)
        self._verdicts = Verdicts(self._routes, self._searches, self._deadlines)
        carry = QueuedCourier if medium.policy.queued else Courier
        self._courier = self.delivery = carry(
            self._me,
            self._antenna,
            self._deadlines,
            node.timing.send_attempts,
            self._verdicts.verdict_on,
            self._took,
            self._failed,
            lambda from_, other: self._routes.leads_not_to(other, from_),
            node.seals.without_proof,
        )
        self._proofs = Proofs(
            self._me,
            is_gateway,
            self._routes,
            self._courier,
            PlaceRequests(self._me, node.pilot, node.antenna, self._courier, node.deadlines),
            node.places,
            node.seals,
            node.complaints,
            node.antenna,
            node.rng,
        )
        self._watch = ParentWatch(self._routes, medium.hop_s, node.rng)
        self._states = states
        self._connection = None
        if states is not None:
            report, places, antenna = node.report, node.places, node.antenna
            self._connection = Connection(
                node.host, states, self._routes, self._motion, places, antenna, report
            )
        self._look_s = -math.inf  # when it looks at everything anew, whatever a beacon says
        self.learn = self._learn
        self.forward = self._courier.forward

    # Time and surroundings -------------------------------------------------------------------

    def start(self) -> None:
        """Send the first beacon, each node at another moment."""
        self._set_time()
        self._antenna.limit_tries(DRIVER_TRIES)
        self._trickle.start(self._routes.now_s)
        self._plan()

    @due(Due.ROUTING)
    def on_due(self) -> None:
        self._set_time()
        now_s = self._routes.now_s
        self._look_round()
        if self._courier.holds and now_s >= self._verdicts.retry_s:
            self._verdicts.retries()
            self._courier.retry()
        if now_s >= self._trickle.due_s:
            self._send_beacon()
        self._proofs.on_time()
        self._plan()

    def on_power(self, on: bool) -> None:
        """Ask for the beacons of the neighbours; forget them when the antenna is off."""
        self._set_time()
        if on:
            self._own.asks = True
            self._trickle.start(self._routes.now_s)
        else:
            self._routes.neighbours.clear()
            self._neighbours.forget_all()  # it is this node that has fallen silent
            self._look_round()
        self._plan()

    def on_registered(self) -> None:
        """Ask for the beacons of the neighbours."""
        if self._antenna.on():
            self.on_power(True)

    def on_internet(self, works: bool) -> None:
        """Tell the neighbours soon, in the next beacon."""
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

    def _look_round(self) -> None:
        """Forget who is silent, choose the parent, tell the node what has changed."""
        routes, heard, now_s = self._routes, self._neighbours, self._routes.now_s
        for node in routes.expired():
            self._trickle.reset(now_s)
            self._gone(node, heard.lost(node, now_s))
        deaf = heard.deaf()  # mostly nobody
        for node in deaf and deaf.intersection(routes.neighbours):
            neighbour = routes.neighbours[node]
            if now_s - neighbour.doubted_s >= DEAF_AGAIN_S:
                neighbour.doubted_s = now_s
                self._probe(node)
        for node in heard.ids().difference(routes.neighbours):  # it has sent other packets
            if now_s - heard.last_heard_s(node, now_s) > WITHOUT_BEACONS_S:
                heard.forget(node)
                self._gone(node, was_neighbour=True)
        parent = routes.neighbours.get(routes.parent)
        if parent is not None and self._watch.is_due(parent):
            self._probe(parent.node)
        self._choose()
        if self._connection is not None:
            self._connection.check()

    def _probe(self, to: int) -> None:
        me = self._me
        self._courier.send(messages.packet(MessageType.PROBE, me, me, to, to), to)

    def _choose(self) -> None:
        routes = self._routes
        gateway, parent, shown = routes.gateway, routes.parent, routes.shown
        if not routes.choose():
            if self._connection is not None:
                self._connection.tell_repair()
            return
        if routes.parent != parent:
            self._watch.has_new_parent()
            self._proofs.has_new_parent()
            if self._connection is not None:
                self._connection.has_new_parent()
        if routes.shown != shown:
            self._trickle.hurry(routes.now_s)
        else:
            self._trickle.reset(routes.now_s)
        self._gateway_was(gateway)
        self._show()

    def _gateway_was(self, before: int) -> None:
        """Report another gateway than `before`, and forget the place of that one."""
        gateway = self._routes.gateway
        if before not in (gateway, NO_ROUTE):
            self._report(MeshEventKind.GATEWAY_CHANGED, gateway)
            self._places.forget_gateway()
            self._routes.gateway_place = None
            self._proofs.begin()

    def _show(self) -> None:
        """Tell the router whether a gateway is reached."""
        if self._connection is not None and self._connection.show():
            self._proofs.connected()

    def _set_time(self) -> None:
        now_s = self._deadlines.now_s
        self._routes.motion = motion = self._motion.at(now_s)
        if motion is not None and self._own.mislead(motion):
            self._motion.has_turned(now_s)
            self._look_s = now_s
            self._trickle.hurry(now_s)

    def _plan(self) -> None:
        """Schedule the next call of `on_due`."""
        routes = self._routes
        due_s = min(self._trickle.due_s, self._proofs.next_s)
        parent = routes.neighbours.get(routes.parent)
        if parent is not None:
            due_s = min(due_s, self._watch.due_s(parent))
        if self._courier.holds:
            due_s = min(due_s, self._verdicts.retry_s)
        if self._connection is not None:
            due_s = min(due_s, self._connection.due_s)
        due_s = min(due_s, routes.first_end_s(due_s) + 1e-3)
        self._deadlines.set(Due.ROUTING, max(due_s, routes.now_s))

    # Beacons ---------------------------------------------------------------------------------

    def _send_beacon(self) -> None:
        self._trickle.sent(self._routes.now_s)
        self._watch.draw_turn()
        body = self._own.next_body(self._trickle.interval_s)
        self._broadcast(MessageType.BEACON, self._me, body)

    def _broadcast(self, kind: int, creator: int, body: bytes) -> None:
        self._antenna.broadcast_message(
            messages.packet(kind, creator, self._me, BROADCAST, BROADCAST, body)
        )

    @receives(MessageType.BEACON)
    def on_beacon(self, payload: bytes, creator: int, from_: int) -> None:
        if creator != from_:
            return
        self._set_time()
        routes, now_s = self._routes, self._routes.now_s
        if self._complaints.is_foreign(creator, now_s):  # readable, but it takes no packets
            self._complaints.dropped("a beacon of another mesh", payload, now_s)
            return
        body = payload[messages.HEADER_BYTES : self._body_end]
        beacon = READER.read(body, self._motion.region)
        if beacon is None:
            self._complaints.dropped("a damaged beacon", payload, now_s)
            return
        if beacon.digest:
            self._claims.heard_origin(creator, beacon.digest)
        own, told = routes.motion, beacon.motion
        if self._frame.refuses(creator):
            beacon = beacon._replace(motion=None, gateway_place=None)
        elif own and told and metres_between(own.place, told.place) > LUCKY * self._range_m:
            reason = "a neighbour's place that is out of reach"
            self._complaints.add(reason, told.place.in_words(), now_s)
            beacon = beacon._replace(motion=None)
        longest_s = self._trickle.longest_s
        if beacon.interval_s > longest_s:  # who promises it could fall silent and stay the way
            beacon = beacon._replace(interval_s=longest_s)
        is_quiet = now_s < self._look_s and not routes.is_news(creator, beacon)
        self._below.heard(creator, beacon)
        is_new = routes.heard(creator, beacon)
        neighbour = routes.neighbours[creator]
        if not neighbour.deaf:
            self._neighbours.hears(creator)
        self._take_place(neighbour, beacon)
        if self._courier.holds or not is_quiet:  # few beacons
            self._consider(creator, beacon, is_new)
        self._take_gateway_place(creator, beacon)

    def _consider(self, creator: int, beacon: Beacon, is_new: bool) -> None:
        """Update what depends on a neighbour's new beacon."""
        routes, now_s = self._routes, self._routes.now_s
        self._look_s = now_s + LOOK_S
        self._neighbours.note_known_elsewhere(named_nodes(beacon), now_s)
        if is_new:
            self._trickle.reset(now_s)
        if self._below.has_news and not routes.is_root:
            self._trickle.hurry(now_s)
        self._choose()
        if creator == routes.parent:
            self._show()
        if beacon.parent == self._me:
            self._host.on_leads(creator)
        elif beacon.looks:
            self._host.on_looks(creator)
        if beacon.looks and routes.hops != NO_ROUTE:
            self._trickle.answer(now_s, alone=False)
        if self._courier.holds:
            self._courier.retry()
        self._plan()

    def _take_place(self, neighbour: Neighbour, beacon: Beacon) -> None:
        neighbours, node = self._neighbours, neighbour.node
        neighbours.set_hops(node, beacon.hops)
        if beacon.motion is not None:
            place, velocity = beacon.motion
            neighbours.passes(node, place, self._routes.now_s)
            north, east, up = velocity
            flies = math.sqrt(north * north + east * east + up * up) > FLIES_M_S
            neighbour.at_rest = neighbours.at_rest(node, place, flies)

    def _take_gateway_place(self, node: int, beacon: Beacon) -> None:
        """Store the gateway's place from its own beacon or the parent's."""
        places, now_s, place = self._places, self._routes.now_s, beacon.gateway_place
        is_gateway, goal = node == self._routes.gateway, None
        if is_gateway:
            goal = self._neighbours.goal_of(node, now_s)  # it is followed there
            place = None if beacon.motion is None else self._routes.neighbours[node].at_rest
        elif node != self._routes.parent:
            return
        says_so = is_gateway and goal is None
        place = goal or place
        if place is None or not self._claims.may_be_at(place, gateway=True, says_so=says_so):
            return
        self._routes.gateway_place = place
        if not self._proofs.has_key:
            places.update_gateway(place, now_s)
            return
        # Any node with the key can send a beacon in another's name; only an answer has a proof.
        places.hear_of_gateway(place, now_s, connected=False)
        if places.gateway is not None and places.gateway.distance_m(place) > self._step_m:
            self._proofs.ask_soon()

    @receives(MessageType.PROBE)
    def on_probe(self, payload: bytes, creator: int, from_: int) -> None:
        """Answer a probe by a beacon, so that the other children need not ask, too."""
        self._set_time()
        self._trickle.answer(self._routes.now_s, alone=True)
        self._plan()

    @receives(MessageType.HEARTBEAT)
    def on_heartbeat(self, payload: bytes, creator: int, from_: int) -> None:
        """A node tells this gateway the nonce of its seals, or the gateway answers."""
        self._set_time()
        self._proofs.heard(payload, creator)
        self._plan()

    # Packets ---------------------------------------------------------------------------------

    def _learn(self, creator: int, from_: int, kind: int, payload: bytes) -> bool:
        routes = self._routes
        routes.alive(from_)
        if creator != from_ and kind != MessageType.SEARCH:  # all repeat it: the first one counts
            self._verdicts.hears(creator, from_)
            routes.led_to(creator, from_)
        return True

    def own_came_back(self, from_: int) -> None:
        """Note that `from_` is alive; the courier sends the packet another way."""
        self._routes.alive(from_)

    def says_connected(self, kind: int, payload: bytes) -> bool:
        """Whether it is the beacon of a connected node."""
        return kind == MessageType.BEACON and names_gateway(payload)

    def on_delivered(self, neighbour: int, tries: int) -> None:
        """Note that the neighbour is alive and hears this node."""
        self._took(neighbour)

    def on_undelivered(self, payload: bytes, tries: int) -> None:
        """Send it another way."""
        self._set_time()
        self._courier.undelivered(payload)
        self._plan()

    def _failed(self, node: int) -> None:
        """A neighbour did not take a packet: do without it until it is heard again."""
        if self._routes.failed(node):
            self._gone(node, self._neighbours.is_deaf(node))
        if node == self._routes.parent:
            self._choose()
            self._plan()

    def _took(self, node: int) -> None:
        """A neighbour acknowledged a packet."""
        routes = self._routes
        was_proved = routes.is_proved
        routes.took(node)
        self._neighbours.hears(node)
        if routes.is_proved and not was_proved:
            self._trickle.hurry(routes.now_s)  # it leads to the gateway
            self._show()
            self._plan()

    def _gone(self, node: int, was_neighbour: bool) -> None:
        if was_neighbour:
            self._report(MeshEventKind.NEIGHBOUR_LOST, node)
        self._host.on_neighbour_lost(node)

    # Searches --------------------------------------------------------------------------------

    @receives(MessageType.SEARCH)
    def on_search(self, payload: bytes, creator: int, from_: int) -> None:
        self._set_time()
        if self._searches.heard(creator, from_, messages.body(payload)):
            me, body = self._me, Found(Search.from_body(messages.body(payload)).node).to_body()
            self._courier.send_own(
                messages.packet(MessageType.FOUND, me, me, creator, creator, body)
            )

    @receives(MessageType.FOUND)
    def on_found(self, payload: bytes, creator: int, from_: int) -> None:
        """Note that a node that was searched for is reached through `from_`."""
        self._set_time()
        node = Found.from_body(messages.body(payload)).node
        self._searches.found(node)
        self._routes.led_to(node, from_)
        self._courier.retry()
        self._plan()

    # The connection --------------------------------------------------------------------------

    @property
    def gateway(self) -> int:
        return self._routes.gateway

    @property
    def hops(self) -> int:
        """Hops to the gateway; NO_ROUTE if it has no internet or does not hear this node."""
        _gateway, hops, offline = self._routes.shown
        return NO_ROUTE if offline else hops

    @property
    def connected(self) -> bool:
        """Whether the gateway is reached in both directions."""
        return self.hops != NO_ROUTE if self._states is None else self._states.connected

    def next_hop(self) -> int:
        """The parent."""
        return self._routes.parent

    def heard_s(self, node: int) -> float:
        """When a relay last brought a packet of `node` or named it."""
        return max(self._routes.led_s(node), self._below.known_s(node))

    def leave(self) -> None:
        """Lead nobody to the gateway until the flight is over."""
        self._set_time()
        self._routes.leaves = True
        self._show()
        self._trickle.hurry(self._routes.now_s)
        self._plan()

    def end(self, event: RouterEvent) -> None:
        """A flight or an election begins or ends: the connection is what the beacons say."""
        if event is RouterEvent.LANDED:
            self._routes.leaves = False
        if self._connection is not None:
            self._connection.end(event)


class BeaconTechnique(IControlTechnique):
    """The technique `beacon`, by name."""

    connection_lost_after_s = 10.0  # it notices a loss within seconds

    def control_plane(self, node: ControlledNode) -> BeaconPlane:
        return BeaconPlane(node)
