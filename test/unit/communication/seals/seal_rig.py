"""Two ends of a sealed link, without a mesh."""

from __future__ import annotations

import random

from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.communication.seals.seal import HopSeal

KEY = MeshKey(bytes(range(16)))
OTHER_KEY = MeshKey(bytes(16))
FRESH_S = 30.0


def node(node_id, seed=0, key=KEY):
    """The hop seal of one node; another seed is another start of the same node."""
    return HopSeal(node_id, key, random.Random(f"{node_id} {seed}"), FRESH_S)


def introduce(receiver, sender, sender_id, now_s=0.0):
    """The receiver challenges the sender, which answers."""
    challenge = receiver.challenge(sender_id, now_s)
    assert receiver.answered(sender.answer(challenge, now_s), now_s) is not None


def packet(text):
    """The 32 bytes that are written as `text`."""
    return bytes.fromhex(text).ljust(32, b"\0")
