"""One real node, from start to end, on an emulated chip where the hardware would be."""

from __future__ import annotations

import logging
import os
import random
import re
import signal
import socket
import threading
import time
from functools import partial

import pytest

from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.chip_core import State
from drone_mesh.nrf24.emulator.clock import WallClock
from drone_mesh.nrf24.emulator.links import IdealDisc
from drone_mesh.raspberry import program, wiring_options
from drone_mesh.raspberry.options import parse_gateway, parse_router
from drone_mesh.stopping import ends_as

pytestmark = pytest.mark.slow

PATIENCE_S = 20.0  # for threads; nothing here takes a tenth of it


class Pin:
    """A pin in front of a chip's, that remembers whether it was given back."""

    def __init__(self, pin):
        self._pin, self.closed = pin, False

    def __getattr__(self, name):
        return getattr(self._pin, name)

    @property
    def value(self):
        return self._pin.value

    @value.setter
    def value(self, high):
        self._pin.value = high

    def close(self):
        self.closed = True


@pytest.fixture
def wired(monkeypatch):
    """A chip on the SPI device 0.1, GPIO5 and GPIO6."""
    clock = WallClock()
    chip = EmulatedChip(Air(clock, IdealDisc(), random.Random(1)), "the chip")
    chip.pins = {5: Pin(chip.ce), 6: Pin(chip.irq)}
    monkeypatch.setattr(wiring_options, "open_spi", lambda *where: {(0, 1): chip.spi}[where[:2]])
    monkeypatch.setattr(wiring_options, "GpiodCe", chip.pins.__getitem__)
    monkeypatch.setattr(wiring_options, "GpiodIrq", chip.pins.__getitem__)
    yield chip
    clock.close()


def run_until(condition, parse, line, number=signal.SIGINT):
    """Run the program here until the condition holds, then send it the signal; its status."""
    running = threading.Event()
    running.set()

    def end():
        deadline = time.monotonic() + PATIENCE_S
        while running.is_set() and not condition() and time.monotonic() < deadline:
            time.sleep(0.01)
        if running.is_set():
            os.kill(os.getpid(), number)

    sender = threading.Thread(target=end)
    sender.start()
    status = ends_as("the program")(program.run)(partial(parse, line.split(), {}))
    running.clear()
    sender.join()
    return status


def never():
    return False


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_a_node_that_listens_and_powers_its_radio_down(wired, number):
    threads, handler = set(threading.enumerate()), signal.getsignal(number)
    listened = []

    def listens():
        listened.append(wired.state is State.RX)
        return listened[-1]

    line = "--id 7 --spi 0.1 --ce 5 --irq 6"
    assert run_until(listens, parse_router, line, number) == 0
    assert listened[-1], "the radio never listened"
    assert wired.state is State.POWER_DOWN
    assert [pin.closed for pin in wired.pins.values()] == [True, True]
    assert wired.warnings == []
    assert set(threading.enumerate()) <= threads
    assert signal.getsignal(number) is handler


def test_the_signal_usr1_switches_the_lines_of_debug(wired, monkeypatch):
    pressed, switched = [], []
    monkeypatch.setattr(program.RadioNode, "switch_debug", lambda node: switched.append(node))

    def is_switched():
        if wired.state is State.RX and not pressed:  # it runs
            pressed.append(True)
            os.kill(os.getpid(), signal.SIGUSR1)
        return switched

    handler = signal.getsignal(signal.SIGUSR1)
    signal.signal(signal.SIGUSR1, signal.SIG_IGN)
    try:
        assert run_until(is_switched, parse_router, "--id 7 --spi 0.1 --ce 5 --irq 6") == 0
        assert signal.getsignal(signal.SIGUSR1) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGUSR1, handler)
    assert len(switched) == 1


def test_without_a_chip_it_ends_with_one_line_and_releases_everything(wired, capfd):
    wired.faults.miso_stuck_at = 0x00
    threads = set(threading.enumerate())
    line = "--id 7 --spi 0.1 --ce 5 --irq 6"
    assert run_until(never, parse_router, line) == 1
    assert re.fullmatch(
        "the program: no nRF24L01.* answers on SPI.*: check the wiring.*\n", last_line(capfd)
    )
    assert [pin.closed for pin in wired.pins.values()] == [True, True]
    assert set(threading.enumerate()) <= threads


def test_a_gateway_that_cannot_serve_releases_the_radio(wired, capfd):
    with socket.create_server(("127.0.0.1", 0)) as other:
        line = f"--spi 0.1 --ce 5 --port {other.getsockname()[1]}"
        assert run_until(never, parse_gateway, line) == 1
    assert re.fullmatch("the program: .* another program uses it; .*\n", last_line(capfd))
    assert wired.pins[5].closed


def test_a_node_that_hears_no_other_node_reports_it(wired, monkeypatch, caplog):
    monkeypatch.setattr(program, "LONELY_AFTER_S", 0.1)
    said = lambda: "node 7 hears no other node" in caplog.text  # noqa: E731
    assert run_until(said, parse_router, "--id 7 --spi 0.1 --ce 5") == 0
    assert said()
    assert caplog.text.count("hears no other node") == 1


def test_the_start_says_which_radio_is_used_and_how(wired, caplog):
    caplog.set_level(logging.INFO)
    line = "--id 7 --spi 0.1 --ce 5 --rate 1M --crc 8 --channel 90"
    started = lambda: "node 7: started" in caplog.text  # noqa: E731
    run_until(started, parse_router, line)
    assert (
        "node 7: nRF24L01+ on SPI 0.1, CE on GPIO5, polled; channel 90, 1000 kbit/s, CRC 8 bit"
        in caplog.text
    )


def last_line(capfd):
    return capfd.readouterr().err.splitlines(keepends=True)[-1]
