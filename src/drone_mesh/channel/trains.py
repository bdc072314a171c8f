"""Trains on the air: whether the sender of a packet is about to send more."""

from __future__ import annotations

from drone_mesh.channel.yielding import InTrain
from drone_mesh.communication import messages
from drone_mesh.communication.data import packets
from drone_mesh.communication.interfaces import BROADCAST


def place_in_train(payload: bytes, receiver: int) -> InTrain:
    """What a packet shows `receiver` about its train."""
    _creator, _from, kind, _to, addressee = messages.header(payload)
    if not messages.is_data(payload) or addressee == BROADCAST:
        return InTrain.NO
    if addressee == receiver or kind == packets.FRAGMENTS.start:
        return InTrain.PERHAPS
    return InTrain.MORE if kind in packets.FRAGMENTS else InTrain.LAST
