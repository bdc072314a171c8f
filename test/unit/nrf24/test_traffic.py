"""Rows 58 and 59: tasks on both ends, for a long time.

docs/radio.md, "Checklist G: driver in this project".
"""

from __future__ import annotations

import random

import greenlet
import pytest

PACKETS = 10_000
MEAN_PAUSE_S = 0.1


class RecordingSpi:
    """In front of a chip's SPI: the callers, and whether one broke into the send of another."""

    def __init__(self, spi):
        self._spi = spi
        self.sender = None  # the task whose send is under way
        self.intruders = []

    def xfer2(self, data):
        me = greenlet.getcurrent()
        if self.sender not in (None, me):
            self.intruders.append(bytes(data))
        if data[0] == 0x20:  # CONFIG: transmitter from here to the next time it is receiver
            self.sender = None if data[1] & 1 else me
        return self._spi.xfer2(data)

    def close(self):
        self._spi.close()


class Station:
    """One node with a task that sends and one that receives."""

    def __init__(self, lab, node_id, other, x_m):
        self.lab, self.other = lab, other
        self.driver = lab.driver(node_id, x_m, begin=False)
        self.spi = RecordingSpi(self.driver.chip.spi)
        self.driver._chip._link._spi = self.spi
        self.driver.begin()
        self.rng = random.Random(f"traffic {node_id}")
        self.confirmed, self.got = [], []
        self.finished = False

    def send(self, count):
        for number in range(count):
            self.lab.clock.sleep(self.rng.expovariate(1 / MEAN_PAUSE_S))
            if self.driver.send(self.other, number.to_bytes(4, "little") + bytes(28)):
                self.confirmed.append(number)
        self.finished = True

    def receive(self, peer):
        while not peer.finished or self.driver.chip.rx_fifo.oldest:
            for received in self.driver.receive(1.0):
                self.got.append(int.from_bytes(received.payload[:4], "little"))
        self.got += [int.from_bytes(r.payload[:4], "little") for r in self.driver.receive(0.0)]


@pytest.mark.slow
def test_row_58_and_59_ten_thousand_packets_each_way_arrive_once_if_they_were_confirmed(lab):
    one, other = Station(lab, 1, 2, 0.0), Station(lab, 2, 1, 100.0)
    lab.at_once(
        lambda: one.send(PACKETS),
        lambda: other.send(PACKETS),
        lambda: one.receive(other),
        lambda: other.receive(one),
    )
    for station, peer in ((one, other), (other, one)):
        statistics = station.driver.statistics()
        assert statistics.sent == PACKETS
        assert statistics.acknowledged == len(station.confirmed)
        assert statistics.lost == PACKETS - len(station.confirmed)
        assert statistics.lost < PACKETS / 100
        assert len(peer.got) == len(set(peer.got))
        assert set(station.confirmed) <= set(peer.got)
        assert station.spi.intruders == []
        assert station.driver.chip.irq.value  # no flag was left behind
    assert lab.warnings == []


@pytest.mark.parametrize("irq", [True, False], ids=["IRQ", "polling"])
def test_row_59_a_day_of_a_driver_leaves_no_warning(lab, irq):
    """Sends, broadcasts, an absent receiver, a power cut, power down and up again."""
    one, other = lab.driver(1, irq=irq), lab.driver(2, 100.0, irq=irq)
    for number in range(20):
        one.send(2, bytes((number,)) * 32)
        other.send(1, bytes((number,)) * 32)
        one.broadcast(bytes((number,)) * 32)
        other.receive(0.02)
        one.receive(0.02)
    one.send(3, bytes(32))
    one.chip.brown_out()
    one.send(2, bytes(32))
    one.power_down()
    one.begin()
    assert one.send(2, bytes(32))
    one.close()
    other.close()
    assert lab.warnings == []
