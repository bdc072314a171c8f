"""The keys of a mesh, and which of them a node holds (docs/security.md, "Keys").

Every key derives from the mesh key by BLAKE2s in keyed mode (RFC 7693).
"""

from __future__ import annotations

import abc
import hashlib
import os
from pathlib import Path

from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.errors import ConfigurationError
from drone_mesh.secret_file import read_secret_file

KEY_BYTES = 16  # 128 bits
_NETWORK, _AUTHORITY, _PAIR = b"network", b"authority", b"pair"
_NODES = MAX_NODE_ID + 1


class Keys(abc.ABC):
    """The keys that one node holds. Neither str nor repr shows a key."""

    network: bytes
    """Seals each hop. Every node of the mesh has it."""

    @abc.abstractmethod
    def authority_over(self, node: int) -> bytes | None:
        """Seals orders to `node`, and the heartbeats of gateways to it.

        Only `node` itself and holders of the mesh key have it; None: this node does not.
        """

    @abc.abstractmethod
    def pair(self, one: int, other: int) -> bytes | None:
        """Seals what these two nodes send to each other; None: this node is neither of them."""


class MeshKey(Keys):
    """The key of the whole mesh, from which all others derive: for gateways."""

    def __init__(self, secret: bytes) -> None:
        """Raise ConfigurationError unless it has 128 bits."""
        if len(secret) != KEY_BYTES:
            raise ConfigurationError(
                f"invalid mesh key: must be {8 * KEY_BYTES} bits, has {8 * len(secret)}"
            )
        self._secret = secret
        self.network = _derived(secret, _NETWORK)
        self._known: dict[bytes, bytes] = {}  # cache: no key is derived twice

    def authority_over(self, node: int) -> bytes:
        return self._derive(_AUTHORITY + bytes((node,)))

    def pair(self, one: int, other: int) -> bytes:
        return self._derive(_PAIR + bytes(sorted((one, other))))

    def for_node(self, node: int) -> NodeKeys:
        """The keys for a router, with which it cannot give orders to others."""
        return NodeKeys(
            node,
            self.network,
            self.authority_over(node),
            [self.pair(node, other) for other in range(_NODES)],
        )

    def to_text(self) -> str:
        """The content of a key file."""
        return f"drone_mesh mesh key\n{self._secret.hex()}\n"

    def _derive(self, purpose: bytes) -> bytes:
        key = self._known.get(purpose)
        if key is None:
            key = self._known[purpose] = _derived(self._secret, purpose)
        return key


class NodeKeys(Keys):
    """The keys of one node: with them it can prove only its own identity."""

    def __init__(self, node: int, network: bytes, authority: bytes, pairs: list[bytes]) -> None:
        """`pairs`: the keys that it shares with nodes 0..253."""
        self.node = node
        self.network = network
        self._authority = authority
        self._pairs = pairs

    def authority_over(self, node: int) -> bytes | None:
        return self._authority if node == self.node else None

    def pair(self, one: int, other: int) -> bytes | None:
        if one == self.node:
            return self._pairs[other]
        return self._pairs[one] if other == self.node else None

    def to_text(self) -> str:
        """The content of a key file."""
        keys = [self.network, self._authority, *self._pairs]
        return "\n".join([f"drone_mesh keys of node {self.node}", *(k.hex() for k in keys), ""])


def keys_from_text(text: str) -> MeshKey | NodeKeys:
    """The keys in a key file. Raises ConfigurationError, without quoting the text."""
    title, *lines = text.split("\n")
    try:
        keys = [bytes.fromhex(line) for line in lines if line]
        right = all(len(key) == KEY_BYTES for key in keys)
        if right and title == "drone_mesh mesh key" and len(keys) == 1:
            return MeshKey(keys[0])
        start, _, node = title.rpartition(" ")
        right = right and start == "drone_mesh keys of node" and len(keys) == 2 + _NODES
        if right and 0 <= int(node) <= MAX_NODE_ID:
            return NodeKeys(int(node), keys[0], keys[1], keys[2:])
    except ValueError:
        pass
    raise ConfigurationError(
        "not a key file: make one with raspberry_key new or raspberry_key node"
    )


def _derived(secret: bytes, purpose: bytes) -> bytes:
    return hashlib.blake2s(purpose, key=secret, digest_size=KEY_BYTES, person=b"dronemsh").digest()


def read_key_file(path: Path) -> MeshKey | NodeKeys:
    """The keys in a secret file. Raises ConfigurationError if it is none or holds no keys."""
    text = read_secret_file(path)
    try:
        return keys_from_text(text)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from None


def write_key_file(path: Path, keys: MeshKey | NodeKeys) -> None:
    """Create a file, mode 600. Raises ConfigurationError if it exists: keys are not overwritten."""
    try:
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(keys.to_text())
    except FileExistsError as error:
        raise ConfigurationError(
            f"key file {path}: exists already and is not overwritten; choose another name"
        ) from error
    except OSError as error:
        raise ConfigurationError(f"key file {path}: {error.strerror or error}") from error
