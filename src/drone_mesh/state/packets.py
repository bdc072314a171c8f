"""Packets on the air, for display: the kind of each packet, and a sample of bounded size."""

from __future__ import annotations

import random
from typing import NamedTuple, Sequence

from drone_mesh.communication.wire.messages import receiver, sender, type_of
from drone_mesh.communication.wire.packet_types import ABOUT, PacketKind

MOST_SAMPLED = 120  # for a fifth of a second: more dots cannot be followed


def kind_of(packet_type: int) -> PacketKind:
    """The kind of a packet whose byte 2 is `packet_type`."""
    return ABOUT[packet_type].kind


class SampledPacket(NamedTuple):
    """One packet that arrived."""

    sender: int  # of this hop
    receiver: int
    type: int
    at_s: float  # by the clock of the recording process


class PacketSampler:
    """A uniform sample of the packets since the last call of `take`."""

    def __init__(self, rng: random.Random, most: int = MOST_SAMPLED) -> None:
        self._rng, self._most = rng, most
        self._carried = 0
        self._sample: list[SampledPacket] = []

    def note(self, packet: bytes, at_s: float) -> None:
        self._carried += 1
        place = len(self._sample)
        if place >= self._most:  # Vitter's algorithm R
            place = self._rng.randrange(self._carried)
            if place >= self._most:
                return
        sampled = SampledPacket(sender(packet), receiver(packet), type_of(packet), at_s)
        self._sample[place : place + 1] = [sampled]

    def drain(self) -> tuple[int, Sequence[SampledPacket]]:
        """The number of packets that arrived, and the sample of them, oldest first."""
        carried, sample = self._carried, self._sample
        self._carried, self._sample = 0, []
        return carried, sorted(sample, key=lambda packet: packet.at_s)
