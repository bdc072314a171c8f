"""Outboxes: the messages from this node, and which of their packets leaves next.

The outboxes of all destinations take turns. Packets are sent a few at a time, so that the mesh's
own are handled in between. When the node gets another gateway, messages for the gateway move to the
outbox of the new one.
"""

from __future__ import annotations

import functools
import math
import random
from collections import OrderedDict
from dataclasses import dataclass
from typing import Callable

from drone_mesh.communication.control.control_plane import IControlPlane
from drone_mesh.communication.data.outbox import Outbox
from drone_mesh.communication.data.outgoing import (
    TO_ALL,
    TO_GATEWAY,
    OutgoingMessage,
    TicketState,
    destination_in_words,
)
from drone_mesh.communication.data.packets import Ack, SendPacket
from drone_mesh.communication.interfaces import NO_ROUTE, IMeshSeals, IWirelessCommunication
from drone_mesh.communication.timing import Deadlines

BURST = 8  # packets sent before others get their turn
FOUND_WITHIN_S = 0.5  # a gateway's search passes through 100 nodes
ROUTE_PERIOD_S = 0.5  # how often an outbox without a route looks for one


@dataclass(eq=False)
class Outboxes:
    """The outboxes of one node, by destination."""

    _node_id: int
    _control: IControlPlane
    _antenna: IWirelessCommunication
    _seals: IMeshSeals
    _deadlines: Deadlines
    _rng: random.Random  # draws the number of the session, with the first message
    _room: int  # bytes of a body
    _send_packet: SendPacket
    _to_self: Callable[[OutgoingMessage], None]  # for the gateway, and this node is one
    _ended: Callable[[TicketState], None]  # called with the last state of each message
    _hint: Callable[[], str]  # a possible reason why messages do not arrive

    def __post_init__(self) -> None:
        self._medium = self._antenna.medium
        self._was_lost = False
        self._gateway = NO_ROUTE  # the one whose outbox has the messages for the gateway
        self._session: int | None = None
        self._outboxes: OrderedDict[int, Outbox] = OrderedDict()  # the next one to send is first
        self._for_gateway: list[OutgoingMessage] = []  # wait until there is one

    def add(self, message: OutgoingMessage) -> None:
        """Add a message for the destination of its ticket."""
        if message.ticket.to == TO_GATEWAY:
            self._for_gateway.append(message)
        else:
            self._outbox(message.ticket.to).waiting.append(message)

    def answered(self, by: int, ack: Ack) -> None:
        outbox = self._outboxes.get(by)
        if outbox is not None:
            outbox.answered(ack, self._deadlines.now_s)

    def on_node_missing(self, node: int) -> None:
        """Another node has no route to `node`: what goes there by default may end there."""
        outbox = self._outboxes.get(node)
        if outbox is not None and self._control.routes.get_direction_to_node(node) == NO_ROUTE:
            search_s = self._medium.stretched(FOUND_WITHIN_S)
            outbox.missing(self.unreachable(node), search_s, self._deadlines.now_s)

    def send(self) -> float:
        """Send what may be sent now; returns when to call it again, or infinity."""
        now_s = self._deadlines.now_s
        if not self._for_gateway and all(box.is_idle for box in self._outboxes.values()):
            return math.inf
        gateway, connected = self._control.gateway, self._control.connected
        left = min(BURST, self._antenna.data_room())
        self._follow(gateway)
        self._yield_to_repair(lost=gateway != NO_ROUTE and not connected)
        idle = 0
        while left > 0 and idle < len(self._outboxes):
            to, outbox = next(iter(self._outboxes.items()))
            self._outboxes.move_to_end(to)
            if self._send_one(outbox, now_s):
                left, idle = left - 1, 0
            else:
                idle += 1
        soon_s = now_s + self._medium.data_pause_s
        again_s = soon_s if left <= 0 else math.inf
        for outbox in self._outboxes.values():
            outbox.expire(now_s, self._direction)
            due_s = outbox.due_s(now_s)
            again_s = min(again_s, due_s if due_s > now_s else soon_s)  # it could not be sent
        if self._for_gateway:
            again_s = min(again_s, now_s + ROUTE_PERIOD_S)
        return again_s

    def unreachable(self, to: int) -> str:
        """Why nothing can be sent to `to` now, in words."""
        if to == TO_GATEWAY:
            return f"this node knows no gateway{self._hint()}"
        return f"no route to {destination_in_words(to)}{self._hint()}"

    def _send_one(self, outbox: Outbox, now_s: float) -> bool:
        """Send one packet of an outbox; False if it has none now."""
        if outbox.is_idle or now_s < outbox.not_before_s:
            return False
        if outbox.to != TO_ALL and not self._may_reach(outbox, now_s):
            return False
        if self._medium.policy.data_in_trains and outbox.to != TO_ALL:
            outbox.set_relayed(self._direction(outbox.to) != outbox.to)
        packet = outbox.next_packet(now_s)
        if packet is None:
            return False
        if self._send_packet(packet.kind, outbox.to, packet.body):
            outbox.on_sent(packet, now_s)
            return True
        if self._direction(outbox.to) == NO_ROUTE:
            self._may_reach(outbox, now_s)
        else:
            outbox.not_before_s = now_s + self._medium.data_pause_s
        return False

    def _may_reach(self, outbox: Outbox, now_s: float) -> bool:
        """Whether there is a route. If not, retry later and give up unreliable messages."""
        to, control = outbox.to, self._control
        has_way = control.routes.may_reach(to) or control.way_up(NO_ROUTE) != NO_ROUTE
        if has_way and self._antenna.on():
            return True
        control.seek(to)
        outbox.not_before_s = now_s + ROUTE_PERIOD_S
        outbox.blocked(self.unreachable(outbox.to))
        return False

    def _yield_to_repair(self, lost: bool) -> None:
        """On a shared channel, a node that lost its gateway sends no messages that it repeats.

        They would keep the channel busy for the packets that mend the mesh.
        """
        now_s, yields = self._deadlines.now_s, self._medium.policy.data_yields
        for outbox in self._outboxes.values():
            if not lost and self._was_lost:
                outbox.ask_anew(now_s)
            elif lost and yields and any(message.ticket.reliable for message in outbox):
                outbox.not_before_s = max(outbox.not_before_s, now_s + ROUTE_PERIOD_S)
                outbox.waits_because("this node looks for a gateway")
        self._was_lost = lost

    def _direction(self, to: int) -> int:
        direction = to if to == TO_ALL else self._control.routes.get_direction_to_node(to)
        return self._control.way_up(NO_ROUTE) if direction == NO_ROUTE else direction

    def _follow(self, gateway: int) -> None:
        """Move messages for the gateway to the one that this node uses now."""
        now_s = self._deadlines.now_s
        if gateway == NO_ROUTE:
            for message in list(self._for_gateway):
                ticket = message.ticket
                ticket.reason = reason = self.unreachable(TO_GATEWAY)
                if now_s >= message.expires_s or not ticket.reliable:
                    self._for_gateway.remove(message)
                    ticket.set_state(TicketState.GIVEN_UP, reason)
                    self._ended(TicketState.GIVEN_UP)
            return
        waiting, self._for_gateway = self._for_gateway, []
        before, self._gateway = self._gateway, gateway
        if before != gateway and before in self._outboxes:
            waiting += self._outboxes[before].take(TO_GATEWAY)
        for message in sorted(waiting, key=lambda message: message.ticket.number):
            if gateway == self._node_id:
                self._to_self(message)
            else:
                self._outbox(gateway).waiting.append(message)

    def _outbox(self, to: int) -> Outbox:
        if self._session is None:
            self._session = self._rng.randrange(1 << 16)
        if to not in self._outboxes:
            seal = functools.partial(self._seals.seal_message, self._node_id, to)
            outbox = Outbox(to, self._session, self._room, self._ended, seal, self._hint)
            self._outboxes[to] = outbox
        return self._outboxes[to]
