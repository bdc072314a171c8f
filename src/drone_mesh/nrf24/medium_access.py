"""When a node may use the shared channel, and how long it tries to deliver a packet.

The chip cannot sense the carrier before it sends (RPD notices only neighbours within a fraction of
the range), so the channel is ALOHA: only the rules of the senders keep it from collapsing. This
module has those rules, without chips, threads and clocks. The driver and the fast model of the air
(`inprocess.shared_air`) both use it.

1. The number of tries is bounded. The pauses between them are random and double with each try
   (binary exponential back-off; Metcalfe and Boggs, Ethernet, 1976). With retransmissions at a
   fixed distance, as the chip makes them by itself, two senders would collide again and again.
2. A node whose first tries fail makes longer pauses from the start, and leaves more time between
   its packets. This keeps ALOHA stable (Lam and Kleinrock, 1975: the retransmission rate must
   fall as the backlog grows). Without carrier sense, a node can judge only by its own failures.
3. Packets that many nodes would send at the same moment get a random delay: broadcasts, and
   answers to one (RFC 5148, jitter).
4. A node leaves a gap after each of its packets, so that a burst of them (a check of all
   neighbours) does not occupy the channel as a block.
5. Users' packets for one receiver follow each other in trains, without the gap between them: a pair
   that is alone gets most of the channel. Trains get shorter as the channel gets busier, and stop
   when a packet of the mesh waits. A node that hears a train sends only after its end, and the
   sender then pauses, so that answers get through and relays get their turn. For a relay a train
   ends with a packet (see trains.py). A pause does not end it: the sender was interrupted, and a
   relay that forwarded its packets now would not hear the rest of the train. Packets in a back-off
   for the sender of the train are sent right after it, because that node listens then.
6. Each receiver has its own queue, so that waiting for one does not delay the others. A receiver
   that did not acknowledge a packet, and was not heard since, gets fewer tries for the next one.
"""

from __future__ import annotations

import enum
import math
import random
from collections import deque
from typing import Any

from drone_mesh.nrf24.access_rules import AccessRules

ALL_NODES = -1  # receiver of a broadcast
NO_SENDER = -1


class Priority(enum.IntEnum):
    """Which packets go first."""

    CONTROL = 0  # packets of the mesh itself
    DATA = 1


class InTrain(enum.Enum):
    """What an overheard packet shows about its train."""

    NO = "no"  # it belongs to none
    PERHAPS = "perhaps"  # another packet may follow at once
    MORE = "more"  # another packet follows, and the last one will say so
    LAST = "last"


class Fate(enum.Enum):
    """The outcome of one try."""

    WAITS = "waits"  # there will be another try
    DELIVERED = "delivered"  # acknowledged, or, if a broadcast, sent
    GIVEN_UP = "given up"


class OutgoingPacket:
    """One packet on its way out."""

    __slots__ = ("not_before_s", "payload", "priority", "queued_s", "receiver", "tries")

    def __init__(
        self, receiver: int, payload: bytes, priority: Priority, now_s: float, not_before_s: float
    ) -> None:
        self.receiver = receiver
        self.payload = payload
        self.priority = priority
        self.queued_s = now_s
        self.not_before_s = not_before_s
        self.tries = 0


_LEARNING = 0.1  # weight of the latest first try in the estimate of contention
_MOST_CONTENTION = 0.9
_STILL_THERE_S = 5.0  # our choice: a node that was heard so lately is believed to be there


class MediumAccess:
    """The packets that one node wants to send, and when it may try which of them.

    Belongs to one thread at a time. `due` selects the packet to try now; the result of the try goes
    to `tried`.
    """

    def __init__(self, rules: AccessRules, rng: random.Random) -> None:
        self.rules = rules
        self._rng = rng
        self._lines: dict[int, deque[OutgoingPacket]] = {}  # by receiver
        self._waiting = 0
        self._waiting_data = 0
        self._free_s = -math.inf  # the gap after the last packet ends
        self._broadcast_heard_s = -math.inf
        self._train_left = 0  # packets that may still follow in the train that is being sent
        self._yields_since_s = -math.inf  # to the trains of others
        self._yields_until_s = -math.inf
        self._yields_to = NO_SENDER  # whose train is under way
        self._has_yielded = False  # for long enough: it is this node's turn
        self._silent: set[int] = set()  # receivers that let a packet fail and were not heard since
        self._heard_s: dict[int, float] = {}
        self._counts = {"sent": 0, "acknowledged": 0, "lost": 0, "tries": 0, "broadcasts": 0}
        # Share of first tries that failed lately, 0 to _MOST_CONTENTION. A receiver that is gone
        # says nothing about the channel, so what it let fail does not count.
        self.contention = 0.0

    def __len__(self) -> int:
        """Packets that wait."""
        return self._waiting

    def offer(
        self, receiver: int, payload: bytes, now_s: float, priority: Priority = Priority.CONTROL
    ) -> bool:
        """Queue a packet for a node, or for ALL_NODES. False: too many packets wait already.

        Bytes that already wait for the same receiver are not queued twice.
        """
        line = self._lines.get(receiver)
        if line is not None and any(waiting.payload == payload for waiting in line):
            return True
        if self._waiting >= self.rules.queue_length:
            return False
        if priority is Priority.DATA and self.data_room() <= 0:
            return False
        rules, not_before_s = self.rules, now_s
        if receiver == ALL_NODES:
            not_before_s += self._rng.random() * rules.broadcast_jitter_s
        elif now_s - self._broadcast_heard_s < rules.answer_jitter_s:
            not_before_s += self._rng.random() * rules.answer_jitter_s
        if line is None:
            line = self._lines[receiver] = deque()
        packet = OutgoingPacket(receiver, payload, priority, now_s, not_before_s)
        if priority is Priority.DATA:
            self._waiting_data += 1
            line.append(packet)
        else:
            line.insert(_before_untried_data(line), packet)
        self._waiting += 1
        return True

    def data_room(self) -> int:
        """How many packets of priority DATA it would take now."""
        return self.rules.data_queue_length - self._waiting_data

    def heard(
        self, sender: int, now_s: float, *, broadcast: bool, train: InTrain = InTrain.NO
    ) -> None:
        """A packet came in; `train`: what it shows about its train."""
        self._silent.discard(sender)
        self._heard_s[sender] = now_s
        if train is not InTrain.NO:
            line = self._lines.get(sender)
            if line is not None:  # it will listen after its train: no reason to wait any longer
                line[0].not_before_s = min(line[0].not_before_s, now_s)
            if not self._has_yielded:
                self._yield_to(sender, now_s, train)
        if broadcast:
            self._broadcast_heard_s = now_s

    def _yield_to(self, sender: int, now_s: float, train: InTrain) -> None:
        """Wait for the end of the train that `sender` sends."""
        rules = self.rules
        if now_s > self._yields_until_s:
            self._yields_since_s, self._yields_to = now_s, NO_SENDER
        if train is InTrain.LAST:
            if sender == self._yields_to:
                self._yields_until_s, self._yields_to = now_s, NO_SENDER
            return
        if train is InTrain.MORE:
            self._yields_to = sender
        announced = self._yields_to != NO_SENDER
        pause_s = rules.train_hold_s if announced else rules.train_pause_s
        last_s = self._yields_since_s + (rules.most_hold_s if announced else rules.most_yield_s)
        until_s = min(now_s + pause_s, last_s)
        self._yields_until_s = until_s
        self._has_yielded = self._waiting > 0 and until_s == last_s

    @property
    def next_try_s(self) -> float:
        """When `due` will have something; infinity while nothing waits."""
        if not self._waiting:
            return math.inf
        first_s = min(line[0].not_before_s for line in self._lines.values())
        return max(first_s, self._free_s, self._yields_until_s)

    def due(self, now_s: float) -> OutgoingPacket | None:
        """The packet to try now. It stays in its queue until `tried` removes it."""
        if not self._waiting or now_s < max(self._free_s, self._yields_until_s):
            return None
        ready = [line[0] for line in self._lines.values() if line[0].not_before_s <= now_s]
        if not ready:
            return None
        packet = min(ready, key=lambda packet: (packet.priority, packet.not_before_s))
        quiet = max(0.0, 1.0 - self.contention / self.rules.busy_at)
        self._train_left = int(quiet * self.rules.train)
        return packet

    def following(self, before: OutgoingPacket, now_s: float) -> OutgoingPacket | None:
        """The packet that follows `before`, which was just delivered, in the same train."""
        line = self._lines.get(before.receiver)
        self._train_left -= 1
        if self._train_left <= 0 or not line or before.priority is not Priority.DATA:
            return None
        after = next((packet for packet in line if packet is not before), None)
        if after is None or after.tries or after.priority is not Priority.DATA:
            return None
        if any(
            waiting[0].priority is Priority.CONTROL and waiting[0].not_before_s <= now_s
            for waiting in self._lines.values()
        ):
            return None
        return after

    def tried(self, packet: OutgoingPacket, acknowledged: bool, now_s: float) -> Fate:
        """The result of a try that has just ended."""
        rules, receiver = self.rules, packet.receiver
        packet.tries += 1
        self._has_yielded = False
        gap_s = rules.gap_s / (1.0 - self.contention)
        self._free_s = now_s + 2.0 * self._rng.random() * gap_s
        if packet.priority is Priority.DATA and receiver != ALL_NODES:
            # After a success the receiver may answer, and after a failure no answer waits.
            pause_s = rules.train_gap_s if acknowledged else rules.train_pause_s
            self._free_s = now_s + pause_s + self._rng.random() * gap_s
        counts = self._counts
        if receiver == ALL_NODES:
            counts["broadcasts"] += acknowledged
            self._remove(packet)
            return Fate.DELIVERED
        counts["tries"] += packet.tries > 1
        if acknowledged:
            counts["sent"] += 1
            counts["acknowledged"] += 1
            self._learn(packet.tries > 1)
            self._silent.discard(receiver)
            self._remove(packet)
            return Fate.DELIVERED
        most = rules.tries_when_silent if receiver in self._silent else rules.tries
        if packet.tries >= most or now_s - packet.queued_s > rules.lifetime_s:
            counts["sent"] += 1
            counts["lost"] += 1
            if self._heard_s.get(receiver, -math.inf) > packet.queued_s - _STILL_THERE_S:
                self._learn(True)  # it is there, so the channel is to blame
            self._silent.add(receiver)
            self._remove(packet)
            return Fate.GIVEN_UP
        packet.not_before_s = now_s + self._pause_s(packet.tries)
        return Fate.WAITS

    def figures(self) -> dict[str, Any]:
        """Packets by outcome, and the state of the queue, as in RadioStatistics."""
        return {**self._counts, "waiting": self._waiting, "contention": self.contention}

    @property
    def patience(self) -> float:
        """For how many check periods the mesh should not probe again what works.

        0 on a quiet channel, and more as the node's own tries fail more often.
        """
        return self.rules.most_patience * min(1.0, self.contention / self.rules.busy_at)

    def retransmits(self) -> tuple[int, int]:
        """How often the chip repeats a frame by itself, and its ARD setting, for one try."""
        low, high = self.rules.retransmit_delays
        return self.rules.retransmits, self._rng.randint(low, high)

    def train_retransmits(self) -> tuple[int, int]:
        """The same for a packet that follows another one in a train.

        The receiver heard the one before, and its neighbours wait: damage is likelier than a
        collision, and a pause would only end the train.
        """
        return self.rules.train_retransmits, self.rules.retransmit_delays[0]

    def clear(self) -> list[OutgoingPacket]:
        """Give up all that waits."""
        dropped = [packet for line in self._lines.values() for packet in line]
        self._lines.clear()
        self._waiting = self._waiting_data = 0
        return dropped

    def _learn(self, first_try_failed: bool) -> None:
        failed = _MOST_CONTENTION if first_try_failed else 0.0
        self.contention += _LEARNING * (failed - self.contention)

    def _pause_s(self, tries: int) -> float:
        rules = self.rules
        mean_s = rules.first_pause_s / (1.0 - self.contention) ** 2 * 2.0 ** (tries - 1)
        return min(mean_s, rules.longest_pause_s) * 2.0 * self._rng.random()

    def _remove(self, packet: OutgoingPacket) -> None:
        line = self._lines.get(packet.receiver)
        if line is None or packet not in line:
            return  # all was given up meanwhile
        line.remove(packet)
        self._waiting -= 1
        self._waiting_data -= packet.priority is Priority.DATA
        if not line:
            del self._lines[packet.receiver]


def _before_untried_data(line: deque[OutgoingPacket]) -> int:
    """The place in a line for a packet of the mesh: before all data that was not tried yet."""
    place = len(line)
    while place and line[place - 1].priority is Priority.DATA and not line[place - 1].tries:
        place -= 1
    return place
