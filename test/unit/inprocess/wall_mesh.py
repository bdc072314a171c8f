"""A mesh of emulated radios in real time, on the threads of real nodes."""

from __future__ import annotations

import random
import time
from typing import Callable

from drone_mesh.communication.node.assembly import assemble_node
from drone_mesh.communication.node.component import MeshnetworkComponent
from drone_mesh.drone.engines import GroundEngine
from drone_mesh.drone.location import Location
from drone_mesh.execution import MeshExecutor
from drone_mesh.inprocess.node import NoInternet
from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.clock import WallClock
from drone_mesh.nrf24.emulator.links import LinkModel
from drone_mesh.nrf24.high_level import NRF24HighLevelInterface
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.nrf24.settings import RadioSettings


class WallMesh:
    """Nodes that stand on one air; one worker drives the mesh software of all."""

    def __init__(self, links: LinkModel, settings: RadioSettings, seed: int) -> None:
        self.clock = WallClock()
        self.air = Air(self.clock, links, random.Random(f"{seed} air"))
        self.chips: list[EmulatedChip] = []
        self.antennas: list[NRF24HighLevelInterface] = []
        self._settings = settings
        self._seed = seed
        self._executor = MeshExecutor(self.clock.runtime.now_s, clock_notifies=False)
        self.components: list[MeshnetworkComponent] = []
        self._executor.start()

    def add(self, node_id: int, x: float, y: float, *, gateway: bool) -> None:
        """Add and start a node at (x, y) metres."""
        chip = EmulatedChip(self.air, f"node {node_id}", (x, y, 0.0))
        rng = random.Random(f"{self._seed} node {node_id}")
        radio = NRF24LowLevelInterface(
            chip.spi, chip.ce, chip.irq, node_id=node_id, settings=self._settings, rng=rng
        )
        slot = self._executor.slot()
        antenna = NRF24HighLevelInterface(radio, slot.submit)
        component, _receiver = assemble_node(
            node_id,
            antenna,
            GroundEngine(node_id, Location.from_vector((x, y, 0.0))),
            rng,
            internet=NoInternet() if gateway else None,
        )

        def start(now_s: float) -> None:
            slot.drive(component)
            component.start(now_s)

        self.chips.append(chip)
        self.antennas.append(antenna)
        self.components.append(component)
        slot.submit(start)

    def now_s(self) -> float:
        """Seconds since the start of the machine."""
        return self.clock.runtime.now_s()

    def run_for(self, seconds: float) -> None:
        """Let time pass."""
        time.sleep(seconds)

    def all_connected(self) -> bool:
        """Whether every node has power and is connected to a gateway."""
        on = all(antenna.on() for antenna in self.antennas)
        return on and all(c.get_connected_to_gateway() for c in self.components)

    def submit(self, function: Callable[[float], None]) -> None:
        """Have the worker call this with the time."""
        self._executor.submit(function)

    def stop(self) -> None:
        """Stop all nodes and end all threads."""

        def stop_all(_now_s: float) -> None:
            for component in self.components:
                component.stop()

        self._executor.submit(stop_all)
        self._executor.stop()
        self.clock.close()
