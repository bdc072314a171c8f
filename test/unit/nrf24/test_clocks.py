"""The clocks of the emulated air: turns of threads in virtual time, and the time of the wall."""

from __future__ import annotations

import random
import threading
import time

import pytest
from chip_lab import PAYLOAD, Lab

from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.clock import WallClock
from drone_mesh.nrf24.emulator.cooperative_clock import CooperativeClock
from drone_mesh.nrf24.emulator.links import IdealDisc
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface


def test_threads_take_turns_in_the_order_of_virtual_time():
    clock = CooperativeClock()
    seen = []

    def count(name, period_s):
        for _ in range(3):
            clock.sleep(period_s)
            seen.append((name, round(clock.now_s(), 3)))

    tasks = [clock.start(lambda: count("a", 0.2), "a"), clock.start(lambda: count("b", 0.3), "b")]
    for task in tasks:
        task.join()
    assert seen == [("a", 0.2), ("b", 0.3), ("a", 0.4), ("b", 0.6), ("a", 0.6), ("b", 0.9)]


def test_a_virtual_lock_goes_to_waiting_threads_in_their_order():
    clock = CooperativeClock()
    lock = clock.lock()
    order = []

    def use(name, begin_s):
        clock.sleep(begin_s)
        with lock:
            order.append(name)
            clock.sleep(1.0)
            order.append(name)

    tasks = [
        clock.start(lambda name=name, begin=begin: use(name, begin), name)
        for name, begin in (("c", 0.3), ("a", 0.1), ("b", 0.2))
    ]
    for task in tasks:
        task.join()
    assert order == ["a", "a", "b", "b", "c", "c"]


def test_a_wait_ends_with_the_condition_or_with_the_time():
    clock = CooperativeClock()
    signal, flags = clock.signal(), []
    clock.call_at(500_000_000, lambda: (flags.append(1), signal.notify()))
    assert signal.wait_for(lambda: bool(flags), 2.0)
    assert clock.now_s() == 0.5
    assert not signal.wait_for(lambda: len(flags) > 1, 2.0)
    assert clock.now_s() == 2.5


def test_what_a_thread_raises_is_raised_where_it_is_joined():
    clock = CooperativeClock()

    def fail():
        raise ZeroDivisionError("on purpose")

    task = clock.start(fail, "failing")
    with pytest.raises(RuntimeError, match="failing failed"):
        task.join()


def test_a_deadlock_of_all_threads_raises_an_error():
    clock = CooperativeClock()
    signal = clock.signal()
    with pytest.raises(RuntimeError, match="waits for ever"):
        signal.wait_for(lambda: False, float("inf"))


def test_the_same_seed_gives_the_same_frames_at_the_same_nanosecond():
    def run():
        lab = Lab()
        one, other = lab.driver(1), lab.driver(2, 100.0)
        lab.at_once(
            lambda: [one.send(2, bytes((n,)) * 32) for n in range(20)],
            lambda: [other.send(1, bytes((n,)) * 32) for n in range(20)],
        )
        return [(frame.start_ns, frame.sender, frame.frame.bits) for frame in lab.trace.frames]

    assert run() == run()


@pytest.fixture
def wall():
    clock = WallClock()
    yield clock
    clock.close()


def wall_pair(clock):
    air = Air(clock, IdealDisc(), random.Random(1))
    drivers = []
    for node_id in (1, 2):
        chip = EmulatedChip(air, f"node {node_id}", (10.0 * node_id, 0.0, 0.0))
        driver = NRF24LowLevelInterface(
            chip.spi, chip.ce, chip.irq, node_id=node_id, rng=random.Random(node_id)
        )
        driver.chip = chip
        driver.begin()
        drivers.append(driver)
    return drivers


def test_drivers_with_real_threads_exchange_packets_in_the_time_of_the_wall(wall):
    one, other = wall_pair(wall)
    payloads = [bytes((number,)) * 32 for number in range(10)]
    got = []

    def receive():
        deadline_s = time.monotonic() + 20.0
        while len(got) < len(payloads) and time.monotonic() < deadline_s:
            got.extend(received.payload for received in other.receive(0.1))

    receiving = threading.Thread(target=receive)
    receiving.start()
    assert all(one.send(2, payload) for payload in payloads)
    receiving.join()
    assert got == payloads
    assert one.chip.warnings == []


def test_chips_keep_to_event_time_however_late_the_host_is(wall):
    """The host sleeps through the whole transaction; the chips have kept to their times."""
    one, _other = wall_pair(wall)
    chip = one.chip
    with wall.access():
        chip.spi.xfer2([0x20, 0x0E])
        chip.ce.value = False
        chip.spi.xfer2([0x30, *bytes.fromhex("02 68 52 4D 54")])
        chip.spi.xfer2([0x2A, *bytes.fromhex("02 68 52 4D 54")])
        chip.spi.xfer2([0x22, 0x07])
        chip.spi.xfer2([0xA0, *PAYLOAD])
        chip.ce.value = True
        rose_ns = wall.now_ns
        time.sleep(0.05)  # holds the access: the air's own thread cannot work
    with wall.access():
        assert chip.status() & 0x30 == 0x20
        assert chip.irq.fell_ns == rose_ns + 1_868_000


def test_closing_the_wall_clock_ends_its_thread():
    before = set(threading.enumerate())
    clock = WallClock()
    assert len(set(threading.enumerate()) - before) == 1
    clock.close()
    assert set(threading.enumerate()) <= before
