"""Emulated radios: one air, and on each drone a chip with the real driver."""

from __future__ import annotations

import functools
import logging
import random
from typing import Iterable

import rospy

from drone_mesh.communication.interfaces import IMeshDebugInfo, IMeshNetwork
from drone_mesh.execution import ExecutorSlot
from drone_mesh.msg import NRF24
from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.clock import WallClock
from drone_mesh.nrf24.emulator.links import LogDistance
from drone_mesh.nrf24.high_level import NRF24HighLevelInterface
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.nrf24.settings import DataRate, RadioSettings
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.periodic import PacketSamples
from drone_mesh.ros.host.radios import AntennaPanel, Radios
from drone_mesh.world.engine import DroneState
from drone_mesh.world.factory import VirtualDrone

_RECEIVED_QUEUE = 32  # packets that may wait for a slow subscriber of /Node/<id>

_log = logging.getLogger(__name__)


class EmulatedNRF24(NRF24HighLevelInterface):
    """The radio of one node.

    Publishes: /Node/<id> (NRF24): the received packets; /Nodes/<id>/debug (NodeDebugInfo)
    Services:  /Nodes/<id>/powerSwitch (PowerSwitch)

    A send only queues the packet; two threads of the antenna send and receive.
    """

    def __init__(
        self,
        node_id: int,
        radio: NRF24LowLevelInterface,
        slot: ExecutorSlot,
        samples: PacketSamples,
    ) -> None:
        """`slot` drives the mesh component of this node; `samples` are of what arrives."""
        super().__init__(radio, slot.submit, on_payload=self._publish)
        self._slot = slot
        self._samples = samples
        self._received = rospy.Publisher(
            names.node_topic(node_id), NRF24, queue_size=_RECEIVED_QUEUE
        )
        self._panel = AntennaPanel(node_id, slot, self.on, self._switch)

    def start_antenna(self, mesh: IMeshNetwork) -> None:
        super().start_antenna(mesh)
        self._panel.start()

    def stop_antenna(self) -> None:
        self._panel.stop()
        super().stop_antenna()
        self._received.unregister()

    def debugging_mode(self, info: IMeshDebugInfo, on: bool) -> None:
        self._panel.debugging_mode(info, on)

    def _switch(self, on: bool) -> None:
        self._slot.submit(lambda _now_s: self.switch_power(on))

    def _publish(self, payload: bytes) -> None:
        if self._samples.watched:
            self._samples.note(payload)
        if not rospy.is_shutdown():
            self._received.publish(NRF24(payload))


class EmulatedRadios(Radios):
    """The real driver on emulated chips, in wall time.

    The antennas queue what the nodes send, so that no send waits for its chip. The world's thread
    sets the positions, in each step in which a drone moves.
    """

    in_wall_time = True

    def __init__(
        self, drones: Iterable[VirtualDrone], max_distance_m: float, rate: DataRate, seed: int
    ) -> None:
        """Start the thread of the air; `close` ends it.

        The edge of the range is at `max_distance_m`.
        """
        self._wall_clock = WallClock()
        links = LogDistance.with_edge_at(
            max_distance_m, random.Random(f"{seed} links"), bits_per_s=rate.value
        )
        self._air = Air(self._wall_clock, links, random.Random(f"{seed} air"))
        self._settings = RadioSettings(data_rate=rate)
        self._seed = seed
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

    def start(self) -> None:
        self._samples.start()

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
        self._antennas.pop(node_id, None)
        self._chips.pop(node_id, None)

    def fall_silent(self) -> None:
        """From now on every send of every node fails at once."""
        for antenna in list(self._antennas.values()):
            antenna.fall_silent()

    def close(self) -> None:
        self._wall_clock.close()


def _carry(chip: EmulatedChip, state: DroneState) -> None:
    chip.position = state.position
