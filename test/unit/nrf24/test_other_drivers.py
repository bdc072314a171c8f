"""Row 60: another driver and ours on one air.

docs/radio.md, "Checklist G: driver in this project".
"""

from __future__ import annotations

import random
from functools import partial

import pytest
from chip_lab import PAYLOAD

from drone_mesh.nrf24.emulator.chip import EmulatedChip

rf24 = pytest.importorskip("circuitpython_nrf24l01.rf24")


@pytest.fixture
def theirs(lab, monkeypatch):
    """A CircuitPython driver on a chip 100 m away, set to talk to our nodes; its node id is 20."""

    class Time:
        @staticmethod
        def sleep(seconds):
            lab.clock.sleep(seconds)

        @staticmethod
        def monotonic_ns():
            return lab.clock.now_ns

    monkeypatch.setattr(rf24, "time", Time)
    chip = EmulatedChip(lab.air, "theirs", (100.0, 0.0, 0.0))
    radio = rf24.RF24(chip.spi, 0, chip.ce)
    radio.chip = chip
    radio.channel = 1
    radio.data_rate = 250
    radio.crc = 2
    radio.dynamic_payloads = False
    radio.payload_length = 32
    radio.set_auto_retries(1500, 15)
    radio.allow_ask_no_ack = True
    radio.open_rx_pipe(1, bytes.fromhex("FE 68 52 4D 54"))
    radio.open_rx_pipe(2, bytes.fromhex("14 68 52 4D 54"))
    radio.power = True
    return radio


def test_row_60_their_driver_finds_a_plus_chip(theirs):
    assert theirs.is_plus_variant


def test_row_60_their_acknowledged_packet_reaches_us(lab, theirs):
    ours = lab.driver(5)
    theirs.listen = False
    theirs.open_tx_pipe(bytes.fromhex("05 68 52 4D 54"))
    assert theirs.send(PAYLOAD) is True
    assert ours.receive(0.1) == [(2, PAYLOAD)]


def test_row_60_their_packet_without_a_receiver_fails(lab, theirs):
    ours = lab.driver(5)
    theirs.listen = False
    theirs.open_tx_pipe(bytes.fromhex("06 68 52 4D 54"))
    assert theirs.send(PAYLOAD) is False
    assert ours.receive(0.1) == []


def test_row_60_their_broadcast_reaches_us(lab, theirs):
    ours = [lab.driver(5), lab.driver(6, 50.0)]
    theirs.listen = False
    theirs.open_tx_pipe(bytes.fromhex("FE 68 52 4D 54"))
    assert theirs.send(PAYLOAD, ask_no_ack=True) is True
    assert [our.receive(0.1) for our in ours] == [[(1, PAYLOAD)]] * 2
    assert len(lab.trace.frames) == 1


def test_row_60_our_packets_and_broadcasts_reach_them(lab, theirs):
    ours = lab.driver(5)
    theirs.listen = True
    lab.wait_us(200)
    assert ours.send(20, PAYLOAD)
    assert theirs.available()
    assert theirs.pipe == 2
    assert theirs.read() == PAYLOAD
    assert ours.broadcast(b"\x0b" * 32)
    assert theirs.available()
    assert theirs.pipe == 1
    assert theirs.read() == b"\x0b" * 32
    assert not theirs.available()
    assert ours.chip.warnings == []


@pytest.mark.slow
def test_their_packets_are_acknowledged_in_the_middle_of_ten_of_ours(lab, theirs):
    """Ours send to each other all the time, by rules of access that theirs does not know."""
    rng = random.Random(1)
    ours = [lab.driver(node, 10.0 * node) for node in range(10)]
    ending = []

    def chatter(driver):
        while not ending:
            lab.clock.sleep(rng.expovariate(5.0))
            other = rng.choice([node for node in range(10) if node != driver.node_id])
            driver.send(other, bytes(rng.choices(range(256), k=32)))

    def listen(driver):
        got = []
        while not ending:
            got += [received.payload for received in driver.receive(0.1)]
        return got

    def send():
        theirs.listen = False
        theirs.open_tx_pipe(bytes.fromhex("05 68 52 4D 54"))
        confirmed = []
        for number in range(40):
            lab.clock.sleep(0.2)
            if theirs.send(bytes((number,)) * 32) is True:
                confirmed.append(number)
            theirs.flush_tx()
        ending.append(True)
        return confirmed

    tasks = [partial(chatter, driver) for driver in ours] + [partial(listen, d) for d in ours]
    confirmed, *results = lab.at_once(send, *tasks)
    heard_by_5 = results[10 + 5]
    assert len(confirmed) >= 38  # 16 frames each, and no one sends all the time
    assert {bytes((number,)) * 32 for number in confirmed} <= set(heard_by_5)
    assert [warning for driver in ours for warning in driver.chip.warnings] == []
