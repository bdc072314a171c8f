"""raspberry_radio range and answer: two radios on emulated chips, the far one in a thread."""

from __future__ import annotations

import contextlib
import dataclasses
import random
import threading
import time
from typing import Iterator

import pytest

from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.chip_core import ChipVariant
from drone_mesh.nrf24.emulator.clock import WallClock
from drone_mesh.nrf24.emulator.links import LogDistance
from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.settings import BroadcastMode, DataRate, RadioSettings
from drone_mesh.raspberry import range_test
from drone_mesh.raspberry.field_radio import FieldRadio

BASE = RadioSettings()
AT_1M = dataclasses.replace(BASE, data_rate=DataRate.MBPS_1)
FAR_ID = 5
SAID_WITHIN_S = 30.0
FOLLOW_1M_FOR_1_S = bytes.fromhex("fd fd ff 05 05 52 41 4e 47 45 01 01 00") + bytes(19)


class Pair:
    def __init__(self) -> None:
        self.clock = WallClock()
        self.air = Air(self.clock, LogDistance(random.Random(1)), random.Random(2))
        self.near = self.radio(253, 0.0)
        self.said: list[str] = []

    def radio(self, node_id: int, x_m: float, settings=BASE, *, plus=True) -> FieldRadio:
        chip = EmulatedChip(self.air, f"radio {node_id}", (x_m, 0.0, 0.0), ChipVariant(plus=plus))
        return FieldRadio(chip.spi, chip.ce, node_id, settings, self.clock.runtime)

    @contextlib.contextmanager
    def far_end(self, radio: FieldRadio, follows: bool = True) -> Iterator[None]:
        """A far end that acknowledges; `follows`: it runs `answer`."""
        radio.set_up()
        ended = threading.Event()

        def run() -> None:
            if follows:
                for line in range_test.answer(radio, ended.is_set):
                    self.said.append(line)
            while not ended.is_set():
                radio.receive()

        thread = threading.Thread(target=run)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()

    def wait_until_far_end_says(self, beginning: str) -> None:
        deadline_s = time.monotonic() + SAID_WITHIN_S
        while not any(line.startswith(beginning) for line in tuple(self.said)):
            assert time.monotonic() < deadline_s, f"not said: {beginning!r}; said: {self.said}"
            time.sleep(0.005)


def send_until_read(radio: FieldRadio, payload: bytes) -> None:
    """Send it to the far end, and three more: they find room only if the first was read."""
    address = radio.settings.node_address(FAR_ID)
    for sent in (payload.ljust(32, b"\0"), bytes(32), bytes(32), bytes(32)):
        while not radio.send(address, sent, 15).acknowledged:
            pass


@pytest.fixture
def pair() -> Iterator[Pair]:
    pair = Pair()
    yield pair
    pair.clock.close()


@pytest.mark.slow
def test_the_range_tool_counts_what_is_lost_at_each_power(pair):
    with pair.far_end(pair.radio(FAR_ID, 60.0), follows=False):
        lines = list(range_test.measure_range(pair.near, FAR_ID, packets=10, distance_m=50.0))
    assert lines[0] == "rate_kbit_s,power_dbm,packets,lost,retransmissions,loss"
    rows = [line.split(",") for line in lines[1:5]]
    assert [row[1] for row in rows] == ["0", "-6", "-12", "-18"]
    losses = [float(row[5]) for row in rows]
    assert losses[0] < 0.5
    assert losses[3] == 1.0
    assert lines[5].endswith("at 50 m: 0.0037")


@pytest.mark.slow
def test_at_every_rate_the_far_end_follows_and_comes_back(pair, monkeypatch):
    monkeypatch.setattr(range_test, "CHANGE_WITHIN_S", 0.2)
    far = pair.radio(FAR_ID, 30.0)
    with pair.far_end(far):
        lines = list(range_test.measure_range(pair.near, FAR_ID, packets=5, rates=tuple(DataRate)))
    loss = {tuple(line.split(",")[:2]): float(line.split(",")[5]) for line in lines[1:]}
    assert len(loss) == 12
    # A far end that stayed at its rate would lose all; a busy machine may lose one or two.
    for followed in (("250", "-12"), ("1000", "0"), ("2000", "0")):
        assert loss[followed] < 1.0
    assert loss["2000", "-18"] == 1.0
    assert "node 253 measures at 2000 kbit/s" in pair.said


def test_a_node_that_only_acknowledges_is_not_taken_for_lost_packets(pair, monkeypatch):
    monkeypatch.setattr(range_test, "JOIN_WITHIN_S", 0.0)
    with pair.far_end(pair.radio(FAR_ID, 10.0), follows=False):
        lines = range_test.measure_range(pair.near, FAR_ID, 1, rates=(DataRate.MBPS_1,))
        with pytest.raises(RadioError, match="does not follow to 1000 .*--id 5 answer"):
            list(lines)


def test_a_missing_far_end_is_named(pair, monkeypatch):
    monkeypatch.setattr(range_test, "JOIN_WITHIN_S", 0.0)
    lines = range_test.measure_range(pair.near, FAR_ID, 1, rates=(DataRate.MBPS_1,))
    with pytest.raises(RadioError, match="no answer from node 5 at 250 kbit/s: start"):
        list(lines)


@pytest.mark.slow
def test_after_silence_the_far_end_is_back_at_its_own_rate(pair):
    far = pair.radio(FAR_ID, 10.0)
    pair.near.set_up()
    address = BASE.node_address(FAR_ID)
    with pair.far_end(far):
        while not pair.near.send(address, FOLLOW_1M_FOR_1_S, 15).acknowledged:
            pass
        pair.wait_until_far_end_says("node 253 measures at 1000 kbit/s")
        lost = 0
        while not pair.near.send(address, bytes(32), 15).acknowledged:
            lost += 1
    assert lost > 0  # it was away
    assert "nothing heard for 1 s: back at 250 kbit/s" in pair.said
    assert far.settings is BASE


@pytest.mark.parametrize(
    "payload",
    [
        bytes.fromhex("fd fd ff 06 06") + b"RANGE" + bytes.fromhex("01 01 00"),  # for another node
        bytes.fromhex("fd fd fe 05 05") + b"RANGE" + bytes.fromhex("01 01 00"),  # users' data
        bytes.fromhex("fd fd ff 05 05") + b"RANGE" + bytes.fromhex("03 01 00"),  # no such rate
        bytes.fromhex("fd fd ff 05 05") + b"ENDED" + bytes.fromhex("01 01 00"),  # it is not away
    ],
)
def test_the_far_end_stays_at_its_rate_for_other_packets(pair, payload):
    far = pair.radio(FAR_ID, 10.0)
    pair.near.set_up()
    with pair.far_end(far):
        send_until_read(pair.near, payload)
    assert far.settings is BASE
    assert len(pair.said) == 1


def test_a_chip_without_plus_says_that_it_has_no_such_rate(pair):
    at_1m = dataclasses.replace(AT_1M, broadcast_mode=BroadcastMode.SHOCKBURST)
    far = pair.radio(FAR_ID, 10.0, at_1m, plus=False)
    near = pair.radio(1, 5.0, at_1m)
    near.set_up()
    follow_250k = bytes.fromhex("01 01 ff 05 05") + b"RANGE" + bytes.fromhex("00 01 00")
    with pair.far_end(far):
        while not near.send(at_1m.node_address(FAR_ID), follow_250k.ljust(32, b"\0"), 15)[0]:
            pass
        pair.wait_until_far_end_says("node 1 asked for 250 kbit/s: ")
    assert far.settings is at_1m
