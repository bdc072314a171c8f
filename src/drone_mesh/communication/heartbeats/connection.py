"""GatewayConnection: how a router finds, keeps and assesses its gateway.

docs/protocol.md, "Connection"; docs/repair.md, "Places to step back to".
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from typing import Callable, NamedTuple

from drone_mesh.communication.control.places import KnownPlaces, PlaceRequests
from drone_mesh.communication.control.router_states import (
    ConnectionState,
    RouterEvent,
    RouterStates,
)
from drone_mesh.communication.events.observer import MeshEventKind, Reporter, in_hops
from drone_mesh.communication.heartbeats.delivery import Delivery
from drone_mesh.communication.heartbeats.detours import AVOIDED_S, Detours, RelayCheck
from drone_mesh.communication.heartbeats.introduction import Introduction
from drone_mesh.communication.interfaces import MAX_NODE_ID, NO_ROUTE
from drone_mesh.communication.neighbours import FLIGHT_S, Neighbours
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.timing import Deadlines, Due, Medium

_HOPS_UNTIL_KNOWN = 10  # the number of hops for which to wait for the first answer
RESIGNED_PERIODS = 2.5  # a gateway without internet that is silent for longer is lost
NONCE_PERIODS = 5.0  # a gateway's nonce is valid for two minutes after it was told
LONGER = 1.5  # wait after each answer that did not come: more heartbeats would only delay them more
MAX_AGE_PERIODS = 3  # docs/repair.md, "Places to step back to": of the gateway's place


class Shortcut(NamedTuple):
    """A neighbour that presented itself with fewer hops than the route in use."""

    neighbour: int
    hops: int


@dataclass(eq=False)
class GatewayConnection:
    """The preferred gateway of one router, the hops to it, and whether it answers.

    It drives the `ConnectionState` of the router's states.
    """

    _node_id: int
    _states: RouterStates
    _technique: IRoutingTechnique
    _delivery: Delivery
    _introduction: Introduction
    _requests: PlaceRequests
    _medium: Medium
    _deadlines: Deadlines
    _check_period_s: float
    _neighbours: Neighbours
    _places: KnownPlaces
    _report: Reporter
    _has_key: bool
    _patience: Callable[[], float]  # of the antenna, in check periods
    _rng: random.Random

    def __post_init__(self) -> None:
        self.gateway = NO_ROUTE  # the preferred one
        self.hops = NO_ROUTE
        self._heartbeat_sent_s = -math.inf
        self._answered_s = -math.inf
        self._answered_itself_s = -math.inf  # this router, and not only one behind it
        self.just_lost = False  # the last route failed since the last check
        self._shown_connected = False
        self._shortcut: Shortcut | None = None
        self._tried = NO_ROUTE  # the neighbour of the latest heartbeat's shortcut or detour
        self._detours = Detours(self._neighbours)
        is_needed = self._has_key and self._technique.TAKES_SHORTCUTS
        self._relay_check = RelayCheck(
            self._node_id,
            is_needed,
            self._check_period_s,
            self._medium.policy.one_loss_counts,
            self._deadlines,
            self._requests,
            self._detours,
        )
        self.swallowing = self._relay_check.swallowing
        self._unanswered = 0  # heartbeats in a row
        self._missed = 0  # answers in a row to heartbeats that left, while it was not connected
        self._asked_neighbour_s = -math.inf  # for its gateway
        self._moved = False  # since the gateway was last asked for its place
        self._resigned_s = -math.inf  # when the preferred gateway said that it is none now

    @property
    def connected(self) -> bool:
        """Whether the gateway answered the last heartbeat, or may still answer."""
        return self._states.connected

    def next_hop(self) -> int:
        """The next hop to the preferred gateway, or NO_ROUTE."""
        if self.gateway == NO_ROUTE:
            return NO_ROUTE
        return self._technique.get_direction_to_node(self.gateway)

    def told_of_gateway(self, gateway: int) -> bool:
        """Whether `gateway` is the preferred one. If there is none yet, it becomes that."""
        if self.gateway == NO_ROUTE and gateway <= MAX_NODE_ID and gateway != self._node_id:
            self.gateway = gateway
        return gateway == self.gateway

    # Heartbeats out --------------------------------------------------------------------------

    def send_heartbeat(self) -> bool:
        """Send a heartbeat to the preferred gateway, unless one is under way. False: not sent."""
        now_s, gateway = self._deadlines.now_s, self.gateway
        window_s = self._answer_window_s()
        if now_s - self._heartbeat_sent_s < window_s:
            return True
        was_connected = self._states.connected
        self._states.happened(RouterEvent.HEARTBEAT_SENT)
        self._deadlines.set(Due.ANSWER, now_s + window_s)
        self._heartbeat_sent_s = now_s
        if self._sent_over_detour(was_connected) or self._sent_over_shortcut(was_connected):
            return True
        heartbeat = self._introduction.heartbeat(gateway, gateway, was_connected, gateway)
        if self._delivery.send_own(heartbeat):
            return True
        if self._states.awaiting:  # otherwise the loss of the route has been noticed
            self._heartbeat_sent_s = -math.inf
            self.answer_missed()
        return False

    def _sent_over_shortcut(self, connected: bool) -> bool:
        """Send the heartbeat through a neighbour with fewer hops; returns whether that suffices.

        The fewer hops may lead to another gateway. In that case the neighbour's gateway is asked as
        well, and its answer decides, because the neighbour might send a heartbeat for this node's
        gateway straight back.
        """
        shortcut, self._shortcut = self._shortcut, None
        if shortcut is None or shortcut.hops + 1 >= self.hops:
            return False
        to = shortcut.neighbour
        if self._neighbours.hops_of(to) > shortcut.hops:
            return False  # it has been rerouted since
        its_gateway = self._neighbours.gateway_of(to)
        if its_gateway == NO_ROUTE:
            its_gateway = self.gateway
        heartbeat = self._introduction.heartbeat(to, its_gateway, connected, self.gateway)
        if not self._delivery.send(heartbeat, to) or its_gateway != self.gateway:
            return False
        self._tried = to
        return True

    def _sent_over_detour(self, connected: bool) -> bool:
        """Send the heartbeat around a next hop that swallows. The answer changes the route."""
        to = self._relay_check.take_detour()
        if to == NO_ROUTE:
            return False
        heartbeat = self._introduction.heartbeat(to, self.gateway, connected, self.gateway)
        if not self._delivery.send(heartbeat, to):
            return False
        self._tried = to
        return True

    def answer_missed(self) -> None:
        """The gateway did not answer in time.

        It is asked again if the medium is lossy, or if the heartbeat took a shortcut or a detour:
        the route in use may still work. The neighbour that led to no answer is avoided for a while.
        """
        tried, self._tried = self._tried, NO_ROUTE
        was_connected = self._states.connected
        if tried == NO_ROUTE:
            self._unanswered += 1
        else:
            self._detours.avoid(tried, self._deadlines.now_s + AVOIDED_S)
        may_answer = tried != NO_ROUTE or self._unanswered < self._medium.heartbeats
        if was_connected and may_answer:
            self._heartbeat_sent_s = -math.inf
            self.send_heartbeat()
            return
        self._unanswered = 0
        self._missed += self._heartbeat_sent_s > -math.inf and not was_connected
        self._states.happened(RouterEvent.ANSWER_MISSED)
        self._show()
        if was_connected:
            self._introduction.broadcast()  # neighbours that know another route answer

    def on_route_lost(self) -> None:
        """A route failed. If it was the only one to the gateway, look for another one at once.

        If neighbours are asked in turn, first through the one that presented itself as nearest to a
        gateway; otherwise all are asked. One that led nowhere is given up at once.
        """
        connection = self._states.connection
        if self.next_hop() != NO_ROUTE:
            return
        if not self._medium.policy.asks_in_turn:
            if connection is ConnectionState.CONNECTED:
                self.end(RouterEvent.ROUTE_LOST)
                self.just_lost = True
                self._introduction.broadcast()
            elif connection is ConnectionState.AWAITING_FIRST_ANSWER:
                self.end(RouterEvent.ROUTE_LOST)
        elif self._states.connected:
            another = self.another_next_hop(NO_ROUTE)
            if another != NO_ROUTE:
                self._technique.other_can_communicate_with_node(another, self.gateway)
            self._heartbeat_sent_s = -math.inf
            self.send_heartbeat()

    def doubt_next_hop(self) -> None:
        """A neighbour cannot reach the next hop, which may have left unheard: try it at once."""
        periods = min(1.0, self._patience())  # however rarely a busy channel is asked otherwise
        since_s = self._deadlines.now_s - periods * self._check_period_s
        is_doubted = self._answered_s <= since_s
        if self._medium.policy.checks_soon and self._states.connected and is_doubted:
            self.send_heartbeat()

    def another_next_hop(self, but: int) -> int:
        """A neighbour that may lead to the gateway, not `but`; NO_ROUTE: none is known."""
        if not self._technique.TAKES_SHORTCUTS:
            return NO_ROUTE
        return self._detours.nearest(but, self.hops, self._deadlines.now_s)

    # Reports of neighbours and gateways ------------------------------------------------------

    def neighbour_leaves(self, neighbour: int) -> None:
        """A neighbour flies away, and is in reach for some seconds more."""
        self._detours.leaves(neighbour, self._deadlines.now_s + FLIGHT_S)

    def passes_by_leaving(self, neighbour: int) -> bool:
        """Whether a neighbour flies away and another one has a gateway."""
        return self._detours.passes_by_leaving(neighbour, self._deadlines.now_s)

    def on_present(self, neighbour: int, hops: int, know_gateway: bool) -> bool:
        """A neighbour introduced itself. Returns whether to send it a heartbeat."""
        if neighbour == self.gateway and hops != 0:
            if not self._has_key:
                self.gateway_resigned()
            elif self._states.connected:  # any node with the key can say so: its answer proves it
                self.send_heartbeat()
        if know_gateway and hops and self.passes_by_leaving(neighbour):
            return False
        if know_gateway and hops <= self.hops:
            self._introduction.search_is_answered()
        connected = self._states.connected
        if know_gateway != connected:
            return connected or not (self._states.awaiting or self._asks_a_neighbour())
        if (
            connected
            and self._technique.TAKES_SHORTCUTS
            and hops + 1 < self.hops
            and (self._shortcut is None or hops < self._shortcut.hops)
            and not self._detours.avoids(neighbour, self._deadlines.now_s)
            and self._technique.get_direction_to_node(neighbour) == neighbour
        ):
            self._shortcut = Shortcut(neighbour, hops)
        return False

    def on_gateway_heartbeat(self, gateway: int, hops: int) -> bool:
        """A gateway is `hops` away. Returns whether that connected the router."""
        now_s = self._deadlines.now_s
        if gateway != self.gateway:
            recent = now_s - self._answered_s <= self._check_period_s
            if (self._states.connected or recent) and hops >= self.hops:
                return False
            self._prefer(gateway)
        is_new = not self._states.connected
        self.just_lost = False
        self._states.happened(RouterEvent.GATEWAY_ANSWERED)
        self.hops = min(hops, NO_ROUTE)
        self._answered_s = now_s
        self._resigned_s = -math.inf
        self._unanswered = self._missed = 0
        self._tried = NO_ROUTE
        self._show()
        if is_new:
            self._introduction.broadcast()
            self._ask_for_places()
            self._requests.tell_all()
        return is_new

    def take_gateway_of(self, neighbour: int, gateway: int) -> None:
        """Try the gateway of a neighbour; other routes to it have failed."""
        if gateway > MAX_NODE_ID or gateway == self._node_id:
            return
        if gateway == self.gateway and self._has_resigned(periods=1.0):
            return  # the neighbour has not heard of it yet
        if self._detours.passes_by(neighbour, self._deadlines.now_s):
            return
        self._prefer(gateway)
        self._delivery.gateway_taken(neighbour, gateway)
        self.send_heartbeat()

    def gateway_resigned(self) -> None:
        """The preferred gateway says that it is none now: look for another one."""
        self._resigned_s = self._deadlines.now_s
        was_connected = self._states.connected
        self.end(RouterEvent.ROUTE_LOST)
        if was_connected:
            self._introduction.broadcast()

    def asks_gateway_that_resigned(self) -> bool:
        """Whether the gateway is in reach and only without internet; asks it again if so."""
        if not self._has_resigned(RESIGNED_PERIODS):
            return False
        self.send_heartbeat()
        return True

    def _has_resigned(self, periods: float) -> bool:
        """Whether the preferred gateway said so within so many check periods."""
        return self._deadlines.now_s - self._resigned_s <= periods * self._check_period_s

    def proven(self) -> bool:
        """Whether the gateway has answered lately: on a busy channel it is asked less often.

        With a key, answers for others do not tell this router the gateway's nonce.
        """
        now_s, period_s = self._deadlines.now_s, self._check_period_s
        if self._has_key and now_s - self._answered_itself_s > NONCE_PERIODS * period_s:
            return False
        return self._answered_s > now_s - self._patience() * period_s

    def answered_itself(self) -> None:
        """The gateway has answered a heartbeat of this router."""
        self._answered_itself_s = self._deadlines.now_s

    def check(self) -> None:
        """The part of the periodic check for a connected router."""
        shows_way_back = self.swallowing.wants_heartbeat(self.hops)
        if shows_way_back:
            self.send_heartbeat()
        to, answered_s = self.next_hop(), self._answered_itself_s
        patience = self._patience()
        asked = self._relay_check.run(self.gateway, to, self.hops, answered_s, patience)
        if shows_way_back or self.proven():
            return
        fresh_periods = self._medium.place_periods
        self._ask_for_places(fresh_periods * self._check_period_s, asked)
        self.send_heartbeat()

    def _ask_for_places(self, fresh_s: float = 0.0, gateway_asked: bool = False) -> None:
        """Ask the next hop where it is, and the gateway if that is unknown or may have moved.

        `fresh_s`: a place that was reported within that time is known well enough, and that of a
        gateway farther away within 2 to 4 times as long: routers that connect together would
        otherwise ask together, all through the relays around it.
        `gateway_asked`: the gateway was asked a moment ago.
        """
        next_hop, places, now_s = self.next_hop(), self._places, self._deadlines.now_s
        enough_s = fresh_s
        if next_hop != self.gateway:  # relays report its place, too
            period_s = self._check_period_s
            spread = 1.0 + self._rng.random() if fresh_s else 1.0
            enough_s = max((MAX_AGE_PERIODS - 1) * period_s, 2.0 * spread * fresh_s)
        unsure = places.gateway is None or now_s - places.gateway_seen_s >= enough_s
        unsure = unsure or places.gateway_disputed
        if (unsure and not gateway_asked) or self._moved:  # the request tells where this node is
            self._moved = False
            self._requests.ask(self.gateway)
        is_old = next_hop != places.good_id or now_s - places.good_seen_s >= fresh_s
        if is_old and next_hop not in (self.gateway, NO_ROUTE):
            self._requests.ask(next_hop)

    # The end of a connection -----------------------------------------------------------------

    def end(self, event: RouterEvent) -> None:
        """Disconnect because of `event`; earlier hop counts are void."""
        self._states.happened(event)
        self._moved = self._moved or event is RouterEvent.LANDED
        self.hops = NO_ROUTE
        self._shortcut = None
        self._heartbeat_sent_s = self._answered_s = -math.inf
        self._show()

    def _answer_window_s(self) -> float:
        medium = self._medium
        hops = self.hops if self.hops != NO_ROUTE else _HOPS_UNTIL_KNOWN
        window_s = medium.answer_s + medium.answer_per_hop_s * hops
        if self._states.connected:
            patient_s = window_s * (1.0 + self._patience())  # it waits in the queues of relays
            window_s = max(window_s, min(patient_s, self._check_period_s))
        elif medium.policy.asks_in_turn:
            longer_s = window_s * LONGER**self._missed
            window_s = max(window_s, min(longer_s, self._check_period_s))
        return window_s

    def _asks_a_neighbour(self) -> bool:
        """Whether a neighbour was recently asked for its gateway. If not, one is asked now."""
        medium, now_s = self._medium, self._deadlines.now_s
        if medium.policy.asks_in_turn and now_s - self._asked_neighbour_s < medium.answer_s:
            return True
        self._asked_neighbour_s = now_s
        return False

    def _prefer(self, gateway: int) -> None:
        if gateway != self.gateway:
            if self.gateway != NO_ROUTE:
                self._report(MeshEventKind.GATEWAY_CHANGED, gateway)
            self.gateway = gateway
            self._resigned_s = -math.inf
            self._places.forget_gateway()
            self.swallowing.give_up()  # this one may not know its own place

    def _show(self) -> None:
        """Report a change of the connection, and stop waiting for an answer that will not come."""
        if self._states.connection in (ConnectionState.SEARCHING, ConnectionState.CONNECTED):
            self._deadlines.set(Due.ANSWER, math.inf)
        connected = self._states.connected
        if connected != self._shown_connected:
            self._shown_connected = connected
            kind = MeshEventKind.CONNECTED if connected else MeshEventKind.DISCONNECTED
            self._report(kind, self.gateway, in_hops(self.hops) if connected else "")
