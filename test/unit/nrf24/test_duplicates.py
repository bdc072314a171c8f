"""Rule 8 of docs/radio.md: no packet has the PID that the same bytes had before."""

from __future__ import annotations

import pytest
from chip_lab import PAYLOAD

from drone_mesh.nrf24.settings import BroadcastMode

OTHER = bytes(range(1, 33))


def payloads(driver):
    return [received.payload for received in driver.receive(0.05)]


@pytest.mark.parametrize("between", range(5))
@pytest.mark.parametrize("mode", list(BroadcastMode))
def test_a_broadcast_of_the_same_bytes_arrives_whatever_was_sent_between(lab, between, mode):
    sender = lab.driver(5, broadcast_mode=mode)
    receiver = lab.driver(10, 100.0, broadcast_mode=mode)
    third = lab.driver(11, 200.0, broadcast_mode=mode)
    for _ in range(3):
        assert sender.broadcast(PAYLOAD)
        assert payloads(receiver) == [PAYLOAD]
        assert payloads(third) == [PAYLOAD]
        for number in range(between):
            assert sender.send(11, bytes((number,)) * 32)
            assert payloads(third) == [bytes((number,)) * 32]


@pytest.mark.parametrize("lost", range(1, 5))
def test_the_same_bytes_arrive_although_all_packets_since_were_lost(lab, lost):
    sender, receiver = lab.driver(5), lab.driver(10, 100.0)
    for _ in range(3):
        assert sender.broadcast(PAYLOAD)
        assert sender.send(10, OTHER)
        assert payloads(receiver) == [PAYLOAD, OTHER]
        lab.loses = lambda _hop: True
        for number in range(lost):
            sender.broadcast(bytes((number,)) * 32)
        assert not sender.send(10, bytes(32))
        lab.loses = lambda _hop: False


@pytest.mark.parametrize("sent", range(4))
def test_the_same_bytes_arrive_after_a_brown_out_although_the_chip_counts_anew(lab, sent):
    sender, receiver = lab.driver(5), lab.driver(10, 100.0)
    for number in range(sent):
        assert sender.send(10, bytes((number,)) * 32)
    assert len(payloads(receiver)) == sent
    assert sender.broadcast(PAYLOAD)
    assert sender.send(10, OTHER)
    assert payloads(receiver) == [PAYLOAD, OTHER]
    for between in range(4):
        sender.chip.brown_out()
        lab.wait_us(1_100_000)  # until a restart is due again
        for number in range(between):
            assert sender.send(10, bytes((100 + number,)) * 32)
        assert len(payloads(receiver)) == between
        assert sender.broadcast(PAYLOAD)
        assert sender.send(10, OTHER)
        assert payloads(receiver) == [PAYLOAD, OTHER]
