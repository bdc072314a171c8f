"""MessageSeal: users' messages, secret and authentic from end to end (docs/security.md).

A synthetic IV (Rogaway and Shrimpton, 2006; RFC 5297): the tag over a message and its place is also
the nonce of its encryption, so nothing has to be drawn or stored. The encryption is counter mode
over a pseudo-random function (Bellare et al., 1997). Both functions are keyed BLAKE2s (RFC 7693).
"""

from __future__ import annotations

import hashlib
import hmac

from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.communication.keys import Keys

TAG_BYTES = 6
_BLOCK_BYTES = hashlib.blake2s.MAX_DIGEST_SIZE


class MessageSeal:
    """Seals and opens the messages of one node. Has no state but its keys."""

    def __init__(self, keys: Keys) -> None:
        self._keys = keys

    def seal(self, creator: int, to: int, place: bytes, payload: bytes) -> bytes:
        """The encrypted payload and its tag. `place` distinguishes the messages of a sender."""
        key = self._key(creator, to)
        if key is None:
            return payload
        context = bytes((creator, to)) + place
        tag = _tag(key, context, payload)
        return _encrypted(key, context + tag, payload) + tag

    def open(self, creator: int, to: int, place: bytes, sealed: bytes) -> bytes | None:
        """The payload; None unless `creator` sealed this for `to` and this place."""
        key = self._key(creator, to)
        if key is None:
            return sealed
        if len(sealed) < TAG_BYTES:
            return None
        context = bytes((creator, to)) + place
        tag = sealed[-TAG_BYTES:]
        payload = _encrypted(key, context + tag, sealed[:-TAG_BYTES])
        return payload if hmac.compare_digest(_tag(key, context, payload), tag) else None

    def _key(self, creator: int, to: int) -> bytes | None:
        """That of the pair; for messages to all that of the network."""
        return self._keys.pair(creator, to) if to <= MAX_NODE_ID else self._keys.network


def _tag(key: bytes, context: bytes, payload: bytes) -> bytes:
    made = context + payload
    return hashlib.blake2s(made, key=key, digest_size=TAG_BYTES, person=b"message").digest()


def _encrypted(key: bytes, nonce: bytes, text: bytes) -> bytes:
    """`text` with the key stream of this nonce; the same again decrypts it."""
    start = hashlib.blake2s(nonce, key=key, person=b"stream")
    stream = bytearray()
    for counter in range(-(-len(text) // _BLOCK_BYTES)):
        block = start.copy()
        block.update(counter.to_bytes(2, "little"))
        stream += block.digest()
    both = int.from_bytes(text, "little") ^ int.from_bytes(stream[: len(text)], "little")
    return both.to_bytes(len(text), "little")
