"""Courier: carries packets as a control plane decides, one verdict after the other.

For each packet it asks for the next hop and tells where the packet came from and what was tried. If
the radio reports that a hop failed, it asks again at once. A packet that has no next hop now waits
until the plane finds one, or gives it up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Callable, Final, Hashable

from drone_mesh.communication.control.delivery import IDelivery
from drone_mesh.communication.interfaces import NO_ROUTE, IWirelessCommunication
from drone_mesh.communication.timing import Deadlines
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.messages import ROUTE_RECORD, ROUTE_RECORD_AT
from drone_mesh.communication.wire.packet_types import MessageType

HOLD: Final = -1  # a verdict; any that is not these two is the next hop
DROP: Final = -2
MOST_HELD: Final = 64  # packets that wait for a next hop
MOST_HOPS_TRIED: Final = 8  # by one node for one packet
REMEMBERED_S: Final = 3.0  # longer than a packet is held
SAME_S: Final = 0.5  # a packet that comes again from the same neighbour within it is a copy


@dataclass(eq=False)
class Transit:
    """One packet on its way through this node."""

    payload: bytes  # as it came, or as this node made it
    came_from: int  # the neighbour; NO_ROUTE: this node made it
    seen_s: float
    sent_s: dict[int, float] = field(default_factory=dict)  # neighbours that have it, since when
    failed_s: dict[int, float] = field(default_factory=dict)  # that did not take it, and when
    again: set[int] = field(default_factory=set)  # of these, those that were asked again
    tries: int = 0

    def __post_init__(self) -> None:
        self.creator, _from, self.kind, _to, self.addressee = messages.header(self.payload)


Verdict = Callable[[Transit], int]


@dataclass(eq=False)
class Courier(IDelivery):
    """The packets of one node. Called only by its control plane and its parts."""

    _node_id: int
    _antenna: IWirelessCommunication
    _deadlines: Deadlines
    _attempts: int  # of a packet for one neighbour
    _verdict: Verdict
    _on_sent: Callable[[int], None]  # a neighbour took a packet
    _on_failed: Callable[[int], None]  # or did not
    _on_returned: Callable[[int, int], None]  # it sent one back, for this addressee
    _without_proof: Callable[[bytes], bytes]  # see IMeshSeals

    def __post_init__(self) -> None:
        self._held: list[Transit] = []
        # Two tables used in turn, so that old packets are forgotten without a search for them.
        self._known: dict[Hashable, Transit] = {}
        self._earlier: dict[Hashable, Transit] = {}
        self._turn_s = -math.inf
        self.total_sent = 0

    @property
    def holds(self) -> list[Transit]:
        """The packets that wait for a next hop. Do not modify."""
        return self._held

    def send_own(self, payload: bytes) -> bool:
        """Send this node's own packet towards its addressee, or hold it for a while."""
        transit = Transit(payload, NO_ROUTE, self._deadlines.now_s)
        self._remember(self._identity(payload), transit)
        return self._carry(transit)

    def forward(
        self, payload: bytes, creator: int, from_: int, kind: int, forward: int, now_s: float
    ) -> None:
        """Carry a packet for another node; one that came back goes another way."""
        identity = self._identity(payload)
        transit = self._known.get(identity) or self._earlier.get(identity)
        if transit is None or now_s - transit.seen_s >= REMEMBERED_S:
            if creator == self._node_id:
                return
            transit = Transit(payload, from_, now_s)
            self._remember(identity, transit)
        elif from_ == transit.came_from:
            if now_s - transit.seen_s < SAME_S:
                return
            transit = Transit(payload, from_, now_s)  # its creator sends the same once more
            self._remember(identity, transit)
        else:
            if transit.came_from in transit.sent_s and from_ not in transit.sent_s:
                transit.came_from = from_  # it went back from here, and came round
            else:
                transit.sent_s[from_] = now_s  # it has it, and could not deliver it
            self._on_returned(from_, forward)
            if transit in self._held:
                return
        self._carry(transit)

    def send(self, payload: bytes, to: int) -> bool:
        """Send a packet to the neighbour `to`, and nowhere else. False: it did not take it."""
        return self._hand_over(payload, to)

    def undelivered(self, payload: bytes) -> None:
        """The antenna gave up a packet: send it another way."""
        self.total_sent -= 1
        to, now_s = messages.receiver(payload), self._deadlines.now_s
        self._on_failed(to)
        identity = self._identity(payload)
        transit = self._known.get(identity) or self._earlier.get(identity)
        if transit is None or to == NO_ROUTE:
            return
        transit.sent_s.pop(to, None)
        transit.failed_s[to] = now_s
        if transit not in self._held:
            self._carry(transit)

    def retry(self) -> None:
        """Ask again about the packets that wait."""
        held, self._held = self._held, []
        for transit in held:
            self._carry(transit)

    def _carry(self, transit: Transit) -> bool:
        """Send a packet on, hold it or drop it (False)."""
        while transit.tries < MOST_HOPS_TRIED:
            to = self._verdict(transit)
            if to == HOLD and len(self._held) < MOST_HELD:
                self._held.append(transit)
                return True
            if to in (HOLD, DROP):
                return False
            if transit.came_from == NO_ROUTE:
                onward: bytes | None = messages.readdressed(transit.payload, to)
            else:
                onward = messages.next_hop(transit.payload, self._node_id, to)
            if onward is None:
                return False
            transit.tries += 1
            if self._hand_over(onward, to):
                transit.sent_s[to] = self._deadlines.now_s
                return True
            transit.failed_s[to] = self._deadlines.now_s
        return False

    def _hand_over(self, payload: bytes, to: int) -> bool:
        """Give a packet to the antenna. False: it did not take it, or the neighbour did not."""
        for _attempt in range(self._attempts):
            if self._antenna.send_message_to(payload):
                self.total_sent += 1
                self._on_sent(to)
                return True
        self._on_failed(to)
        return False

    def _identity(self, payload: bytes) -> Hashable:
        """What does not change on the way of a packet; of an own one, before it was sealed.

        The proof in a packet of another node counts: a forged one is not the same packet.
        """
        creator, _from, kind, _to, forward = messages.header(payload)
        if creator == self._node_id:
            payload = self._without_proof(payload)
        if kind == MessageType.HEARTBEAT:  # counts its hops
            return messages.identity(payload)
        end = ROUTE_RECORD_AT if kind == ROUTE_RECORD else None
        return creator, kind, forward, payload[messages.HEADER_BYTES : end]

    def _remember(self, identity: Hashable, transit: Transit) -> None:
        now_s = self._deadlines.now_s
        if now_s >= self._turn_s:
            self._turn_s = now_s + REMEMBERED_S
            self._known, self._earlier = {}, self._known
        self._known[identity] = transit


class QueuedCourier(Courier):
    """On a shared channel the antenna queues packets, and reports their fate later."""

    def _hand_over(self, payload: bytes, to: int) -> bool:
        taken = self._antenna.send_message_to(payload)
        self.total_sent += taken
        return taken
