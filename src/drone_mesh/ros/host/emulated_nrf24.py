"""EmulatedNRF24: the real driver on an emulated chip, as the antenna of a simulated drone."""

from __future__ import annotations

import rospy

from drone_mesh.channel.statistics import RadioStatistics
from drone_mesh.communication.interfaces import (
    IMeshDebugInfo,
    IMeshNetwork,
    IWirelessCommunication,
)
from drone_mesh.communication.medium import ChannelUse, Medium
from drone_mesh.execution import ExecutorSlot
from drone_mesh.msg import NRF24
from drone_mesh.nrf24.high_level import NRF24HighLevelInterface
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.packet_samples import PacketSamples
from drone_mesh.ros.host.antenna_panel import AntennaPanel

_RECEIVED_QUEUE = 32  # packets that may wait for a slow subscriber of /Node/<id>


class EmulatedNRF24(IWirelessCommunication):
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
        self._slot = slot
        self._samples = samples
        self._received = rospy.Publisher(
            names.node_topic(node_id), NRF24, queue_size=_RECEIVED_QUEUE
        )
        self._antenna = NRF24HighLevelInterface(radio, slot.submit, on_payload=self._show)
        self._panel = AntennaPanel(node_id, slot, self.on, self._switch_power)

    def start_antenna(self, mesh: IMeshNetwork) -> None:
        """Set the chip up and listen. Raises RadioError."""
        self._antenna.start_antenna(mesh)
        self._panel.start()

    def stop_antenna(self) -> None:
        """Power the chip down, and leave the ROS graph."""
        self._panel.stop()
        self._antenna.stop_antenna()
        self._received.unregister()

    @property
    def medium(self) -> Medium:
        return self._antenna.medium

    def hears_power(self) -> bool | None:
        return self._antenna.hears_power()

    def patience(self) -> float:
        return self._antenna.patience()

    def channel_use(self) -> ChannelUse:
        return self._antenna.channel_use()

    def data_room(self) -> int:
        return self._antenna.data_room()

    def statistics(self) -> RadioStatistics:
        """The counters of the radio."""
        return self._antenna.statistics()

    def fall_silent(self) -> None:
        """From now on every send fails at once. Any thread."""
        self._antenna.fall_silent()

    def send_message_to(self, payload: bytes) -> bool:
        """Queue it for the node in byte 3. False: invalid, no power, or the queue is full."""
        return self._antenna.send_message_to(payload)

    def broadcast_message(self, payload: bytes) -> None:
        """Queue one frame for every node in range."""
        self._antenna.broadcast_message(payload)

    def debugging_mode(self, info: IMeshDebugInfo, on: bool) -> None:
        """Start or stop publishing NodeDebugInfo."""
        self._panel.debugging_mode(info, on)

    def on(self) -> bool:
        """Whether the antenna has power."""
        return self._antenna.on()

    def _switch_power(self, on: bool) -> None:
        self._slot.submit(lambda _now_s: self._antenna.switch_power(on))

    def _show(self, payload: bytes) -> None:
        if self._samples.watched:
            self._samples.note(payload)
        if not rospy.is_shutdown():
            self._received.publish(NRF24(payload))
