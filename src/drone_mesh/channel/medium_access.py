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
   answers to one (RFC 5148, jitter). A broadcast of the mesh provokes no packets of users.
4. A node leaves a gap after each of its packets, so that a burst of them (a check of all
   neighbours) does not occupy the channel as a block.
5. Users' packets for one receiver follow each other in trains, without the gap between them: a pair
   that is alone gets most of the channel. Trains get shorter as the channel gets busier, and stop
   when a packet of the mesh waits. A node that hears a train sends only after its end, and the
   sender then pauses, so that answers get through and relays get their turn. For a relay a train
   ends with a packet (trains.py). A pause does not end it: the sender was interrupted, and a
   relay that forwarded its packets now would not hear the rest of the train. Packets in a back-off
   for the sender of the train are sent right after it, because that node listens then.
6. Each receiver has its own queue, so that waiting for one does not delay the others, and another
   one for users' packets, because a packet of the mesh may fail for seconds. If packets of both may
   be sent, that of the mesh goes first, so users' packets never hold it up for longer than a try.
   They wait only for an answer to a challenge, which lets their receiver open them. A receiver that
   did not acknowledge a packet, and was not heard since, gets fewer tries for the next one; so does
   one that has been silent for longer than nodes of a mesh at rest are.
7. Where tries are limited, as every node is heard each second, and on a full channel, a packet
   whose sender begins anew when it is lost is tried once, and a challenge at a random moment: all
   who hear a newcomer challenge it, and among drones that fly there is always one.
"""

from __future__ import annotations

import enum
import math
import random
from dataclasses import replace
from typing import Final

from drone_mesh.channel.access_rules import AccessRules
from drone_mesh.channel.packet_queue import ALL_NODES, OutgoingPacket, PacketQueue
from drone_mesh.channel.statistics import RadioStatistics
from drone_mesh.channel.trains import InTrain, Yielding
from drone_mesh.communication.wire.packet_types import Priority


class Fate(enum.Enum):
    """The outcome of one try."""

    WAITS = "waits"  # there will be another try
    DELIVERED = "delivered"  # acknowledged, or, if a broadcast, sent
    GIVEN_UP = "given up"


_LEARNING: Final = 0.1  # weight of the latest first try in the estimate of contention
_MOST_CONTENTION: Final = 0.9


class MediumAccess:
    """The packets that one node wants to send, and when it may try which of them.

    Belongs to one thread at a time. `due` selects the packet to try now; the result of the try goes
    to `tried`.
    """

    def __init__(self, rules: AccessRules, rng: random.Random) -> None:
        self.rules = rules
        self._rng = rng
        self._queue = PacketQueue()
        self._yielding = Yielding(rules)
        self._free_s = -math.inf  # the gap after the last packet ends
        self._broadcast_heard_s = {priority: -math.inf for priority in Priority}
        self._train_left = 0  # packets that may still follow in the train that is being sent
        self._silent: set[int] = set()  # receivers that let a packet fail and were not heard since
        self._heard_s: dict[int, float] = {}
        self.counters = RadioStatistics()  # of packets by outcome here, of the rest in the radio
        # Share of first tries that failed recently, 0 to _MOST_CONTENTION. Tries to reach a
        # receiver that is gone do not count, because they say nothing about the channel.
        self.contention = 0.0

    def __len__(self) -> int:
        return len(self._queue)

    def offer(
        self,
        receiver: int,
        payload: bytes,
        now_s: float,
        priority: Priority = Priority.CONTROL,
        jittered: bool = True,
        once: bool = False,
    ) -> bool:
        """Queue a packet for a node, or for ALL_NODES. False: too many packets wait already.

        `once`: its sender begins anew. Without `jittered`, the sender of a broadcast or of such a
        packet has chosen a random moment itself.

        Bytes that already wait for the same receiver are not queued twice.
        """
        if self._queue.has(receiver, priority, payload):
            return True
        if len(self._queue) >= self.rules.queue_length:
            return False
        if priority is Priority.DATA and self.data_room() <= 0:
            return False
        rules, not_before_s = self.rules, now_s
        if receiver == ALL_NODES:
            not_before_s += self._rng.random() * rules.broadcast_jitter_s * jittered
        elif once and self._is_full:
            not_before_s += self._rng.random() * rules.once_jitter_s * jittered
        elif now_s - self._broadcast_heard_s[priority] < rules.answer_jitter_s:
            not_before_s += self._rng.random() * rules.answer_jitter_s
        self._queue.add(OutgoingPacket(receiver, payload, priority, now_s, not_before_s, once))
        return True

    def limit_tries(self, most: int) -> None:
        """Give up a packet after so many tries at most; if its sender begins anew, after one."""
        self.rules = replace(self.rules, tries=min(self.rules.tries, most), is_limited=True)

    def data_room(self) -> int:
        """How many packets of priority DATA it would take now."""
        return self.rules.data_queue_length - self._queue.data

    def heard(
        self,
        sender: int,
        now_s: float,
        *,
        broadcast: Priority | None = None,
        train: InTrain = InTrain.NO,
    ) -> None:
        """A packet came in; `train`: what it shows about its train.

        `broadcast`: it went to several nodes, which may now all send answers of this priority.
        """
        self._silent.discard(sender)
        self._heard_s[sender] = now_s
        if train is not InTrain.NO:
            self._queue.hurry(sender, now_s)  # it will listen after its train
            self._yielding.heard(sender, train, now_s, wants_to_send=len(self._queue) > 0)
        if broadcast is not None:
            self._broadcast_heard_s[broadcast] = now_s

    @property
    def next_try_s(self) -> float:
        """When `due` will have something; infinity while nothing waits."""
        return max(self._queue.first_s(), self._free_s, self._yielding.until_s)

    def due(self, now_s: float) -> OutgoingPacket | None:
        """The packet to try now. It stays in its queue until `tried` removes it."""
        if now_s < max(self._free_s, self._yielding.until_s):
            return None
        ready = self._queue.ready(now_s)
        if not ready:
            return None
        packet = min(ready, key=lambda packet: (packet.priority, packet.not_before_s))
        quiet = max(0.0, 1.0 - self.contention / self.rules.busy_at)
        self._train_left = int(quiet * self.rules.train)
        return packet

    def following(self, before: OutgoingPacket, now_s: float) -> OutgoingPacket | None:
        """The packet that follows `before`, which was just delivered, in the same train."""
        self._train_left -= 1
        if self._train_left <= 0 or before.priority is not Priority.DATA:
            return None
        after = self._queue.after(before)
        if after is None or after.tries or after.priority is not Priority.DATA:
            return None
        if any(first.priority is Priority.CONTROL for first in self._queue.ready(now_s)):
            return None
        return after

    def tried(self, packet: OutgoingPacket, acknowledged: bool, now_s: float) -> Fate:
        """The result of a try that has just ended."""
        rules, receiver = self.rules, packet.receiver
        packet.tries += 1
        self._yielding.has_sent()
        gap_s = rules.gap_s / (1.0 - self.contention)
        self._free_s = now_s + 2.0 * self._rng.random() * gap_s
        if packet.priority is Priority.DATA and receiver != ALL_NODES:
            # After a success leave time for an answer; after a failure there will be none.
            pause_s = rules.train_gap_s if acknowledged else rules.train_pause_s
            self._free_s = now_s + pause_s + self._rng.random() * gap_s
        counters = self.counters
        if receiver == ALL_NODES:
            counters.broadcasts += acknowledged
            self._queue.remove(packet)
            return Fate.DELIVERED
        counters.tries += packet.tries > 1
        if acknowledged:
            counters.sent += 1
            counters.acknowledged += 1
            self._learn(packet.tries > 1)
            self._silent.discard(receiver)
            self._heard_s[receiver] = now_s
            self._queue.remove(packet)
            return Fate.DELIVERED
        if (
            (packet.once and self._is_full)
            or packet.tries >= self._most_tries(receiver, now_s)
            or now_s - packet.queued_s > rules.lifetime_s
        ):
            counters.sent += 1
            counters.lost += 1
            if self._heard_s.get(receiver, -math.inf) > packet.queued_s - rules.still_there_s:
                self._learn(True)  # it is there, so the channel is to blame
            if not packet.once:
                self._silent.add(receiver)
            self._queue.remove(packet)
            return Fate.GIVEN_UP
        packet.not_before_s = now_s + self._pause_s(packet.tries)
        return Fate.WAITS

    def _most_tries(self, receiver: int, now_s: float) -> int:
        """Few for a receiver that may be gone: it let a packet fail, or is silent for long."""
        rules = self.rules
        silent_s = now_s - self._heard_s.get(receiver, now_s)
        gone = receiver in self._silent or silent_s > rules.perhaps_gone_s
        return rules.tries_when_silent if gone else rules.tries

    def statistics(self) -> RadioStatistics:
        """The current counters, and the state of the queue."""
        return replace(self.counters, waiting=len(self._queue), contention=self.contention)

    @property
    def patience(self) -> float:
        """For how many check periods the mesh should not probe routes that work.

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

    def clear(self) -> None:
        self._queue.clear()

    @property
    def _is_full(self) -> bool:
        """Whether first tries often fail, or the mesh limits the tries."""
        return self.rules.is_limited or self.contention >= self.rules.busy_at

    def _learn(self, first_try_failed: bool) -> None:
        failed = _MOST_CONTENTION if first_try_failed else 0.0
        self.contention += _LEARNING * (failed - self.contention)

    def _pause_s(self, tries: int) -> float:
        rules = self.rules
        mean_s = rules.first_pause_s / (1.0 - self.contention) ** 2 * 2.0 ** (tries - 1)
        return min(mean_s, rules.longest_pause_s) * 2.0 * self._rng.random()
