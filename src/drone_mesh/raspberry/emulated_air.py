"""An emulated air on the wall clock, for running the programs without hardware, and nodes on it.

Several processes may share it.
"""

from __future__ import annotations

import contextlib
import logging
import math
import random
from functools import partial
from pathlib import Path
from typing import Callable

from drone_mesh.drone.engines import create_engine
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError
from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.air_server import AirServer, RemoteChip
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.clock import WallClock
from drone_mesh.nrf24.emulator.links import LogDistance
from drone_mesh.nrf24.emulator.trace import FrameTrace
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.nrf24.settings import DataRate, RadioSettings
from drone_mesh.raspberry.connection_options import AirAddress
from drone_mesh.raspberry.node import MakeInternet, RadioNode
from drone_mesh.raspberry.options import Options
from drone_mesh.web.access import is_loopback

# Distance between columns: 0.7 of the distance at which one frame in four is lost (0 dBm, path
# loss exponent 2.7). The adjacent column is in range, the one after it is not.
COLUMN_M = {DataRate.KBPS_250: 70.0, DataRate.MBPS_1: 32.0, DataRate.MBPS_2: 25.0}
MOST_COLUMNS = 4  # of routers; over more hops, collisions delay the gateway's answers too long
FEWEST_IN_COLUMN = 2  # so that each router has a second route
_COLUMN_WIDTH = 0.5  # from its first to its last router, as a share of COLUMN_M


_log = logging.getLogger(__name__)


def column_place(node_id: int, data_rate: DataRate, in_column: int = FEWEST_IN_COLUMN) -> Location:
    """The position of a node: 0 at the origin, then columns of nodes at growing distance."""
    if node_id == 0:
        return Location(0.0, 0.0, 0.0)
    column_m = COLUMN_M[data_rate]
    column, row = divmod(node_id - 1, in_column)
    side = _COLUMN_WIDTH * (row / (in_column - 1) - 0.5)
    return Location(latitude=side * column_m, longitude=(column + 1) * column_m, height=0.0)


class EmulatedAir:
    """Creates emulated radios: node 0, then columns of nodes at growing distance."""

    def __init__(self, settings: RadioSettings, nodes: int, trace_file: Path | None = None) -> None:
        """Starts a thread that `close` ends. ConfigurationError if the file is not writable."""
        self._trace_file = trace_file
        self._trace = FrameTrace()
        if trace_file is not None:
            self._write_trace(trace_file)
        self._settings = settings
        self._in_column = max(FEWEST_IN_COLUMN, math.ceil((nodes - 1) / MOST_COLUMNS))
        self._clock = WallClock()
        self.nodes = nodes
        self._server: AirServer | None = None
        self._chips: dict[int, EmulatedChip] = {}
        self._air = Air(self._clock, LogDistance(random.Random()), random.Random())
        if trace_file is not None:
            self._air.observe(self._trace.see)

    def place(self, node_id: int) -> Location:
        return column_place(node_id, self._settings.data_rate, self._in_column)

    def serve(self, host: str, port: int) -> tuple[str, int]:
        """Let other processes join; returns (host, port). Raises ConfigurationError."""
        try:
            self._server = AirServer(self._air, host, port)
        except OSError as error:
            raise ConfigurationError(
                f"cannot serve the emulated air on {host}:{port}: {error.strerror or error}"
            ) from error
        return self._server.address

    def radio(
        self, node_id: int, settings: RadioSettings, place: Location | None = None
    ) -> NRF24LowLevelInterface:
        """The driver of a new chip at that node's position, or at `place`."""
        place = place or self.place(node_id)
        chip = EmulatedChip(self._air, f"node {node_id}", place.to_vector())
        self._chips[node_id] = chip
        return NRF24LowLevelInterface(
            chip.spi,
            chip.ce,
            chip.irq,
            node_id=node_id,
            settings=settings,
            runtime=self._clock.runtime,
        )

    def move(self, node_id: int, place: Location) -> None:
        self._chips[node_id].position = place.to_vector()

    def close(self) -> None:
        """End the air and write the trace. Close the radios first."""
        if self._server is not None:
            self._server.close()
        self._clock.close()
        if self._trace_file is not None:
            frames = self._write_trace(self._trace_file)
            _log.info("wrote %d frames to %s", frames, self._trace_file)

    def _write_trace(self, file: Path) -> int:
        try:
            return self._trace.write(file)
        except OSError as error:
            raise ConfigurationError(f"--trace {file}: {error.strerror or error}") from error


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
    radio = NRF24LowLevelInterface(chip, chip.ce, node_id=options.node_id, settings=options.radio)
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
