"""EmulatedRadios: one emulated air, with one chip at the position of each drone."""

from __future__ import annotations

import functools
import logging
import random
from typing import Callable, Iterable

from drone_mesh.execution import ExecutorSlot, MeshExecutor
from drone_mesh.nrf24.airtime import NS_PER_S
from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.links import LogDistance
from drone_mesh.nrf24.emulator.wall_clock import WallClock
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.nrf24.settings import DataRate, RadioSettings
from drone_mesh.ros.graph.packet_samples import PacketSamples
from drone_mesh.ros.host.emulated_nrf24 import EmulatedNRF24
from drone_mesh.world.drones import VirtualDrone
from drone_mesh.world.engine import DroneState

_log = logging.getLogger(__name__)


class EmulatedRadios:
    """The real driver on emulated chips, in wall time.

    The antennas queue what the nodes send, so that no send waits for its chip, and one worker
    drives all nodes. The world's thread sets the positions, in each step in which a drone moves.
    """

    own_threads = True
    never_handed_over = 0
    ready = True

    def __init__(
        self,
        drones: Iterable[VirtualDrone],
        max_distance_m: float,
        rate: DataRate,
        seed: int,
        clock: Callable[[], float],
    ) -> None:
        """Start the thread of the air; `close` ends it. `clock` gives simulated seconds.

        The edge of the range is at `max_distance_m`.
        """
        self._wall_clock = WallClock()
        links = LogDistance.with_edge_at(
            max_distance_m, random.Random(f"{seed} links"), bits_per_s=rate.value
        )
        self._air = Air(self._wall_clock, links, random.Random(f"{seed} air"))
        self._settings = RadioSettings(data_rate=rate)
        self._seed = seed
        self._executor = MeshExecutor(clock, clock_notifies=True, name="mesh_node")
        self._airtime_s, self._measured_s = 0.0, 0.0
        self._samples = PacketSamples()
        self._chips: dict[int, EmulatedChip] = {}
        self._antennas: dict[int, EmulatedNRF24] = {}
        for drone in drones:
            self.place(drone)
        _log.info(
            "radio nrf24: the real driver on %d emulated chips, range %g m, %d kbit/s",
            len(self._chips),
            max_distance_m,
            rate.value // 1000,
        )

    def place(self, drone: VirtualDrone) -> None:
        """Place a chip on this drone. In the world's thread."""
        chip = EmulatedChip(self._air, f"node {drone.node_id}", drone.engine.state.position)
        drone.engine.add_listener(functools.partial(_carry, chip))
        self._chips[drone.node_id] = chip

    @property
    def under_way(self) -> int:
        """Always 0: the chips run in wall time, and the world does not wait for them."""
        return 0

    def figures(self) -> dict[str, float]:
        """Figures of the air and all radios. One thread."""
        with self._wall_clock.access():
            frames, collisions = self._air.frames, self._air.collisions
            airtime_s, now_s = self._air.airtime_s, self._wall_clock.now_ns / NS_PER_S
        share = (airtime_s - self._airtime_s) / max(now_s - self._measured_s, 1e-9)
        self._airtime_s, self._measured_s = airtime_s, now_s
        radios = [antenna.statistics() for antenna in list(self._antennas.values())]
        tries, sent = (sum(r.tries for r in radios), sum(r.sent for r in radios))
        return {
            "frames": frames,
            "collisions": collisions,
            "airtime share": round(share, 3),
            "tries per packet": round(1 + tries / max(sent, 1), 2),
            "packets waiting": sum(radio.waiting for radio in radios),
            "packets given up": sum(radio.lost for radio in radios),
        }

    def start(self) -> None:
        """Start the worker."""
        self._executor.start()
        self._samples.start()

    def slot(self) -> ExecutorSlot:
        """A slot in the worker of all nodes."""
        return self._executor.slot()

    def antenna(self, node_id: int, slot: ExecutorSlot) -> EmulatedNRF24:
        """The antenna of a node, with a driver for its chip."""
        chip = self._chips[node_id]
        radio = NRF24LowLevelInterface(
            chip.spi,
            chip.ce,
            chip.irq,
            node_id=node_id,
            settings=self._settings,
            runtime=self._wall_clock.runtime,
            rng=random.Random(f"{self._seed} radio {node_id}"),
        )
        antenna = EmulatedNRF24(node_id, radio, slot, self._samples)
        self._antennas[node_id] = antenna
        return antenna

    def remove(self, node_id: int) -> None:
        """Discard the chip of this node."""
        self._antennas.pop(node_id, None)
        self._chips.pop(node_id, None)

    def time_advanced(self) -> None:
        """Simulated time has advanced."""
        self._executor.time_advanced()

    def fall_silent(self) -> None:
        """From now on every send of every node fails at once."""
        for antenna in list(self._antennas.values()):
            antenna.fall_silent()

    def close(self) -> None:
        """Stop the worker and the air; returns when their threads have ended."""
        self._executor.stop()
        self._wall_clock.close()


def _carry(chip: EmulatedChip, state: DroneState) -> None:
    chip.position = state.position
