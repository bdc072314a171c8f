"""MessageSeal: users' messages, secret and authentic from end to end (docs/security.md).

A synthetic IV (Rogaway and Shrimpton, 2006; RFC 5297): the tag over a message and its place is also
the nonce of its encryption, so no nonce has to be drawn or stored. The tag is keyed BLAKE2s (RFC
7693), the encryption AES-128 in counter mode (NIST SP 800-38A).
"""

from __future__ import annotations

import hashlib
import hmac
from typing import Callable

from drone_mesh.communication.data.packets import MESSAGE_TAG_BYTES
from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.communication.seals.keys import KEY_BYTES, Keys
from drone_mesh.errors import ConfigurationError

ACK_TAG_BYTES = 3  # all the room that is left in an ACK
_BLOCK_BYTES = 16

Encrypt = Callable[[bytes, bytes, bytes], bytes]
"""Encrypts text with this key and nonce; applied again, decrypts it."""


class MessageSeal:
    """Seals and opens the messages of one node. Its keys are its only state."""

    def __init__(self, keys: Keys) -> None:
        self._keys = keys
        self._encrypted = _aes_in_counter_mode()

    def seal(self, creator: int, to: int, place: bytes, payload: bytes) -> bytes:
        """The encrypted payload and its tag. `place` distinguishes the messages of a sender."""
        key = self._key(creator, to)
        context = bytes((creator, to)) + place
        tag = _tag(key, context, payload)
        return self._encrypted(key, context + tag, payload) + tag

    def open(self, creator: int, to: int, place: bytes, sealed: bytes) -> bytes | None:
        """The payload; None unless `creator` sealed this for `to` and this place."""
        key = self._key(creator, to)
        if len(sealed) < MESSAGE_TAG_BYTES:
            return None
        context = bytes((creator, to)) + place
        tag = sealed[-MESSAGE_TAG_BYTES:]
        payload = self._encrypted(key, context + tag, sealed[:-MESSAGE_TAG_BYTES])
        return payload if hmac.compare_digest(_tag(key, context, payload), tag) else None

    def acknowledgement_tag(self, creator: int, to: int, body: bytes) -> bytes:
        """The tag over the body of an ACK that `creator` sends to `to`."""
        key, made = self._key(creator, to), bytes((creator, to)) + body
        tag = hashlib.blake2s(made, key=key, digest_size=ACK_TAG_BYTES, person=b"received")
        return tag.digest()

    def _key(self, creator: int, to: int) -> bytes:
        """The key of the pair; for messages to all, that of the network."""
        key = self._keys.pair(creator, to) if to <= MAX_NODE_ID else self._keys.network
        assert key is not None, "a node has its own keys"
        return key


def _tag(key: bytes, context: bytes, payload: bytes) -> bytes:
    made = context + payload
    return hashlib.blake2s(made, key=key, digest_size=MESSAGE_TAG_BYTES, person=b"message").digest()


def _aes_in_counter_mode() -> Encrypt:
    # Imported here, because a mesh without a key does not need this library.
    try:
        from cryptography.hazmat.primitives.ciphers import Cipher
        from cryptography.hazmat.primitives.ciphers.algorithms import AES
        from cryptography.hazmat.primitives.ciphers.modes import CTR
    except ImportError as error:
        raise ConfigurationError(
            "a mesh key needs the Python package cryptography: pip install cryptography"
        ) from error

    def encrypted(key: bytes, nonce: bytes, text: bytes) -> bytes:
        own = hashlib.blake2s(key=key, digest_size=KEY_BYTES, person=b"encrypt").digest()
        first_block = nonce.ljust(_BLOCK_BYTES, b"\0")  # its last bytes count the blocks
        cipher = Cipher(AES(own), CTR(first_block)).encryptor()
        return cipher.update(text) + cipher.finalize()

    return encrypted
