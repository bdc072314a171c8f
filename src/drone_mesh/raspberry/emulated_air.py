"""Some nodes on one emulated air, in the time of the wall: to try the programs without hardware."""

from __future__ import annotations

import random

from drone_mesh.drone.interfaces import Location
from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.links import LogDistance
from drone_mesh.nrf24.emulator.wall_clock import WallClock
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.nrf24.settings import DataRate, RadioSettings

# From one column to the next: 0.7 of the distance at which one frame in four is lost (0 dBm, path
# loss exponent 2.7). So the next column is in reach, the one after it is not.
COLUMN_M = {DataRate.KBPS_250: 70.0, DataRate.MBPS_1: 32.0, DataRate.MBPS_2: 25.0}
_ROW_COLUMNS = 0.25  # the rows lie that many columns to the left and to the right


class EmulatedAir:
    """Makes emulated radios: node 0, then pairs of nodes, each pair further away than the last."""

    def __init__(self, settings: RadioSettings) -> None:
        """Starts a thread that `close` ends."""
        self._settings = settings
        self._clock = WallClock()
        self._air = Air(self._clock, LogDistance(random.Random()), random.Random())

    def place(self, node_id: int) -> Location:
        """Where a node stands."""
        column_m = COLUMN_M[self._settings.data_rate]
        column, row = (node_id + 1) // 2, node_id % 2
        side = (_ROW_COLUMNS if row else -_ROW_COLUMNS) if node_id else 0.0
        return Location(latitude=side * column_m, longitude=column * column_m, height=0.0)

    def radio(self, node_id: int, settings: RadioSettings) -> NRF24LowLevelInterface:
        """The driver of a new chip at the place of that node."""
        place = self.place(node_id)
        position = (place.longitude, place.latitude, place.height)
        chip = EmulatedChip(self._air, f"node {node_id}", position)
        return NRF24LowLevelInterface(
            chip.spi,
            chip.ce,
            chip.irq,
            node_id=node_id,
            settings=settings,
            runtime=self._clock.runtime,
        )

    def close(self) -> None:
        """End the air, when its radios are closed."""
        self._clock.close()
