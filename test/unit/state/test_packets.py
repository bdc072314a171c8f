"""What kind of packet it is, and a sample of a crowd."""

from __future__ import annotations

import random
from collections import Counter

import pytest

from drone_mesh.communication.wire.packet_types import PacketKind
from drone_mesh.state.packets import PacketSampler, SampledPacket, kind_of


def packet(sender: int, receiver: int, packet_type: int) -> bytes:
    return bytes((9, sender, packet_type, receiver, 0)).ljust(32, b"\0")


@pytest.mark.parametrize(
    ("packet_type", "kind"),
    [
        (1, PacketKind.POSITION),
        (3, PacketKind.INTRODUCTION),
        (4, PacketKind.HEARTBEAT),
        (5, PacketKind.REPAIR),
        (6, PacketKind.ORDER),
        (7, PacketKind.REPAIR),
        (8, PacketKind.OTHER),
        (66, PacketKind.REPORT),
        (126, PacketKind.OTHER),
        (194, PacketKind.DATA),
    ],
)
def test_byte_2_says_the_kind(packet_type, kind):
    assert kind_of(packet_type) is kind


def test_a_few_packets_are_all_in_the_sample_oldest_first():
    sampler = PacketSampler(random.Random(1), most=3)
    sampler.note(packet(1, 2, 4), 0.25)
    sampler.note(packet(2, 0, 7), 0.5)
    assert sampler.drain() == (2, [SampledPacket(1, 2, 4, 0.25), SampledPacket(2, 0, 7, 0.5)])
    assert sampler.drain() == (0, [])


def test_each_packet_of_a_crowd_is_as_likely_in_the_sample_as_any_other():
    rng = random.Random(1)
    seen: Counter[int] = Counter()
    for _round in range(2000):
        sampler = PacketSampler(rng, most=10)
        for sender in range(100):
            sampler.note(packet(sender, 200, 4), float(sender))
        carried, sample = sampler.drain()
        assert carried == 100
        assert len({one.sender for one in sample}) == 10
        seen.update(one.sender for one in sample)
    assert min(seen.values()) > 140  # 200 expected, standard deviation 13.4
    assert max(seen.values()) < 260
