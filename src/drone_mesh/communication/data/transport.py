"""Transport: users' messages to and from one node (docs/protocol.md, "Data").

The component passes in packets of users' types and the time; this class has no thread and no clock.
Lanes, one per destination, decide what to send; received packets go to inboxes, one per sender.
Packets are sent a few at a time, so that the mesh's own are handled in between.
"""

from __future__ import annotations

import functools
import hmac
import math
import random
from collections import OrderedDict
from typing import Callable, NamedTuple

from drone_mesh.communication import messages
from drone_mesh.communication.complaints import Complaints
from drone_mesh.communication.data import packets
from drone_mesh.communication.data.echo import Echoes, OnEchoAnswer
from drone_mesh.communication.data.flood import SeenFloods
from drone_mesh.communication.data.inbox import Inbox
from drone_mesh.communication.data.lane import Lane
from drone_mesh.communication.data.outgoing import OutgoingMessage
from drone_mesh.communication.data.packets import Ack
from drone_mesh.communication.data.reassembly import Whole
from drone_mesh.communication.data.ticket import (
    TO_ALL,
    TO_GATEWAY,
    Ticket,
    TicketState,
    destination_in_words,
)
from drone_mesh.communication.deadlines import Due
from drone_mesh.communication.interfaces import MAX_NODE_ID, NO_ROUTE
from drone_mesh.communication.parts import NodeParts
from drone_mesh.errors import MessageRefused, PacketError, QueueFull

MOST_QUEUED = 64  # our choice: messages waiting or under way, in total
BURST = 8  # our choice: packets sent before others get their turn
ROUTE_PERIOD_S = 0.5  # our choice: how often a lane without a route looks for one
TIDY_PERIOD_S = 5.0  # our choice: how often old fragments are dropped
MOST_INBOXES = 128  # senders whose messages are put together at once, the latest ones


class ReceivedMessage(NamedTuple):
    """A message of a user, complete and in order."""

    sender: int
    port: int
    payload: bytes
    to_all: bool
    reliable: bool
    received_s: float  # the core's clock


Receiver = Callable[[ReceivedMessage], None]
"""Called in the component's thread; must not call back into the component."""


class DataFigures(NamedTuple):
    """Counts since the start, and the times of the latest messages."""

    messages_sent: int = 0  # submitted
    messages_delivered: int = 0  # acknowledged by their receivers
    messages_given_up: int = 0
    messages_received: int = 0
    bytes_sent: int = 0  # of the submitted payloads
    bytes_received: int = 0
    messages_queued: int = 0  # currently waiting or under way
    sent_s: float = 0.0  # the core's clock; 0: none
    received_s: float = 0.0


class Transport:
    """Sends and receives the messages of one node. Belongs to the component's thread."""

    def __init__(
        self,
        parts: NodeParts,
        complaints: Complaints,
        rng: random.Random,
        my_gateway: Callable[[], int],
        room: int = messages.BODY_BYTES,
    ) -> None:
        """`room`: free bytes in a packet's body; `my_gateway`: its id, or NO_ROUTE."""
        if not packets.LEAST_ROOM <= room <= messages.BODY_BYTES:
            raise ValueError(
                f"invalid room {room}: must be {packets.LEAST_ROOM}..{messages.BODY_BYTES}"
            )
        self._parts = parts
        self._complaints = complaints
        self._rng = rng
        self._my_gateway = my_gateway
        self._room = room
        self._session: int | None = None
        self._lanes: OrderedDict[int, Lane] = OrderedDict()  # the next one to send comes first
        self._for_gateway: list[OutgoingMessage] = []  # wait until there is one
        self._inboxes: OrderedDict[tuple[int, bool], Inbox] = OrderedDict()
        self._floods = SeenFloods()
        self._echoes = Echoes(self._send_packet, room)
        self._receivers: list[Receiver] = []
        self._numbered = 0
        self._figures = DataFigures()
        self._tidy_s = math.inf

    # For users ---------------------------------------------------------------------------------

    def send(
        self, to: int, payload: bytes, now_s: float, *, port: int = 0, reliable: bool = True
    ) -> Ticket:
        """Send a message to a node, to TO_GATEWAY or, never reliably, to TO_ALL.

        Raises MessageRefused for a bad destination, port or size, and QueueFull if too many
        messages wait.
        """
        self._parts.deadlines.now_s = now_s
        self._check(to, payload, port)
        reliable = reliable and to != TO_ALL
        self._numbered += 1
        ticket = Ticket(self._numbered, to, port, len(payload), reliable)
        self._figures = self._figures._replace(
            messages_sent=self._figures.messages_sent + 1,
            bytes_sent=self._figures.bytes_sent + len(payload),
            sent_s=now_s,
        )
        me = self._parts.node_id
        if to == me or (to == TO_GATEWAY and self._my_gateway() == me):
            self._deliver(ReceivedMessage(me, port, payload, False, reliable, now_s))
            ticket.becomes(TicketState.DELIVERED)
            return ticket
        message = OutgoingMessage(ticket, payload, now_s)
        if to == TO_GATEWAY:
            self._for_gateway.append(message)
        else:
            self._lane(to).add(message)
        self._work()
        return ticket

    def on_received(self, receiver: Receiver) -> None:
        """Call `receiver` for each message that arrives."""
        self._receivers.append(receiver)

    def echo(self, to: int, on_answer: OnEchoAnswer, now_s: float) -> int | None:
        """Send an echo to a node; returns its token, or None if there is no route."""
        self._parts.deadlines.now_s = now_s
        if not 0 <= to <= MAX_NODE_ID or to == self._parts.node_id:
            raise MessageRefused(f"invalid node {to}: must be another node, 0..{MAX_NODE_ID}")
        return self._echoes.send(to, on_answer, now_s)

    def unreachable(self, to: int) -> str:
        """Why nothing can be sent to `to` now, in words."""
        if to == TO_GATEWAY:
            return f"this node knows no gateway{self.hint()}"
        return f"no route to {destination_in_words(to)}{self.hint()}"

    def hint(self) -> str:
        """That a neighbour has another key or none, to be added to what went wrong; or empty."""
        foreign = self._parts.antenna.foreign_neighbour()
        foreign = foreign or self._complaints.foreign_neighbour(self._parts.now_s)
        return f"; {foreign}" if foreign else ""

    def figures(self) -> DataFigures:
        """Counts of sent and received messages. Any thread."""
        return self._figures

    # For the component -------------------------------------------------------------------------

    def on_packet(self, payload: bytes) -> None:
        """Process a packet of a user's type, for this node or for all."""
        creator, _from, kind, _to, forward = messages.header(payload)
        body = messages.body(payload)
        if creator == self._parts.node_id:
            return  # it came back
        now_s = self._parts.now_s
        try:
            if kind in packets.FRAGMENTS:
                self._fragment(payload, creator, kind - packets.FRAGMENTS.start, forward == TO_ALL)
            elif kind == packets.ACK:
                lane = self._lanes.get(creator)
                if not self._is_authentic(body, creator):
                    self._complaints.dropped("an acknowledgement without proof", payload, now_s)
                elif lane is not None:
                    lane.answered(packets.ack_of(body), now_s)
            elif kind == packets.POLL:
                self._inbox(creator, to_all=False).poll(packets.poll_of(body), now_s)
            elif kind == packets.ECHO:
                self._echoes.asked(creator, body)
            elif kind == packets.ECHO_ANSWER:
                self._echoes.answered(creator, body, now_s)
            else:
                self._complaints.dropped("data of an unknown type", payload, now_s)
        except PacketError as error:
            self._complaints.dropped(f"data: {error}", payload, now_s)
        self._work()

    def on_due(self) -> None:
        """The time requested with Due.DATA has come."""
        now_s = self._parts.now_s
        for (sender, to_all), inbox in list(self._inboxes.items()):
            for whole in inbox.on_time(now_s):
                self._arrived(sender, to_all, whole)
        if now_s >= self._tidy_s:
            unfinished = any(inbox.unfinished for inbox in self._inboxes.values())
            self._tidy_s = now_s + TIDY_PERIOD_S if unfinished else math.inf
        self._work()

    # Sending -----------------------------------------------------------------------------------

    def _work(self) -> None:
        """Send what may be sent now, and schedule the next time."""
        self._send_now()
        queued = self._queued()
        if queued != self._figures.messages_queued:
            self._figures = self._figures._replace(messages_queued=queued)

    def _send_now(self) -> None:
        now_s, antenna = self._parts.now_s, self._parts.antenna
        if not self._lanes and not self._for_gateway:
            self._plan(math.inf)
            return
        self._follow_gateway()
        left = min(BURST, antenna.data_room())
        idle = 0
        while left > 0 and idle < len(self._lanes):
            to, lane = next(iter(self._lanes.items()))
            self._lanes.move_to_end(to)
            if self._send_one(lane, now_s):
                left, idle = left - 1, 0
            else:
                idle += 1
        soon_s = now_s + antenna.medium.data_pause_s
        again_s = soon_s if left <= 0 else math.inf
        for to, lane in self._lanes.items():
            lane.expire(now_s, self._direction(to) != NO_ROUTE)
            due_s = lane.due_s(now_s)
            again_s = min(again_s, due_s if due_s > now_s else soon_s)  # it could not leave
        if self._for_gateway:
            again_s = min(again_s, now_s + ROUTE_PERIOD_S)
        self._plan(again_s)

    def _send_one(self, lane: Lane, now_s: float) -> bool:
        """Send one packet of a lane; False if it has none now."""
        if lane.is_idle or now_s < lane.not_before_s:
            return False
        if lane.to != TO_ALL and not self._may_reach(lane, now_s):
            return False
        if self._parts.antenna.medium.shared and lane.to != TO_ALL:
            lane.relayed(self._direction(lane.to) != lane.to)
        packet = lane.next_packet(now_s)
        if packet is None:
            return False
        if self._send_packet(packet.kind, lane.to, packet.body):
            lane.left(packet, now_s)
            return True
        if self._direction(lane.to) == NO_ROUTE:
            self._may_reach(lane, now_s)
        else:
            lane.not_before_s = now_s + self._parts.antenna.medium.data_pause_s
        return False

    def _may_reach(self, lane: Lane, now_s: float) -> bool:
        """Whether there is a route. If not, retry later and give up unreliable messages."""
        if self._parts.antenna.on() and self._direction(lane.to) != NO_ROUTE:
            return True
        lane.not_before_s = now_s + ROUTE_PERIOD_S
        lane.hindered(self.unreachable(lane.to))
        return False

    def _direction(self, to: int) -> int:
        return to if to == TO_ALL else self._parts.routing.get_direction_to_node(to)

    def _send_packet(self, kind: int, to: int, body: bytes) -> bool:
        me = self._parts.node_id
        packet = messages.packet(kind, me, me, to, to, body)
        if to == TO_ALL:
            self._floods.is_new(me, body[0], kind - packets.FRAGMENTS.start, self._parts.now_s)
            self._parts.antenna.broadcast_message(packet)
            return True
        return self._parts.delivery.send_own(packet)

    def _follow_gateway(self) -> None:
        """Move messages for the gateway to the one that this node uses now."""
        gateway = self._my_gateway()
        if gateway == NO_ROUTE:
            self._give_up_without_gateway()
            return
        waiting, self._for_gateway = self._for_gateway, []
        for to, lane in self._lanes.items():
            if to not in (gateway, TO_ALL):
                waiting += lane.take(TO_GATEWAY)
        for message in waiting:
            self._lane(gateway).add(message)

    def _give_up_without_gateway(self) -> None:
        now_s = self._parts.now_s
        reason = self.unreachable(TO_GATEWAY)
        for message in list(self._for_gateway):
            message.ticket.reason = reason
            if now_s >= message.expires_s or not message.ticket.reliable:
                self._for_gateway.remove(message)
                message.ticket.becomes(TicketState.GIVEN_UP, reason)
                self._ended(TicketState.GIVEN_UP)

    def _lane(self, to: int) -> Lane:
        if self._session is None:
            self._session = self._rng.randrange(1 << 16)
        lane = self._lanes.get(to)
        if lane is None:
            seal = functools.partial(self._parts.antenna.seal_message, self._parts.node_id, to)
            lane = Lane(to, self._session, self._room, self._ended, seal, self.hint)
            self._lanes[to] = lane
        return lane

    def _ended(self, state: TicketState) -> None:
        figures = self._figures
        if state is TicketState.DELIVERED:
            self._figures = figures._replace(messages_delivered=figures.messages_delivered + 1)
        elif state is TicketState.GIVEN_UP:
            self._figures = figures._replace(messages_given_up=figures.messages_given_up + 1)

    def _check(self, to: int, payload: bytes, port: int) -> None:
        if not 0 <= to <= MAX_NODE_ID and to not in (TO_ALL, TO_GATEWAY):
            raise MessageRefused(
                f"invalid destination {to}: must be a node 0..{MAX_NODE_ID}, "
                f"{TO_ALL} for all nodes or {TO_GATEWAY} for the gateway"
            )
        if not 0 <= port <= 255:
            raise MessageRefused(f"invalid port {port}: must be 0..255")
        packets.check_size(payload)
        queued = self._queued()
        if queued >= MOST_QUEUED:
            raise QueueFull(f"the queue is full: {queued} messages wait or are on their way")

    def _queued(self) -> int:
        return len(self._for_gateway) + sum(map(len, self._lanes.values()))

    # Receiving ---------------------------------------------------------------------------------

    def _fragment(self, payload: bytes, creator: int, index: int, to_all: bool) -> None:
        now_s, body = self._parts.now_s, messages.body(payload)
        if to_all:
            if not self._floods.is_new(creator, body[0], index, now_s):
                return
            onward = messages.next_hop(payload, self._parts.node_id, TO_ALL)
            if onward is not None:
                self._parts.antenna.broadcast_message(onward)
        inbox = self._inbox(creator, to_all)
        for whole in inbox.fragment(index, body, now_s):
            self._arrived(creator, to_all, whole)
        if self._tidy_s == math.inf and inbox.unfinished:
            self._tidy_s = now_s + TIDY_PERIOD_S

    def _is_authentic(self, ack: bytes, creator: int) -> bool:
        """Whether an ACK comes from its creator; a relay could claim that."""
        body = packets.untagged(ack)
        tag = self._parts.antenna.acknowledgement_tag(creator, self._parts.node_id, body)
        return hmac.compare_digest(tag, ack[len(body) : len(body) + len(tag)])

    def _inbox(self, sender: int, to_all: bool) -> Inbox:
        key = (sender, to_all)
        inbox = self._inboxes.get(key)
        if inbox is None:
            while len(self._inboxes) >= MOST_INBOXES:
                self._inboxes.popitem(last=False)

            def acknowledge(ack: Ack) -> None:
                body = packets.ack_body(ack)
                tag = self._parts.antenna.acknowledgement_tag(self._parts.node_id, sender, body)
                self._send_packet(packets.ACK, sender, body + tag)

            receiver = TO_ALL if to_all else self._parts.node_id
            open_message = functools.partial(self._parts.antenna.open_message, sender, receiver)
            inbox = self._inboxes[key] = Inbox(self._room, acknowledge, open_message)
        self._inboxes.move_to_end(key)
        return inbox

    def _arrived(self, sender: int, to_all: bool, whole: Whole) -> None:
        head = whole.head
        self._deliver(
            ReceivedMessage(
                sender, head.port, whole.payload, to_all, head.reliable, self._parts.now_s
            )
        )

    def _deliver(self, message: ReceivedMessage) -> None:
        self._figures = self._figures._replace(
            messages_received=self._figures.messages_received + 1,
            bytes_received=self._figures.bytes_received + len(message.payload),
            received_s=message.received_s,
        )
        for receiver in self._receivers:
            receiver(message)

    def _plan(self, at_s: float) -> None:
        """Schedule `on_due` at `at_s`, or earlier for an ACK."""
        for inbox in self._inboxes.values():
            at_s = min(at_s, inbox.ack_due_s)
        self._parts.deadlines.set(Due.DATA, min(at_s, self._tidy_s))
