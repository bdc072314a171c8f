"""EmulatedNRF24: the real driver on an emulated chip, as the antenna of a simulated drone."""

from __future__ import annotations

import rospy

from drone_mesh.communication.interfaces import IMeshDebugInfo, IMeshNetwork
from drone_mesh.execution import ExecutorSlot
from drone_mesh.msg import NRF24
from drone_mesh.nrf24.high_level import NRF24HighLevelInterface
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.packet_samples import PacketSamples
from drone_mesh.ros.host.antenna_panel import AntennaPanel

_RECEIVED_QUEUE = 32  # packets that may wait for a slow subscriber of /Node/<id>


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
        """Set the chip up and listen. Raises RadioError."""
        super().start_antenna(mesh)
        self._panel.start()

    def stop_antenna(self) -> None:
        """Power the chip down, and leave the ROS graph."""
        self._panel.stop()
        super().stop_antenna()
        self._received.unregister()

    def debugging_mode(self, info: IMeshDebugInfo, on: bool) -> None:
        """Start or stop publishing NodeDebugInfo."""
        self._panel.debugging_mode(info, on)

    def _switch(self, on: bool) -> None:
        self._slot.submit(lambda _now_s: self.switch_power(on))

    def _publish(self, payload: bytes) -> None:
        if self._samples.watched:
            self._samples.note(payload)
        if not rospy.is_shutdown():
            self._received.publish(NRF24(payload))
