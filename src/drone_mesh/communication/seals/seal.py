"""HopSeal: proves that a node of this mesh has just sent a packet (docs/security.md, "Hop seal").

The last 7 bytes of each packet: the low 2 bytes of a counter of its sender, and a tag of 5 bytes
over everything before them, the counter and the sender's epoch. The key is that of the network for
packets to all, otherwise that of the pair, so a captured node cannot impersonate another one. An
epoch is 8 random bytes that a node draws at each start; a receiver learns it through a challenge
that only that node can answer. So there is no stored state to lose, and no packet of an earlier
epoch is accepted.
"""

from __future__ import annotations

import enum
import hashlib
import math
import random
import struct
from collections import OrderedDict, deque
from dataclasses import dataclass
from hmac import compare_digest
from typing import NamedTuple

from drone_mesh.communication.interfaces import BROADCAST, PAYLOAD_BYTES
from drone_mesh.communication.seals.keys import Keys
from drone_mesh.communication.seals.replay import AgedWindow
from drone_mesh.communication.timing import RateLimit
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.messages import FORWARD_AT, FROM_AT, TO_AT
from drone_mesh.communication.wire.packet_types import MessageType

TAG_BYTES = 5
SEAL_BYTES = 2 + TAG_BYTES
SEAL_AT = PAYLOAD_BYTES - SEAL_BYTES
TAG_AT = PAYLOAD_BYTES - TAG_BYTES
LAST_COUNT = 2**32 - 1  # the last counter of an epoch: an answer carries 4 bytes
WAITING_CHALLENGES = 16  # most unanswered challenges
CHALLENGE_AGAIN_S = 2.0  # least time between two challenges to one node
OWN_ID_AGAIN_S = 0.5  # the same to another radio with this node's id, which acknowledges none
CHALLENGE_OUT_S = 0.5  # after this time another challenge may replace it
LATE_ANSWER_S = 10.0  # on a busy channel an answer waits for seconds in the queue of its sender
LATE_CHALLENGES = 64  # that are no longer pending and may have such an answer
MOST_DOUBTED = 16  # in CHALLENGE_AGAIN_S, challenges to nodes that are known
DOUBTS = 3  # the pause after false alarms doubles so many times, to 16 s
ANSWERS = 4  # to one node in CHALLENGE_AGAIN_S
MOST_ANSWERS = 64  # to all nodes in CHALLENGE_AGAIN_S
OVERTAKING = 32  # broadcasts that may overtake an answer in a queue
NONCES_KEPT = 64  # of each node; an answered challenge is not answered again

_EPOCH_BITS, _NONCE_BITS = 64, 64
_CHALLENGE = struct.Struct("<Q")  # nonce
_ANSWER = struct.Struct("<QQI")  # the nonce of the challenge, epoch, counter
_LOW_BYTES = 2**16 - 1  # the part of a counter that a packet carries

# Each takes the whole packet (or all of it from `forward` on) and keeps only the bytes before its
# seal: one call is cheaper than joining slices.
_covered = struct.Struct(f"<I{SEAL_AT}s").pack  # counter, packet
_covered_to_all = struct.Struct(f"<I{TO_AT}sB{SEAL_AT - FORWARD_AT}s").pack
_sealed = struct.Struct(f"<{SEAL_AT}sH{TAG_BYTES}s").pack  # packet, counter, tag
_unsealed = struct.Struct(f"{SEAL_AT}s{SEAL_BYTES}x").pack


class _Peer:
    """A neighbour with a known epoch."""

    __slots__ = ("epoch", "heard_s", "state", "state_to_all", "window", "window_to_all")

    def __init__(
        self, network_key: bytes, pair_key: bytes, epoch: int, count: int, now_s: float
    ) -> None:
        self.epoch = epoch
        self.state_to_all = _epoch_state(network_key, epoch)
        self.state = _epoch_state(pair_key, epoch)
        self.window = AgedWindow(count, now_s)  # only the node itself can move it
        self.window_to_all = AgedWindow(count, now_s)  # any node with the network key can
        self.heard_s = now_s

    def answered(self, count: int, late: bool, now_s: float) -> None:
        """It has proved that this was its count: earlier packets are used up.

        A few broadcasts may have overtaken the answer, and any number a late one; otherwise one
        that was further ahead was not its own.
        """
        self.window.restart(max(count, self.window.highest), now_s)
        ahead = self.window_to_all.highest - count
        is_own = ahead > 0 and (late or ahead <= OVERTAKING)
        self.window_to_all.restart(count + ahead if is_own else count, now_s)
        self.heard_s = now_s


class _Challenge(NamedTuple):
    nonce: int
    sent_s: float
    doubted: bool  # the node was known, so the reason may be a packet of somebody else


@dataclass
class _Asked:
    """When a node may be challenged again."""

    next_s: float = -math.inf
    doubts: int = 0  # challenges in a row that its answers showed to be needless


class NotOpened(enum.Enum):
    """Why a packet was not opened."""

    UNKNOWN = "the epoch of its sender is not known"
    DOUBTFUL = "its sender has restarted, or it is not from that node"
    LATE = "a copy of a packet of the last seconds, or overtaken by an answer"
    REPLAYED = "a packet of long ago"


@dataclass(eq=False)
class HopSeal:
    """Seals and opens the packets of one node. Belongs to its component's thread."""

    _node_id: int
    _keys: Keys
    _rng: random.Random  # draws epochs and nonces: a cryptographic one on real nodes
    # A neighbour that was silent for longer is challenged again, so that a packet that an attacker
    # has held back is worthless after that time.
    _fresh_s: float

    def __post_init__(self) -> None:
        self._peers: dict[int, _Peer] = {}
        self._challenges: OrderedDict[int, _Challenge] = OrderedDict()  # oldest first
        self._late: deque[tuple[int, _Challenge]] = deque(maxlen=LATE_CHALLENGES)
        self._asked: dict[int, _Asked] = {}
        self._doubted = RateLimit(MOST_DOUBTED, CHALLENGE_AGAIN_S)  # all nodes together: 0
        self._answers = RateLimit(ANSWERS, CHALLENGE_AGAIN_S)
        self._all_answers = RateLimit(MOST_ANSWERS, CHALLENGE_AGAIN_S)  # all nodes together: 0
        self._answered: dict[int, deque[int]] = {}  # by node: its nonces that had an answer
        self._epoch = self._count = 0
        self._state_to_all = _epoch_state(self._keys.network, 0)
        self._states: dict[int, hashlib.blake2s] = {}  # by receiver
        self._begin_epoch()

    # Packets of the mesh ---------------------------------------------------------------------

    def seal(self, payload: bytes) -> bytes:
        """The same packet with a seal in its last 7 bytes, which are overwritten."""
        if self._count == LAST_COUNT:
            self._begin_epoch()
        self._count = count = self._count + 1
        if payload[FORWARD_AT] == BROADCAST:  # `to` differs for each receiver
            tag = self._state_to_all.copy()
            tag.update(_covered_to_all(count, payload, BROADCAST, payload[FORWARD_AT:]))
        else:
            state = self._states.get(payload[TO_AT])
            tag = (state or self._state_to(payload[TO_AT])).copy()
            tag.update(_covered(count, payload))
        return _sealed(payload, count & _LOW_BYTES, tag.digest())

    def open(self, payload: bytes, now_s: float) -> bytes | None:
        """The packet with zeros in place of its seal; None unless it is authentic and new."""
        peer = self._peers.get(payload[FROM_AT])
        if peer is None or now_s - peer.heard_s > self._fresh_s:
            return None
        window, count = _place(payload, peer)
        if not _is_authentic(payload, peer, count):
            return None
        if window.is_old(count, now_s) or not window.use(count):
            return None
        peer.heard_s = now_s
        return _unsealed(payload)

    def why_not(self, payload: bytes, now_s: float) -> NotOpened:
        """Why a packet was not opened a moment ago."""
        if not self.knows(payload[FROM_AT], now_s):
            return NotOpened.UNKNOWN
        peer = self._peers[payload[FROM_AT]]
        window, count = _place(payload, peer)
        if not _is_authentic(payload, peer, count):
            return NotOpened.DOUBTFUL
        return NotOpened.REPLAYED if window.is_old(count, now_s) else NotOpened.LATE

    def knows(self, node: int, now_s: float) -> bool:
        """Whether the epoch of this neighbour is known and it was heard recently."""
        peer = self._peers.get(node)
        return peer is not None and now_s - peer.heard_s <= self._fresh_s

    # Epochs ----------------------------------------------------------------------------------

    def challenge(self, node: int, now_s: float) -> bytes | None:
        """A packet that requests a neighbour's epoch; None: too soon after the last one.

        The number of pending challenges is bounded; an answered one no longer counts.
        """
        while self._challenges and now_s - self._oldest_s() >= CHALLENGE_AGAIN_S:
            self._late.append(self._challenges.popitem(last=False))
        asked = self._asked.setdefault(node, _Asked())
        if now_s < asked.next_s:
            return None
        pending = self._challenges.pop(node, None)
        if pending is not None:
            self._late.append((node, pending))
        doubted = self.knows(node, now_s)
        if doubted and not self._doubted.count(0, now_s):
            return None
        if len(self._challenges) >= WAITING_CHALLENGES:
            if now_s - self._oldest_s() < CHALLENGE_OUT_S:
                return None
            self._late.append(self._challenges.popitem(last=False))
        nonce = self._rng.getrandbits(_NONCE_BITS)
        self._challenges[node] = _Challenge(nonce, now_s, doubted)
        again_s = OWN_ID_AGAIN_S if node == self._node_id else CHALLENGE_AGAIN_S
        asked.next_s = now_s + again_s * (2**asked.doubts if doubted else 1)
        return self._proven(MessageType.SEAL_CHALLENGE, node, _CHALLENGE.pack(nonce))

    @property
    def crowded(self) -> bool:
        """Whether so many challenges are unanswered that many of those nodes cannot exist."""
        return len(self._challenges) > WAITING_CHALLENGES // 2

    def answer(self, challenge: bytes, now_s: float) -> bytes | None:
        """The answer to a challenge; None: it had one, or there were too many challenges."""
        node = messages.sender(challenge)
        (nonce,) = _CHALLENGE.unpack_from(challenge, messages.HEADER_BYTES)
        answered = self._answered.setdefault(node, deque(maxlen=NONCES_KEPT))
        if nonce in answered or self._all_answers.reached(0, now_s):
            return None
        if not self._answers.count(node, now_s):
            return None
        self._all_answers.count(0, now_s)
        answered.append(nonce)
        body = _ANSWER.pack(nonce, self._epoch, self._count)
        return self._proven(MessageType.SEAL_ANSWER, messages.sender(challenge), body)

    def answered(self, answer: bytes, now_s: float) -> bool | None:
        """Store a neighbour's epoch from its answer; returns whether that epoch is new.

        None: it is not an answer to a challenge of this node.
        """
        node = messages.sender(answer)
        nonce, epoch, count = _ANSWER.unpack_from(answer, messages.HEADER_BYTES)
        waiting = self._challenge_with(node, nonce, now_s)
        if waiting is None or not self.is_proven(answer):
            return None
        if epoch == self._epoch:  # its own, thrown back at it
            return None
        self._challenges.pop(node, None)
        self._late = deque((one for one in self._late if one[0] != node), LATE_CHALLENGES)
        known = self._peers.get(node)
        if known is not None and known.epoch == epoch:
            known.answered(count, now_s - waiting.sent_s >= CHALLENGE_AGAIN_S, now_s)
            doubts = self._asked[node].doubts
            self._asked[node].doubts = min(doubts + 1, DOUBTS) if waiting.doubted else 0
            return False
        self._asked[node] = _Asked(now_s + CHALLENGE_AGAIN_S)
        self._peers[node] = _Peer(self._keys.network, self._pair_key(node), epoch, count, now_s)
        return True

    def _challenge_with(self, node: int, nonce: int, now_s: float) -> _Challenge | None:
        """The challenge of this node that an answer belongs to."""
        pending = self._challenges.get(node)
        if pending is not None and pending.nonce == nonce:
            return pending
        late = (one for to, one in self._late if to == node and one.nonce == nonce)
        return next((one for one in late if now_s - one.sent_s < LATE_ANSWER_S), None)

    def _oldest_s(self) -> float:
        return next(iter(self._challenges.values())).sent_s

    def _begin_epoch(self) -> None:
        self._epoch = self._rng.getrandbits(_EPOCH_BITS)
        self._count = 0
        self._state_to_all = _epoch_state(self._keys.network, self._epoch)
        self._states.clear()

    def _state_to(self, receiver: int) -> hashlib.blake2s:
        self._states[receiver] = state = _epoch_state(self._pair_key(receiver), self._epoch)
        return state

    def _pair_key(self, other: int) -> bytes:
        key = self._keys.pair(self._node_id, other)
        assert key is not None, "a node has its own keys"
        return key

    def _proven(self, kind: MessageType, to: int, body: bytes) -> bytes:
        packet = messages.packet(kind, self._node_id, self._node_id, to, to, body)[:TAG_AT]
        return packet + self._proof(packet, to)

    def is_proven(self, payload: bytes) -> bool:
        """Whether a challenge or an answer is one of a node with the key, now or earlier."""
        proof = self._proof(payload[:TAG_AT], messages.sender(payload))
        return compare_digest(proof, payload[TAG_AT:])

    def _proof(self, packet: bytes, other: int) -> bytes:
        """The tag of a challenge or an answer.

        It covers all but byte 3, which differs for each receiver of a broadcast challenge.
        """
        key = self._pair_key(other)
        covered = packet[:TO_AT] + packet[FORWARD_AT:]
        tag = hashlib.blake2s(covered, key=key, digest_size=TAG_BYTES, person=b"epochs")
        return tag.digest()


def _place(payload: bytes, peer: _Peer) -> tuple[AgedWindow, int]:
    """The window of a packet, and its counter."""
    window = peer.window_to_all if payload[FORWARD_AT] == BROADCAST else peer.window
    return window, window.expand(payload[SEAL_AT] | payload[SEAL_AT + 1] << 8)


def _is_authentic(payload: bytes, peer: _Peer, count: int) -> bool:
    """Whether this packet has the tag that belongs to the counter."""
    if not 0 <= count <= LAST_COUNT:
        return False
    if payload[FORWARD_AT] == BROADCAST:
        tag = peer.state_to_all.copy()
        tag.update(_covered_to_all(count, payload, BROADCAST, payload[FORWARD_AT:]))
    else:
        tag = peer.state.copy()
        tag.update(_covered(count, payload))
    return compare_digest(tag.digest(), payload[TAG_AT:])


def _epoch_state(key: bytes, epoch: int) -> hashlib.blake2s:
    """The hash state for the tags of an epoch's packets; to be copied for each packet."""
    state = hashlib.blake2s(key=key, digest_size=TAG_BYTES, person=b"hop")
    state.update(struct.pack("<Q", epoch))
    return state
