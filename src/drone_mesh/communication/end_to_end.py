"""EndToEnd: proves which node made a packet, over all relays (docs/security.md, "End-to-end seal").

The hop seal shows that some node of the mesh sent a packet. This one shows the addressee which node
created it: an order comes from a node that holds the mesh key, a place from the node itself. Its
tag covers a nonce that the addressee announced, so that no packet outlives it, and a sequence
number, so that none counts twice.
"""

from __future__ import annotations

import hashlib
import hmac
import random
import struct
from collections import deque
from typing import NamedTuple

from drone_mesh.communication import messages
from drone_mesh.communication.interfaces import MAX_NODE_ID, PAYLOAD_BYTES
from drone_mesh.communication.keys import Keys
from drone_mesh.communication.messages import MessageType
from drone_mesh.communication.replay import ReplayWindow
from drone_mesh.communication.seal import SEAL_AT, SEAL_BYTES
from drone_mesh.errors import PacketError

NEW_NONCE_AFTER_S = 5.0  # our choice: with the next heartbeat to a gateway
NONCES = 3  # our choice: two heartbeats may be lost
SAME_PACKET_S = 0.1  # our choice: tries and copies follow each other at once
ORDER_TAG_BYTES = 6
TAG_BYTES = 4

_SEQUENCE = struct.Struct("<H")
_SEQUENCE_AT = SEAL_AT - _SEQUENCE.size
_SEQUENCES = 2**16
_NONCE = struct.Struct("<I")
_NONCE_AT = _SEQUENCE_AT - TAG_BYTES - _NONCE.size
_PRESENT_NONCE_AT = SEAL_AT - 2 - _NONCE.size  # before the digest of its frame

_HEARTBEAT = int(MessageType.HEARTBEAT)
_PRESENT = int(MessageType.PRESENT)
_MISSING = int(MessageType.MISSING)
_ORDER = int(MessageType.MOVE_TO_LOCATION)
_WITH_NONCE = {
    _HEARTBEAT: _NONCE_AT,
    int(MessageType.REQUESTLOCATION): _NONCE_AT,
    _PRESENT: _PRESENT_NONCE_AT,
}
_PLACES = (int(MessageType.LOCATION), int(MessageType.GATEWAY_PLACE))
_REPORTS = range(64, 125)  # the others of the range are for meshes with a key


def reserved_bytes(kind: int) -> int:
    """How many of the 27 bytes behind the header both seals of such a packet take."""
    if kind == _PRESENT:
        return SEAL_BYTES + _NONCE.size  # the digest of its frame moves
    if kind == _HEARTBEAT:
        return PAYLOAD_BYTES - _NONCE_AT
    if kind in _PLACES or kind in _REPORTS:
        return SEAL_BYTES + _SEQUENCE.size + TAG_BYTES
    return SEAL_BYTES


class _Nonce:
    """A nonce that this node announced, and the sequence numbers received for it."""

    def __init__(self, value: int) -> None:
        self.value = value
        self.windows: dict[int, ReplayWindow] = {}  # by creator


class _Sealed(NamedTuple):
    """The packet that was sealed last."""

    what: bytes
    proof: bytes
    at_s: float


class NotProven(PacketError):
    """A packet is not what its creator sealed for this node, or is a replay."""


class EndToEnd:
    """Seals the packets that one node creates, and checks those for it. Component's thread only."""

    def __init__(self, node_id: int, keys: Keys, rng: random.Random) -> None:
        """`rng` draws the nonces."""
        self._node_id = node_id
        self._keys = keys
        self._rng = rng
        self._nonces = deque([_Nonce(rng.getrandbits(32))], maxlen=NONCES)
        self._changed_s = 0.0
        self._heard: dict[int, int] = {}  # the nonces of others
        self._sequences: dict[int, int] = {}  # by addressee: the number used last
        self._gateways: set[int] = set()  # nodes that proved to be one
        self._is_gateway = False
        self._last: _Sealed | None = None

    # Own packets -----------------------------------------------------------------------------

    def seal(self, payload: bytes, now_s: float) -> bytes | None:
        """A packet of this node, sealed; None: its addressee has not announced a nonce yet."""
        kind, forward = payload[2], payload[4]
        nonce_at = _WITH_NONCE.get(kind)
        if nonce_at is not None:
            payload = self._with_nonce(payload, nonce_at, now_s)
        key = self._key(payload, self._node_id, forward)
        if key is None:
            return payload
        if kind == _HEARTBEAT:
            self._is_gateway = True
        nonce = self._heard.get(forward)
        if nonce is None:
            # Heartbeats are sent even without a proof, because they find neighbours.
            return payload if kind == _HEARTBEAT else None
        what, last = messages.identity(payload), self._last
        if last is not None and last.what == what and now_s - last.at_s <= SAME_PACKET_S:
            proof = last.proof  # another try, or a copy for another neighbour
        else:
            proof = self._proof(payload, key, nonce, self._next_sequence(forward))
            self._last = _Sealed(what, proof, now_s)
        return payload[: SEAL_AT - len(proof)] + proof + payload[SEAL_AT:]

    def _with_nonce(self, payload: bytes, at: int, now_s: float) -> bytes:
        to_gateway = payload[2] == _HEARTBEAT and payload[4] == messages.heartbeat_body(payload)[1]
        if to_gateway and now_s - self._changed_s >= NEW_NONCE_AFTER_S:
            self._nonces.appendleft(_Nonce(self._rng.getrandbits(32)))
            self._changed_s = now_s
        return payload[:at] + _NONCE.pack(self._nonces[0].value) + payload[at + _NONCE.size :]

    def _next_sequence(self, forward: int) -> int:
        before = self._sequences.get(forward)
        if before is None:
            before = self._rng.getrandbits(16)
        self._sequences[forward] = sequence = (before + 1) % _SEQUENCES
        return sequence

    def is_gateway(self, node: int) -> bool:
        """Whether this node has proved to be a gateway."""
        return node in self._gateways

    # Packets of others -----------------------------------------------------------------------

    def open(self, payload: bytes) -> bytes:
        """Check a packet for this node or for all, and remove this seal.

        Raises NotProven if it is not authentic.
        """
        creator, kind = payload[0], payload[2]
        at = _WITH_NONCE.get(kind)
        key = self._key(payload, creator, payload[4])
        if key is not None:
            proof_bytes = self._check(payload, key)
            at = at or SEAL_AT - proof_bytes
        elif kind in _PLACES and creator in self._gateways:
            raise NotProven("a gateway's place that any node could have broadcast")
        elif kind == _MISSING and creator != payload[1] and not self._is_gateway:
            raise NotProven("a relayed MISSING")  # only sent to gateways, about orders
        if at is None:
            return payload
        if kind in _WITH_NONCE:
            self._heard[creator] = _NONCE.unpack_from(payload, at)[0]
        if kind == _PRESENT:
            return payload[:at] + bytes(_NONCE.size) + payload[at + _NONCE.size :]
        return payload[:at].ljust(len(payload), b"\0")

    def _check(self, payload: bytes, key: bytes) -> int:
        """The number of bytes of a valid proof. Raises NotProven without one."""
        creator, kind = payload[0], payload[2]
        sequence = _SEQUENCE.unpack_from(payload, _SEQUENCE_AT)[0]
        for nonce in self._nonces:
            proof = self._proof(payload, key, nonce.value, sequence)
            if not hmac.compare_digest(proof, payload[SEAL_AT - len(proof) : SEAL_AT]):
                continue
            if not _use(nonce.windows, creator, sequence):
                raise NotProven("a packet that came before")
            if kind == _HEARTBEAT:
                self._gateways.add(creator)
            return len(proof)
        if kind == _HEARTBEAT:
            raise NotProven("a heartbeat without the proof of a gateway")
        raise NotProven("an order without proof" if kind == _ORDER else "a packet without proof")

    # Both ------------------------------------------------------------------------------------

    def _key(self, payload: bytes, creator: int, forward: int) -> bytes | None:
        """The key that a packet from `creator` to `forward` needs; None: it needs none."""
        if forward > MAX_NODE_ID or creator > MAX_NODE_ID:
            return None
        kind = payload[2]
        if kind == _HEARTBEAT:
            from_gateway = creator == messages.heartbeat_body(payload)[1]
            return self._keys.authority_over(forward) if from_gateway else None
        if kind == _ORDER:
            return self._keys.authority_over(forward)
        if kind in _PLACES or kind in _REPORTS:
            return self._keys.pair(creator, forward)
        return None

    def _proof(self, payload: bytes, key: bytes, nonce: int, sequence: int) -> bytes:
        """Tag and sequence number, as placed before the hop seal."""
        size = ORDER_TAG_BYTES if payload[2] == _ORDER else TAG_BYTES
        number = _SEQUENCE.pack(sequence)
        what = messages.identity(payload[: _SEQUENCE_AT - size])
        tag = hashlib.blake2s(
            _NONCE.pack(nonce) + number + what, key=key, digest_size=size, person=b"end2end"
        )
        return tag.digest() + number


def _use(windows: dict[int, ReplayWindow], creator: int, sequence: int) -> bool:
    window = windows.get(creator)
    if window is None:
        windows[creator] = ReplayWindow(sequence)
        return True
    return window.use(window.expand(sequence))
