"""EmulatedNRF24: the real driver on an emulated chip, as the antenna of a simulated drone."""

from __future__ import annotations

import functools
import logging
import random
from typing import Iterable

import rospy

from drone_mesh.communication.interfaces import (
    IMeshDebugInfo,
    IMeshNetwork,
    IWirelessCommunication,
)
from drone_mesh.execution import Seat
from drone_mesh.msg import NRF24
from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.links import LogDistance
from drone_mesh.nrf24.emulator.wall_clock import WallClock
from drone_mesh.nrf24.high_level import NRF24HighLevelInterface
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.nrf24.settings import RadioSettings
from drone_mesh.ros.graph import names
from drone_mesh.ros.host.antenna_panel import AntennaPanel
from drone_mesh.world.drones import VirtualDrone
from drone_mesh.world.engine import DroneState

_RECEIVED_QUEUE = 32  # packets that a slow reader of /Node/<id> may be behind

_log = logging.getLogger(__name__)


class EmulatedNRF24(IWirelessCommunication):
    """The radio of one node.

    Publishes: /Node/<id> (NRF24): what was received; /Nodes/<id>/debug (NodeDebugInfo)
    Services:  /Nodes/<id>/powerSwitch (PowerSwitch)

    A send takes as long as the chip takes, and blocks the executor's worker for that time: each
    node needs a worker of its own, as each Pi has.
    """

    def __init__(self, node_id: int, radio: NRF24LowLevelInterface, seat: Seat) -> None:
        """`seat` is where the mesh component of this node is driven."""
        self._seat = seat
        self._received = rospy.Publisher(
            names.node_topic(node_id), NRF24, queue_size=_RECEIVED_QUEUE
        )
        self._antenna = NRF24HighLevelInterface(radio, seat.submit, on_payload=self._show)
        self._panel = AntennaPanel(node_id, seat, self.on, self._switch_power)

    def start_antenna(self, mesh: IMeshNetwork) -> None:
        """Set the chip up and listen. Raises RadioError."""
        self._antenna.start_antenna(mesh)
        self._panel.start()

    def stop_antenna(self) -> None:
        """Power the chip down, and leave the ROS graph."""
        self._panel.stop()
        self._antenna.stop_antenna()

    def fall_silent(self) -> None:
        """Have every send fail at once from now on. Any thread."""
        self._antenna.fall_silent()

    def send_message_to(self, payload: bytes) -> bool:
        """To the node in byte 3. False: no acknowledgement after all retries."""
        return self._antenna.send_message_to(payload)

    def broadcast_message(self, payload: bytes) -> None:
        """One frame, to whom it reaches."""
        self._antenna.broadcast_message(payload)

    def debugging_mode(self, info: IMeshDebugInfo, on: bool) -> None:
        """Start or stop to publish NodeDebugInfo."""
        self._panel.debugging_mode(info, on)

    def on(self) -> bool:
        """Whether the antenna has power."""
        return self._antenna.on()

    def _switch_power(self, on: bool) -> None:
        self._seat.submit(lambda _now_s: self._antenna.switch_power(on))

    def _show(self, payload: bytes) -> None:
        if not rospy.is_shutdown():
            self._received.publish(NRF24(payload))


def _carry(chip: EmulatedChip, state: DroneState) -> None:
    chip.position = state.position


class EmulatedRadios:
    """One emulated air in the time of the wall, and a chip at the place of each drone.

    Positions are set by the world's thread, in each step in which a drone moves.
    """

    def __init__(self, drones: Iterable[VirtualDrone], max_distance_m: float, seed: int) -> None:
        """Start the air's thread; `close` ends it. The range's edge is at `max_distance_m`."""
        self._clock = WallClock()
        links = LogDistance.with_edge_at(max_distance_m, random.Random(f"{seed} links"))
        air = Air(self._clock, links, random.Random(f"{seed} air"))
        self._seed = seed
        self._chips: dict[int, EmulatedChip] = {}
        self._antennas: list[EmulatedNRF24] = []
        for drone in drones:
            engine = drone.engine
            chip = EmulatedChip(air, f"node {drone.node_id}", engine.state.position)
            engine.add_listener(functools.partial(_carry, chip))
            self._chips[drone.node_id] = chip
        _log.info(
            "radio nrf24: the real driver on %d emulated chips, edge of the range at %g m",
            len(self._chips),
            max_distance_m,
        )

    def antenna(self, node_id: int, seat: Seat) -> EmulatedNRF24:
        """The antenna of a node, with a driver for its chip."""
        chip = self._chips[node_id]
        radio = NRF24LowLevelInterface(
            chip.spi,
            chip.ce,
            chip.irq,
            node_id=node_id,
            settings=RadioSettings(),
            runtime=self._clock.runtime,
            rng=random.Random(f"{self._seed} radio {node_id}"),
        )
        antenna = EmulatedNRF24(node_id, radio, seat)
        self._antennas.append(antenna)
        return antenna

    def fall_silent(self) -> None:
        """Have every send of every node fail at once from now on. Any thread."""
        for antenna in list(self._antennas):
            antenna.fall_silent()

    def close(self) -> None:
        """End the air; returns when its thread has ended."""
        self._clock.close()
