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
from typing import Callable

from drone_mesh.communication.control.control_plane import IControlPlane
from drone_mesh.communication.data.echo import SendPacket
from drone_mesh.communication.data.outbox import Outbox
from drone_mesh.communication.data.outgoing import OutgoingMessage
from drone_mesh.communication.data.packets import Ack
from drone_mesh.communication.data.ticket import (
    TO_ALL,
    TO_GATEWAY,
    TicketState,
    destination_in_words,
)
from drone_mesh.communication.interfaces import NO_ROUTE, IMeshSeals, IWirelessCommunication
from drone_mesh.communication.timing import Deadlines

BURST = 8  # packets sent before others get their turn
FOUND_WITHIN_S = 0.5  # a gateway's search passes through 100 nodes
ROUTE_PERIOD_S = 0.5  # how often an outbox without a route looks for one


class Outboxes:
    """The outboxes of one node, by destination."""

    def __init__(
        self,
        node_id: int,
        control: IControlPlane,
        antenna: IWirelessCommunication,
        seals: IMeshSeals,
        deadlines: Deadlines,
        rng: random.Random,
        room: int,
        send_packet: SendPacket,
        to_self: Callable[[OutgoingMessage], None],
        ended: Callable[[TicketState], None],
        hint: Callable[[], str],
    ) -> None:
        """`rng`, `room`, `ended` and `hint` as for Transport and Outbox.

        `to_self` delivers a message for the gateway of a node that is its own gateway.
        """
        self._node_id = node_id
        self._control = control
        self._antenna = antenna
        self._medium = antenna.medium
        self._seals = seals
        self._deadlines = deadlines
        self._rng = rng
        self._was_lost = False
        self._room = room
        self._send_packet = send_packet
        self._to_self = to_self
        self._ended = ended
        self._hint = hint
        self._session: int | None = None
        self._outboxes: OrderedDict[int, Outbox] = OrderedDict()  # the next one to send is first
        self._for_gateway: list[OutgoingMessage] = []  # wait until there is one

    def __len__(self) -> int:
        """Messages waiting or under way."""
        return len(self._for_gateway) + sum(map(len, self._outboxes.values()))

    def add(self, message: OutgoingMessage) -> None:
        """Add a message for the destination of its ticket."""
        if message.ticket.to == TO_GATEWAY:
            self._for_gateway.append(message)
        else:
            self._outbox(message.ticket.to).add(message)

    def answered(self, by: int, ack: Ack) -> None:
        """Process an ACK of a receiver."""
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
        now_s, antenna = self._deadlines.now_s, self._antenna
        if not self._for_gateway and all(box.is_idle for box in self._outboxes.values()):
            return math.inf
        self._follow_gateway()
        self._yield_to_repair()
        left = min(BURST, antenna.data_room())
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
        for to, outbox in self._outboxes.items():
            outbox.expire(now_s, self._direction(to) != NO_ROUTE)
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
        if self._medium.shared and outbox.to != TO_ALL:
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
        has_way = control.routes.may_reach(to) or control.delivery.default_hop() != NO_ROUTE
        if has_way and self._antenna.on():
            return True
        control.delivery.seek(to)
        outbox.not_before_s = now_s + ROUTE_PERIOD_S
        outbox.blocked(self.unreachable(outbox.to))
        return False

    def _yield_to_repair(self) -> None:
        """On a shared channel, a node that lost its gateway sends no messages that it repeats.

        They would keep the channel busy for the packets that mend the mesh.
        """
        control, now_s = self._control, self._deadlines.now_s
        lost = not control.connected and control.gateway != NO_ROUTE
        for outbox in self._outboxes.values():
            if not lost and self._was_lost:
                outbox.ask_anew(now_s)
            elif lost and self._medium.shared and outbox.repeats:
                outbox.not_before_s = max(outbox.not_before_s, now_s + ROUTE_PERIOD_S)
                outbox.waits_because("this node looks for a gateway")
        self._was_lost = lost

    def _direction(self, to: int) -> int:
        direction = to if to == TO_ALL else self._control.routes.get_direction_to_node(to)
        return self._control.delivery.default_hop() if direction == NO_ROUTE else direction

    def _follow_gateway(self) -> None:
        """Move messages for the gateway to the one that this node uses now."""
        gateway = self._control.gateway
        if gateway == NO_ROUTE:
            self._give_up_without_gateway()
            return
        waiting, self._for_gateway = self._for_gateway, []
        for to, outbox in self._outboxes.items():
            if to not in (gateway, TO_ALL):
                waiting += outbox.take(TO_GATEWAY)
        for message in sorted(waiting, key=lambda message: message.ticket.number):
            if gateway == self._node_id:
                self._to_self(message)
            else:
                self._outbox(gateway).add(message)

    def _give_up_without_gateway(self) -> None:
        now_s = self._deadlines.now_s
        reason = self.unreachable(TO_GATEWAY)
        for message in list(self._for_gateway):
            message.ticket.reason = reason
            if now_s >= message.expires_s or not message.ticket.reliable:
                self._for_gateway.remove(message)
                message.ticket.set_state(TicketState.GIVEN_UP, reason)
                self._ended(TicketState.GIVEN_UP)

    def _outbox(self, to: int) -> Outbox:
        if self._session is None:
            self._session = self._rng.randrange(1 << 16)
        outbox = self._outboxes.get(to)
        if outbox is None:
            seal = functools.partial(self._seals.seal_message, self._node_id, to)
            outbox = Outbox(to, self._session, self._room, self._ended, seal, self._hint)
            self._outboxes[to] = outbox
        return outbox
