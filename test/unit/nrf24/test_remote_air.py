"""An emulated air that one process serves and others join."""

from __future__ import annotations

import random
import socket

import pytest
from patience import PATIENCE_S, wait_for

from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.air_server import AirServer, RemoteChip
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.clock import WallClock
from drone_mesh.nrf24.emulator.links import IdealDisc
from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface

pytestmark = pytest.mark.slow

PACKET = bytes(range(32))


class Place:
    """An air of 10 m reach with its server, and node 1 on it at the origin."""

    def __init__(self, port=0):
        self.clock = WallClock()
        self.air = Air(self.clock, IdealDisc(10.0), random.Random(1))
        self.server = AirServer(self.air, "127.0.0.1", port)
        chip = EmulatedChip(self.air, "node 1")
        self.local = NRF24LowLevelInterface(chip.spi, chip.ce, chip.irq, node_id=1)
        self.local.begin()

    def close(self):
        self.server.close()
        self.local.close()
        self.clock.close()


@pytest.fixture
def place():
    place = Place()
    yield place
    place.close()


def joined(place, node_id=2, x=5.0):
    """A chip of another process, and its driver."""
    chip = RemoteChip(*place.server.address, f"node {node_id}", (x, 0.0, 0.0))
    radio = NRF24LowLevelInterface(chip, chip.ce, node_id=node_id)
    radio.begin()
    return chip, radio


def sends(radio, to):
    """Whether a packet arrives, at one of a few tries: the machine may be busy."""
    return any(radio.send(to, PACKET) for _ in range(5))


def test_packets_go_both_ways_between_processes(place):
    _chip, radio = joined(place)
    assert sends(radio, 1)
    assert place.local.receive(PATIENCE_S)[0].payload == PACKET
    assert sends(place.local, 2)
    assert radio.receive(PATIENCE_S)[0].payload == PACKET
    radio.close()


def test_a_chip_that_moves_out_of_reach_hears_nothing(place):
    chip, radio = joined(place)
    assert sends(radio, 1)
    chip.move((20.0, 0.0, 0.0))
    assert not radio.send(1, PACKET)
    chip.move((5.0, 0.0, 0.0))
    assert sends(radio, 1)
    radio.close()


def test_a_process_that_ends_takes_its_chip_with_it(place):
    chip, radio = joined(place)
    assert sends(place.local, 2)
    chip.close()
    wait_for("the chip is gone", lambda: not place.local.send(2, PACKET))
    again, radio_again = joined(place)
    assert sends(place.local, 2)
    radio_again.close()
    radio.close()


def test_a_chip_whose_air_is_gone_does_not_answer_and_works_again_when_it_is_back(place):
    chip, radio = joined(place)
    port = place.server.address[1]
    place.server.close()
    assert not radio.send(1, PACKET)
    with pytest.raises(OSError, match=r"closed|gone|reset|refused|pipe"):
        chip.xfer2([0xFF])
    place.server = AirServer(place.air, "127.0.0.1", port)
    wait_for("the driver has set up its new chip", lambda: radio.send(1, PACKET))
    radio.close()


def test_without_a_server_the_driver_says_that_spi_does_not_work(place):
    chip, radio = joined(place)
    place.server.close()
    with pytest.raises(RadioError, match="SPI does not work"):
        radio.begin()
    radio.close()


def test_no_server_at_all_is_an_error_at_once():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(OSError, match="refused"):
        RemoteChip("127.0.0.1", port, "node 2", (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    "nonsense",
    [
        b"\x01\x00",
        b"\x09\x00",
        b"\x02\x01\xff",
        b"\x01\x19" + bytes(24) + b"\xff",
    ],
)
def test_nonsense_ends_its_own_connection_only(place, nonsense):
    _chip, radio = joined(place)
    with socket.create_connection(place.server.address, PATIENCE_S) as stranger:
        stranger.sendall(nonsense)
        assert stranger.recv(1) == b""
    assert sends(radio, 1)
    radio.close()


def test_a_request_that_is_no_chips_ends_the_connection_and_the_chip(place):
    chip, radio = joined(place)
    assert sends(place.local, 2)
    with pytest.raises(OSError, match="closed|reset"):
        chip.request(99, b"")
    wait_for("the chip is gone", lambda: not place.local.send(2, PACKET))
    radio.close()
