"""EndToEnd: proves to the addressee which node made a packet (docs/security.md, "End-to-end seal").

The hop seal shows that some node of the mesh sent a packet. This one shows the addressee which node
created it: an order comes from a node that holds the mesh key, a place from the node itself. Its
tag covers a nonce that the addressee announced, so that a packet is valid only while the nonce is,
and a sequence number, so that no packet counts twice.
"""

from __future__ import annotations

import hashlib
import random
import struct
from collections import deque
from dataclasses import dataclass, field
from hmac import compare_digest
from typing import Callable, NamedTuple

from drone_mesh.communication.interfaces import MAX_NODE_ID, PAYLOAD_BYTES
from drone_mesh.communication.seals.keys import Keys
from drone_mesh.communication.seals.replay import ReplayWindow
from drone_mesh.communication.seals.seal import SEAL_AT, SEAL_BYTES
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.messages import (
    CREATOR_AT,
    FORWARD_AT,
    FROM_AT,
    TYPE_AT,
)
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.errors import PacketError

NEW_NONCE_AFTER_S = 5.0  # with the next heartbeat to a gateway
UNUSED_NONCE_S = 30.0  # while nobody has proved anything for it: on a full channel answers are slow
# Of a gateway: a restarted router cannot know which sequence numbers it has used, and some hear a
# gateway's nonce once a minute only.
NEW_GATEWAY_NONCE_AFTER_S = 60.0
NONCES = 3  # two heartbeats may be lost
EXPIRED = 3  # nonces before those: a packet for one of them was long on its way
SAME_PACKET_S = 0.1  # retransmissions and copies follow at once
ORDER_TAG_BYTES = 6
TAG_BYTES = 4

_SEQUENCE_BYTES = 2
_SEQUENCES = 2**16
_NONCE_BYTES = 4
_NONCE_AT = SEAL_AT - _SEQUENCE_BYTES - TAG_BYTES - _NONCE_BYTES
_DIGEST_BYTES = 2  # the frame digest of a PRESENT, which moves in front of the hop seal
_DIGEST_AT = SEAL_AT - _DIGEST_BYTES
_PRESENT_NONCE_AT = _DIGEST_AT - _NONCE_BYTES

_HEARTBEAT = int(MessageType.HEARTBEAT)
_REQUEST = int(MessageType.REQUESTLOCATION)
_PRESENT = int(MessageType.PRESENT)
_MISSING = int(MessageType.MISSING)
_ORDER = int(MessageType.MOVE_TO_LOCATION)
_BID = int(MessageType.MOVEMENT_NEGOTIATION)
_PLACES = (int(MessageType.LOCATION), int(MessageType.GATEWAY_PLACE))
_REPORTS = range(64, 125)  # 125..127 are sent only in a mesh with a key
# Of the types with a proof those that nodes also tell all in range, where nothing proves them.
_ALSO_TO_ALL = frozenset(
    map(int, (MessageType.LOCATION, MessageType.NODE_SEARCH, MessageType.LAST_PLACE))
)

# As in seal.py: each takes the whole packet but keeps only its first bytes.
_with_nonce = struct.Struct(f"<{_NONCE_AT}sI{PAYLOAD_BYTES - _NONCE_AT - _NONCE_BYTES}x").pack
_without_nonce = struct.Struct(f"{_NONCE_AT}s{PAYLOAD_BYTES - _NONCE_AT}x").pack
_present_with_nonce = struct.Struct(f"<{_PRESENT_NONCE_AT}sI{_DIGEST_BYTES}s{SEAL_BYTES}x").pack
_present_without_nonce = struct.Struct(
    f"{_PRESENT_NONCE_AT}s{_NONCE_BYTES + SEAL_BYTES}x{_DIGEST_BYTES}s"
).pack
_nonce_of = struct.Struct(f"<{_NONCE_AT}xI").unpack_from
_nonce_of_present = struct.Struct(f"<{_PRESENT_NONCE_AT}xI").unpack_from
_nonce_and_sequence = struct.Struct("<IH").pack


class _Form:
    """The layout of the proof in some types of packets, and its key."""

    def __init__(self, tag_bytes: int, by_authority: bool) -> None:
        """`by_authority`: the key is the authority over the addressee, else the pair's."""
        self.tag_bytes = tag_bytes
        self.by_authority = by_authority
        self.at = at = _DIGEST_AT - tag_bytes  # where the proof starts
        self.with_proof = struct.Struct(f"<{at}s{tag_bytes}sH{SEAL_BYTES}x").pack
        self.without_proof = struct.Struct(f"{at}s{PAYLOAD_BYTES - at}x").pack
        self.proof: Callable[[bytes], tuple[bytes, int]] = struct.Struct(
            f"<{at}x{tag_bytes}sH"
        ).unpack_from


_OF_PAIR = _Form(TAG_BYTES, by_authority=False)
_OF_ROUTER = _Form(TAG_BYTES, by_authority=False)  # a heartbeat to a gateway
_FORMS = {
    _HEARTBEAT: _Form(TAG_BYTES, by_authority=True),
    _ORDER: _Form(ORDER_TAG_BYTES, by_authority=True),
    **dict.fromkeys((*_PLACES, *_REPORTS), _OF_PAIR),
}


def reserved_bytes(kind: int) -> int:
    """How many of the 27 bytes after the header the two seals of such a packet take together."""
    if kind == _PRESENT:
        return SEAL_BYTES + _NONCE_BYTES
    if kind == _HEARTBEAT:
        return PAYLOAD_BYTES - _NONCE_AT
    if kind in _PLACES or kind in _REPORTS:
        return PAYLOAD_BYTES - _OF_PAIR.at
    return SEAL_BYTES


@dataclass(eq=False)
class _Nonce:
    """A nonce that this node announced, and the sequence numbers received for it."""

    value: int
    windows: dict[int, ReplayWindow] = field(default_factory=dict)  # by creator


class _Sealed(NamedTuple):
    """The packet that was sealed last."""

    what: bytes
    tag: bytes
    sequence: int
    at_s: float


class NotProven(PacketError):
    """A packet is not what its creator sealed for this node, or is a replay."""


class Replayed(NotProven):
    """A proven packet that was received before: mostly a copy that took another way."""


class Expired(NotProven):
    """A proven packet for a nonce that was valid a moment ago: it waited for a busy channel."""


@dataclass(eq=False)
class EndToEnd:
    """Seals the packets that one node creates, and checks those for it. Component's thread only."""

    _node_id: int
    _keys: Keys
    _rng: random.Random  # draws the nonces

    def __post_init__(self) -> None:
        self._nonces = deque([_Nonce(self._rng.getrandbits(32))], maxlen=NONCES)
        self._expired: deque[int] = deque(maxlen=EXPIRED)
        self._changed_s = 0.0
        self._heard: dict[int, int] = {}  # the nonces of others; any node can claim one
        self._proved: dict[int, int] = {}  # those that came with a proof
        self._ways: dict[int, int] = {}  # the neighbours through which these proofs came
        self._orders: dict[int, int] = {}  # by addressee: orders sealed since then
        self._sequences: dict[int, int] = {}  # by addressee: the number used last
        self._gateways: set[int] = set()  # nodes that proved to be one
        # By the addressee or, if the key is that of a pair, by the other node. A state is copied
        # for each proof, which saves hashing the key.
        self._states: dict[_Form, dict[int, hashlib.blake2s]] = {
            form: {} for form in (*_FORMS.values(), _OF_ROUTER)
        }
        self._is_gateway = False
        self._last: _Sealed | None = None

    # Own packets -----------------------------------------------------------------------------

    def seal(self, payload: bytes, now_s: float) -> bytes | None:
        """A packet of this node, sealed; None: its addressee has not announced a nonce yet."""
        kind, forward = payload[TYPE_AT], payload[FORWARD_AT]
        if kind == _PRESENT:
            digest = payload[-_DIGEST_BYTES:]
            return _present_with_nonce(payload, self._nonces[0].value, digest)
        if kind == _HEARTBEAT:
            gateway = messages.preferred_gateway(payload)
            is_gateway = gateway == self._node_id
            newest = self._nonces[0]
            lasts_s = NEW_NONCE_AFTER_S if newest.windows else UNUSED_NONCE_S
            if is_gateway:
                lasts_s = NEW_GATEWAY_NONCE_AFTER_S
            if (is_gateway or forward == gateway) and now_s - self._changed_s >= lasts_s:
                if len(self._nonces) == NONCES:
                    self._expired.append(self._nonces[-1].value)
                self._nonces.appendleft(_Nonce(self._rng.getrandbits(32)))
                self._changed_s = now_s
            payload = _with_nonce(payload, self._nonces[0].value)
            if not (is_gateway or forward == gateway or self._is_gateway):
                return payload
        elif kind == _REQUEST:
            return _with_nonce(payload, self._nonces[0].value)
        form = self._form(payload)
        if form is None or forward > MAX_NODE_ID:
            return payload
        state = self._states[form].get(forward) or self._state(form, forward)
        if state is None:
            return payload
        if kind == _HEARTBEAT and form is not _OF_ROUTER:
            self._is_gateway = True
        if forward not in self._heard:
            # Heartbeats are sent even without a proof, because they find neighbours.
            return payload if kind == _HEARTBEAT else None
        what, last = _what(payload, form), self._last
        if last is not None and last.what == what and now_s - last.at_s <= SAME_PACKET_S:
            # another try, or a copy for another neighbour
            return form.with_proof(payload, last.tag, last.sequence)
        if forward not in self._sequences:
            self._sequences[forward] = self._rng.getrandbits(16)
        sequence = self._sequences[forward] = (self._sequences[forward] + 1) % _SEQUENCES
        tag = _tag(state, self._nonce_for(kind, form, forward), sequence, what)
        self._last = _Sealed(what, tag, sequence, now_s)
        return form.with_proof(payload, tag, sequence)

    def _nonce_for(self, kind: int, form: _Form, forward: int) -> int:
        """The nonce of an addressee that this packet is valid for.

        A claimed nonce is that of the packet to answer, if it was not forged. An order answers
        none: a claim, which a restarted drone cannot prove yet, counts for every second try only.
        """
        claimed = self._heard[forward]
        if kind == _ORDER:
            tries = self._orders[forward] = self._orders.get(forward, 0) + 1
            return self._proved.get(forward, claimed) if tries % 2 else claimed
        if form is _OF_ROUTER or kind in _REPORTS:
            return self._proved.get(forward, claimed)
        return claimed

    @staticmethod
    def without_proof(payload: bytes) -> bytes:
        """A packet of this node, sealed or not, without its proof and nonce."""
        kind = payload[TYPE_AT]
        if kind in (_HEARTBEAT, _REQUEST):
            return _without_nonce(payload)
        form = _FORMS.get(kind)
        if form is None or payload[FORWARD_AT] > MAX_NODE_ID:
            return payload
        return form.without_proof(payload)

    def way_of_order(self, drone: int) -> int | None:
        """The neighbour that has carried the drone's last proof, for the tries with that nonce.

        Any node that relays can draw the route to a drone to itself, with packets in its name.
        """
        return self._ways.get(drone) if self._orders.get(drone, 0) % 2 else None

    def _form(self, payload: bytes) -> _Form | None:
        kind = payload[TYPE_AT]
        if kind == _HEARTBEAT and payload[CREATOR_AT] != messages.preferred_gateway(payload):
            return _OF_ROUTER
        return _FORMS.get(kind)

    def is_gateway(self, node: int) -> bool:
        """Whether this node has proved to be a gateway."""
        return node in self._gateways

    # Packets of others -----------------------------------------------------------------------

    def open(self, payload: bytes) -> bytes:
        """Check a packet for this node or for all, and remove this seal.

        Raises NotProven if it is not authentic.
        """
        creator, kind = payload[CREATOR_AT], payload[TYPE_AT]
        if kind == _PRESENT:
            self._heard[creator] = _nonce_of_present(payload)[0]
            return _present_without_nonce(payload, payload[_DIGEST_AT:])
        if kind == _REQUEST:
            self._heard[creator] = _nonce_of(payload)[0]
            return _without_nonce(payload)
        for_one = payload[FORWARD_AT] <= MAX_NODE_ID and creator <= MAX_NODE_ID
        form = _FORMS.get(kind)
        # Any captured node has the key of broadcasts. A bid has no proof, but who brings it counts.
        if (form or kind == _BID) and not for_one and kind not in _ALSO_TO_ALL:
            raise _unproven(kind)
        if kind == _HEARTBEAT:
            self._open_heartbeat(payload, creator)
            return _without_nonce(payload)
        if form is not None and for_one:
            self._check(payload, form)
            return form.without_proof(payload)
        if kind in _PLACES and creator in self._gateways:
            raise NotProven("a gateway's place that any node could have broadcast")
        if kind == _MISSING and creator != payload[FROM_AT] and not self._is_gateway:
            raise NotProven("a relayed MISSING")  # only sent to gateways, about orders
        return payload

    def _open_heartbeat(self, payload: bytes, creator: int) -> None:
        """Learn the nonce. Raises NotProven if it claims to be a gateway's and is not.

        So does one in the name of a gateway, which says to a router that it is none now.
        """
        nonce = _nonce_of(payload)[0]
        form = self._form(payload)
        assert form is not None, "heartbeats have a form"
        try:
            self._check(payload, form)
        except NotProven:
            if form is not _OF_ROUTER or (creator in self._gateways and not self._is_gateway):
                raise
        else:
            self._proved[creator] = nonce
            self._ways[creator] = payload[FROM_AT]
            self._orders[creator] = 0
            if form is not _OF_ROUTER:
                self._gateways.add(creator)
        self._heard[creator] = nonce

    def _check(self, payload: bytes, form: _Form) -> None:
        """Raises NotProven unless the proof is valid."""
        creator = payload[CREATOR_AT]
        node = self._node_id if form.by_authority else creator
        state = self._states[form].get(node) or self._state(form, node)
        assert state is not None, "a node has its own keys"
        tag, sequence = form.proof(payload)
        what = _what(payload, form)
        for nonce in self._nonces:
            if compare_digest(_tag(state, nonce.value, sequence, what), tag):
                window = nonce.windows.get(creator)
                if window is None:
                    nonce.windows[creator] = ReplayWindow(sequence)
                elif not window.use(window.expand(sequence)):
                    raise Replayed("a replayed packet")
                return
        if any(compare_digest(_tag(state, old, sequence, what), tag) for old in self._expired):
            raise Expired("a packet that came late")
        raise _unproven(payload[TYPE_AT])

    # Both ------------------------------------------------------------------------------------

    def _state(self, form: _Form, node: int) -> hashlib.blake2s | None:
        """The hash state for proofs of this form; None: this node does not have the key."""
        if form.by_authority:
            key = self._keys.authority_over(node)
        else:
            key = self._keys.pair(self._node_id, node)
        if key is None:
            return None
        state = hashlib.blake2s(key=key, digest_size=form.tag_bytes, person=b"end2end")
        self._states[form][node] = state
        return state


def _unproven(kind: int) -> NotProven:
    if kind == _HEARTBEAT:
        return NotProven("a heartbeat without the proof of a gateway")
    return NotProven("an order without proof" if kind == _ORDER else "a packet without proof")


def _what(payload: bytes, form: _Form) -> bytes:
    """What the proof of a packet covers; a router's heartbeat has one for its nonce."""
    what = messages.identity(payload)[: form.at - 2]
    if form is _OF_ROUTER:
        return what + payload[_NONCE_AT : _NONCE_AT + _NONCE_BYTES]
    return what


def _tag(state: hashlib.blake2s, nonce: int, sequence: int, what: bytes) -> bytes:
    tag = state.copy()
    tag.update(_nonce_and_sequence(nonce, sequence) + what)
    return tag.digest()
