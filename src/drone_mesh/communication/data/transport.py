"""Transport: users' messages to and from one node (docs/wire.md, "Data").

The component passes in packets of users' types and the time; this class has no thread and no clock.
Messages to send go to outboxes, one per destination; received packets go to inboxes, one per
sender.
"""

from __future__ import annotations

import hmac
import random
from dataclasses import dataclass
from typing import Callable, NamedTuple

from drone_mesh.communication.control.control_plane import IControlPlane
from drone_mesh.communication.control.node_part import due, receives
from drone_mesh.communication.data import packets
from drone_mesh.communication.data.flood import Flood
from drone_mesh.communication.data.inboxes import Inboxes
from drone_mesh.communication.data.outboxes import Outboxes
from drone_mesh.communication.data.outgoing import (
    LIFETIME_S,
    TO_ALL,
    TO_GATEWAY,
    OutgoingMessage,
    Ticket,
    TicketState,
)
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.interfaces import MAX_NODE_ID, IMeshSeals, IWirelessCommunication
from drone_mesh.communication.timing import Deadlines, Due
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import DATA_TYPES
from drone_mesh.errors import MessageRefused, PacketError, QueueFull

MOST_QUEUED = 64  # messages waiting or under way, in total
MOST_AWAITED = 64  # answers to echoes; the oldest is given up


class EchoAnswer(NamedTuple):
    """The round trip of a packet to a node, and the nodes that it passed."""

    node: int  # the node that answered
    token: int  # of the echo
    round_trip_s: float
    route: tuple[int, ...]  # the nodes that forwarded the echo, in order

    @property
    def hops(self) -> int:
        """Links to that node."""
        return len(self.route) + 1


OnEchoAnswer = Callable[[EchoAnswer], None]
"""Called in the component's thread; must not call back into the component."""


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


@dataclass(eq=False)
class Transport:
    """Sends and receives the messages of one node. Belongs to the component's thread."""

    _node_id: int
    _control: IControlPlane
    _antenna: IWirelessCommunication
    _seals: IMeshSeals
    _deadlines: Deadlines
    _complaints: Complaints
    _rng: random.Random  # draws the number of the session, with the first message

    def __post_init__(self) -> None:
        node_id, antenna = self._node_id, self._antenna
        seals, deadlines = self._seals, self._deadlines
        room = messages.BODY_BYTES - seals.reserved_bytes(packets.FRAGMENTS.start)
        assert room >= packets.LEAST_ROOM, "a seal leaves too little room for users' data"
        own = (self._send_packet, self._to_self, self._ended, self.hint)
        self._outboxes = Outboxes(
            node_id, self._control, antenna, seals, deadlines, self._rng, room, *own
        )
        self._inboxes = Inboxes(
            node_id, antenna, seals, deadlines, room, self._send_packet, self._deliver
        )
        self._flood = Flood(node_id, antenna, deadlines)
        self._room = room
        self._echo_token = 0
        self._awaited: dict[int, tuple[int, float, OnEchoAnswer]] = {}  # by token
        self._receivers: list[Receiver] = []
        self._numbered = 0
        self._figures = DataFigures()

    # For users ---------------------------------------------------------------------------------

    def send(
        self, to: int, payload: bytes, now_s: float, *, port: int = 0, reliable: bool = True
    ) -> Ticket:
        """Send a message to a node, to TO_GATEWAY or, never reliably, to TO_ALL.

        Raises MessageRefused for a bad destination, port or size, and QueueFull if too many
        messages wait.
        """
        self._deadlines.now_s = now_s
        self._check(to, payload, port)
        reliable = reliable and to != TO_ALL
        self._numbered += 1
        ticket = Ticket(self._numbered, to, port, len(payload), reliable)
        figures = self._figures
        self._figures = figures._replace(
            messages_sent=figures.messages_sent + 1,
            messages_queued=figures.messages_queued + 1,
            bytes_sent=figures.bytes_sent + len(payload),
            sent_s=now_s,
        )
        message, me = OutgoingMessage(ticket, payload, now_s + LIFETIME_S), self._node_id
        is_own = to == me or (to == TO_GATEWAY and self._control.gateway == me)
        if not is_own:
            self._outboxes.add(message)
        self._work()  # earlier ones may wait for a gateway, which this node is by now
        if is_own:
            self._to_self(message)
        return ticket

    def on_received(self, receiver: Receiver) -> None:
        """Call `receiver` for each message that arrives."""
        self._receivers.append(receiver)

    def echo(self, to: int, on_answer: OnEchoAnswer, now_s: float) -> int | None:
        """Send an echo to a node; returns its token, or None if there is no route."""
        self._deadlines.now_s = now_s
        if not 0 <= to <= MAX_NODE_ID or to == self._node_id:
            raise MessageRefused(f"invalid node {to}: must be another node, 0..{MAX_NODE_ID}")
        token = self._echo_token = (self._echo_token + 1) & 0xFFFF
        while len(self._awaited) >= MOST_AWAITED:
            del self._awaited[next(iter(self._awaited))]
        self._awaited[token] = to, now_s, on_answer
        if self._send_packet(packets.ECHO, to, packets.echo_body(token)):
            return token
        self._awaited.pop(token, None)
        return None

    def unreachable(self, to: int) -> str:
        """Why nothing can be sent to `to` now, in words."""
        return self._outboxes.unreachable(to)

    def hint(self) -> str:
        """Text to append to an error: that a neighbour has another key or none. Otherwise empty."""
        foreign = self._seals.foreign_neighbour()
        foreign = foreign or self._complaints.foreign_neighbour(self._deadlines.now_s)
        return f"; {foreign}" if foreign else ""

    def figures(self) -> DataFigures:
        """Counts of sent and received messages. Any thread."""
        return self._figures

    # For the component -------------------------------------------------------------------------

    @receives(*DATA_TYPES)
    def on_packet(self, payload: bytes, creator: int, _from: int) -> None:
        """Process a packet of a user's type, for this node or for all."""
        kind, body = messages.type_of(payload), messages.body(payload)
        if creator == self._node_id:
            return  # it came back
        now_s = self._deadlines.now_s
        try:
            if kind in packets.FRAGMENTS:
                to_all = messages.addressee(payload) == TO_ALL
                if not to_all or self._flood.repeat(payload):
                    self._inboxes.fragment(creator, to_all, kind - packets.FRAGMENTS.start, body)
            elif kind == packets.ACK:
                plain, ack = packets.untagged(body), packets.ack_of(body)
                tag = self._seals.acknowledgement_tag(creator, self._node_id, plain)
                if hmac.compare_digest(tag, body[len(plain) :][: len(tag)]):  # a relay could forge
                    self._outboxes.answered(creator, ack)
                else:
                    self._complaints.dropped("an acknowledgement without proof", payload, now_s)
            elif kind == packets.POLL:
                self._inboxes.poll(creator, packets.poll_of(body))
            elif kind == packets.ECHO:
                answer = packets.echo_body(*packets.echo_of(body), self._room)
                self._send_packet(packets.ECHO_ANSWER, creator, answer)
            elif kind == packets.ECHO_ANSWER:
                token, route = packets.echo_of(body)
                to, sent_s, on_answer = self._awaited.get(token, (-1, 0.0, None))
                if to == creator and on_answer is not None:  # otherwise it is unexpected
                    del self._awaited[token]
                    on_answer(EchoAnswer(creator, token, now_s - sent_s, route))
            else:
                self._complaints.dropped("data of an unknown type", payload, now_s)
        except PacketError as error:
            self._complaints.dropped(f"invalid data: {error}", payload, now_s)
        self._work()

    def on_node_missing(self, node: int) -> None:
        """Another node has no route to `node`."""
        self._outboxes.on_node_missing(node)
        self._work()

    @due(Due.DATA)
    def on_due(self) -> None:
        """The time requested with Due.DATA has come."""
        self._inboxes.on_time()
        self._work()

    # Its parts ---------------------------------------------------------------------------------

    def _work(self) -> None:
        """Send what may be sent now, and schedule the next time."""
        again_s = self._outboxes.send()
        self._deadlines.set(Due.DATA, min(again_s, self._inboxes.due_s))

    def _send_packet(self, kind: int, to: int, body: bytes) -> bool:
        me = self._node_id
        packet = messages.packet(kind, me, me, to, to, body)
        if to == TO_ALL:
            self._flood.send(packet)
            return True
        return self._control.delivery.send_own(packet)

    def _check(self, to: int, payload: bytes, port: int) -> None:
        if not 0 <= to <= MAX_NODE_ID and to not in (TO_ALL, TO_GATEWAY):
            raise MessageRefused(
                f"invalid destination {to}: must be a node 0..{MAX_NODE_ID}, "
                f"{TO_ALL} for all nodes or {TO_GATEWAY} for the gateway"
            )
        if not 0 <= port <= packets.MAX_DATA_PORT:
            raise MessageRefused(f"invalid port {port}: must be 0..{packets.MAX_DATA_PORT}")
        packets.check_size(payload)
        queued = self._figures.messages_queued
        if queued >= MOST_QUEUED:
            raise QueueFull(f"the queue is full: {queued} messages wait or are on their way")

    def _ended(self, state: TicketState) -> None:
        figures = self._figures
        self._figures = figures._replace(
            messages_queued=figures.messages_queued - 1,
            messages_delivered=figures.messages_delivered + (state is TicketState.DELIVERED),
            messages_given_up=figures.messages_given_up + (state is TicketState.GIVEN_UP),
        )

    def _to_self(self, message: OutgoingMessage) -> None:
        ticket = message.ticket
        self._deliver(self._node_id, False, ticket.port, message.payload, ticket.reliable)
        ticket.set_state(TicketState.DELIVERED)
        self._ended(TicketState.DELIVERED)

    def _deliver(
        self, sender: int, to_all: bool, port: int, payload: bytes, reliable: bool
    ) -> None:
        now_s, figures = self._deadlines.now_s, self._figures
        self._figures = figures._replace(
            messages_received=figures.messages_received + 1,
            bytes_received=figures.bytes_received + len(payload),
            received_s=now_s,
        )
        for receiver in self._receivers:
            receiver(ReceivedMessage(sender, port, payload, to_all, reliable, now_s))
