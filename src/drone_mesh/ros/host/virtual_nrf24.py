"""VirtualNRF24: an antenna in the simulated air (docs/ros.md, "Virtual antenna")."""

from __future__ import annotations

import threading
from typing import Sequence

import rospy

from drone_mesh.communication.interfaces import (
    IMeshDebugInfo,
    IMeshNetwork,
    IWirelessCommunication,
)
from drone_mesh.execution import ExecutorSlot, PacketInbox
from drone_mesh.msg import NRF24
from drone_mesh.ros.graph import names
from drone_mesh.ros.host.announcements import probe_of
from drone_mesh.ros.host.radios import AntennaPanel
from drone_mesh.ros.host.simulator_link import SimulatorLink


class VirtualNRF24(IWirelessCommunication):
    """The radio of one node.

    Subscribes: /Node/<id> (NRF24)
    Publishes:  /Nodes/<id>/debug (NodeDebugInfo), 1 Hz with debugging on; through the link
                /WirelessSignalSimulator (DroneInfo)
    Services:   /Nodes/<id>/powerSwitch (PowerSwitch)

    The functions of the interface are for the executor's worker. The handlers run in threads of
    rospy and pass everything to the worker. They own only `_on`, a single flag; `_switching` keeps
    the announcements and the worker's orders in the order in which the flag changed.
    """

    def __init__(self, node_id: int, link: SimulatorLink, slot: ExecutorSlot) -> None:
        """`slot` drives the mesh component of this node."""
        self.node_id = node_id
        self._probe = probe_of(node_id)
        self._link = link
        self._slot = slot
        self._inbox = PacketInbox(slot.submit)
        self._dropped = 0  # packets that the inbox dropped, as far as the worker knows
        self._on = False
        self._switching = threading.Lock()
        self._mesh: IMeshNetwork | None = None
        self._subscriber: rospy.Subscriber | None = None
        self._panel = AntennaPanel(node_id, slot, self.on, self._switch_power)

    def start_antenna(self, mesh: IMeshNetwork) -> None:
        """Power on, subscribe, announce; does not wait for a simulator."""
        self._mesh = mesh
        self._on = True
        self._subscriber = rospy.Subscriber(
            names.node_topic(self.node_id), NRF24, self._heard, tcp_nodelay=True
        )
        self._panel.start()
        self._link.antennas.add(self, lambda: self._slot.submit(mesh.on_antenna_registered))

    def stop_antenna(self) -> None:
        """Power off, and leave the ROS graph."""
        if self._subscriber is None:
            return
        self._on = False
        self._link.antennas.announce(self)
        self._link.antennas.remove(self)
        self._subscriber.unregister()
        self._panel.stop()
        self._subscriber = self._mesh = None

    def send_message_to(self, payload: bytes) -> bool:
        """Send to the node in byte 3. False: it was not received, or there is no simulator."""
        return self._on and self._link.send(payload)

    def send_messages(self, payloads: Sequence[bytes]) -> list[bool]:
        return self._link.send_all(payloads) if self._on else [False] * len(payloads)

    def broadcast_message(self, payload: bytes) -> None:
        if self._on:
            self._link.broadcast(payload)

    def hears_power(self) -> bool:
        """Whether a jammer is on; a real chip measures its power (RPD)."""
        return self._link.jammed

    def debugging_mode(self, info: IMeshDebugInfo, on: bool) -> None:
        self._panel.debugging_mode(info, on)

    def on(self) -> bool:
        return self._on

    # Threads of rospy ------------------------------------------------------------------------

    def _heard(self, message: NRF24) -> None:
        payload = message.payload
        if payload == self._probe:
            self._link.antennas.probe_returned(self.node_id)
        else:
            sender = message._connection_header["callerid"]
            self._inbox.put(lambda now_s: self._receive(payload, sender, now_s))

    def _receive(self, payload: bytes, sender: str, now_s: float) -> None:
        try:
            if self._on and self._mesh is not None:
                self._mesh.on_msg(payload, now_s)
        finally:
            self._link.packet_processed(sender)
            while self._dropped < self._inbox.dropped:
                self._dropped += 1
                self._link.packet_processed()

    def _switch_power(self, on: bool) -> None:
        mesh = self._mesh
        if mesh is not None:
            with self._switching:  # announcing only puts into a queue
                self._on = on
                self._link.antennas.announce(self)
                self._slot.submit(lambda now_s: mesh.on_antenna_power(on, now_s))


class VirtualRadios(SimulatorLink):
    """An ideal disc, in the process of the WirelessSignalSimulator."""

    def antenna(self, node_id: int, slot: ExecutorSlot) -> VirtualNRF24:
        return VirtualNRF24(node_id, self, slot)
