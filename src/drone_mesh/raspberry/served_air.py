"""A node on an emulated air shared by several processes."""

from __future__ import annotations

import contextlib
import logging
from functools import partial
from typing import Callable

from drone_mesh.drone.engines import create_engine
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError
from drone_mesh.nrf24.emulator.remote_chip import RemoteChip
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.raspberry.air_options import AirAddress
from drone_mesh.raspberry.emulated_air import EmulatedAir, column_place
from drone_mesh.raspberry.node import MakeInternet, RadioNode
from drone_mesh.raspberry.options import Options
from drone_mesh.web.access import is_loopback

_log = logging.getLogger(__name__)


def joining_node(
    options: Options, address: AirAddress, make_internet: MakeInternet | None
) -> RadioNode:
    """A node on the air served at this address. Raises ConfigurationError."""
    place = _place(options)
    try:
        chip = RemoteChip(*address, f"node {options.node_id}", place.to_vector())
    except OSError as error:
        raise ConfigurationError(
            f"no emulated air at {address.host}:{address.port}: {error.strerror or error}; "
            "raspberry_gateway --emulated-air-serve PORT serves one"
        ) from error
    radio = NRF24LowLevelInterface(
        chip.spi, chip.ce, chip.irq, node_id=options.node_id, settings=options.radio
    )
    return node_with_drone(
        radio, options, place, make_internet, lambda here: chip.move(here.to_vector())
    )


def serving_node(
    options: Options, air: EmulatedAir, address: AirAddress, make_internet: MakeInternet | None
) -> RadioNode:
    """A node on `air`, which other processes may join. Raises ConfigurationError."""
    host, port = air.serve(*address)
    _log.info("emulated air: others join it with --emulated-air %s:%d", host, port)
    if not is_loopback(host):
        _log.warning(
            "emulated air: it has no password, so anyone who can reach port %d can join this mesh "
            "and listen to it",
            port,
        )
    place = _place(options)
    radio = air.radio(options.node_id, options.radio, place)
    return node_with_drone(radio, options, place, make_internet, partial(air.move, options.node_id))


def _place(options: Options) -> Location:
    return options.location or column_place(options.node_id, options.radio.data_rate)


def node_with_drone(
    radio: NRF24LowLevelInterface,
    options: Options,
    place: Location | None,
    make_internet: MakeInternet | None,
    move: Callable[[Location], None] | None = None,
) -> RadioNode:
    """A node with this radio, and the drone of the options. Raises ConfigurationError."""
    with contextlib.ExitStack() as opened:
        opened.callback(radio.close)
        engine = create_engine(options.node_id, place, options.flight)
        opened.callback(engine.close)
        node = RadioNode(radio, engine, options, make_internet, move=move)
        opened.pop_all()
    return node
