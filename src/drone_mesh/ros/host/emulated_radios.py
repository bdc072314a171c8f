"""EmulatedRadios: one emulated air, and a chip at the position of each drone."""

from __future__ import annotations

import functools
import logging
import random
from typing import Callable, Iterable

from drone_mesh.execution import MeshExecutor, Seat
from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.links import LogDistance
from drone_mesh.nrf24.emulator.wall_clock import WallClock
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.nrf24.settings import RadioSettings
from drone_mesh.ros.host.emulated_nrf24 import EmulatedNRF24
from drone_mesh.world.drones import VirtualDrone
from drone_mesh.world.engine import DroneState

_log = logging.getLogger(__name__)


class EmulatedRadios:
    """The real driver on emulated chips, in wall time; each node has a worker of its own.

    The world's thread sets the positions, in each step in which a drone moves.
    """

    own_threads = True
    never_handed_over = 0
    ready = True

    def __init__(
        self,
        drones: Iterable[VirtualDrone],
        max_distance_m: float,
        seed: int,
        clock: Callable[[], float],
    ) -> None:
        """Start the thread of the air; `close` ends it. `clock` gives simulated seconds.

        The edge of the range is at `max_distance_m`.
        """
        self._wall_clock = WallClock()
        links = LogDistance.with_edge_at(max_distance_m, random.Random(f"{seed} links"))
        air = Air(self._wall_clock, links, random.Random(f"{seed} air"))
        self._seed = seed
        self._clock = clock
        self._chips: dict[int, EmulatedChip] = {}
        self._antennas: list[EmulatedNRF24] = []
        self._executors: list[MeshExecutor] = []  # one per node
        for drone in drones:
            chip = EmulatedChip(air, f"node {drone.node_id}", drone.engine.state.position)
            drone.engine.add_listener(functools.partial(_carry, chip))
            self._chips[drone.node_id] = chip
        _log.info(
            "radio nrf24: the real driver on %d emulated chips, range %g m",
            len(self._chips),
            max_distance_m,
        )

    def start(self) -> None:
        """Nothing to do: the air is there."""

    def seat(self) -> Seat:
        """A worker of its own, as on a Pi: setting a chip up blocks it for milliseconds."""
        executor = MeshExecutor(self._clock, clock_is_poked=True, name="mesh_node")
        executor.start()
        self._executors.append(executor)
        return executor.seat()

    def antenna(self, node_id: int, seat: Seat) -> EmulatedNRF24:
        """The antenna of a node, with a driver for its chip."""
        chip = self._chips[node_id]
        radio = NRF24LowLevelInterface(
            chip.spi,
            chip.ce,
            chip.irq,
            node_id=node_id,
            settings=RadioSettings(),
            runtime=self._wall_clock.runtime,
            rng=random.Random(f"{self._seed} radio {node_id}"),
        )
        antenna = EmulatedNRF24(node_id, radio, seat)
        self._antennas.append(antenna)
        return antenna

    def time_advanced(self) -> None:
        """Simulated time was moved."""
        for executor in list(self._executors):
            executor.time_advanced()

    def fall_silent(self) -> None:
        """Make every send of every node fail at once from now on."""
        for antenna in list(self._antennas):
            antenna.fall_silent()

    def close(self) -> None:
        """Stop the workers and the air; returns when their threads have ended."""
        for executor in self._executors:
            executor.stop()
        self._wall_clock.close()


def _carry(chip: EmulatedChip, state: DroneState) -> None:
    chip.position = state.position
