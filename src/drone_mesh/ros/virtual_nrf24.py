"""VirtualNRF24: an antenna in the simulated air (reference, section 7)."""

from __future__ import annotations

import logging
import threading
from typing import Callable

import rospy

from drone_mesh.communication.interfaces import (
    IMeshDebugInfo,
    IMeshNetwork,
    IWirelessCommunication,
)
from drone_mesh.communication.messages import FROM
from drone_mesh.execution import Seat
from drone_mesh.msg import NRF24, NodeDebugInfo
from drone_mesh.ros import names
from drone_mesh.ros.simulator_link import SimulatorLink
from drone_mesh.srv import PowerSwitch, PowerSwitchResponse

DEBUG_PERIOD_S = 1.0  # reference, section 4: 1 Hz
SWITCH_TIMEOUT_S = 2.0  # our choice: the power switch answers at the latest after this (wall) time
_MAX_UINT16 = 0xFFFF

_log = logging.getLogger(__name__)


class VirtualNRF24(IWirelessCommunication):
    """The radio of one node.

    Subscribes: /Node/<id> (NRF24)
    Publishes:  /Nodes/<id>/debug (NodeDebugInfo), 1 Hz with debugging on; through the link
                /WirelessSignalSimulator (DroneInfo)
    Services:   /Nodes/<id>/powerSwitch (PowerSwitch)

    The functions of the interface are for the executor's worker. The handlers run in threads of
    rospy, and hand everything over to the worker; of theirs is only `_on`, a single flag.
    """

    def __init__(self, node_id: int, link: SimulatorLink, seat: Seat) -> None:
        """`seat` is where the mesh component of this node is driven."""
        self.node_id = node_id
        self._link = link
        self._seat = seat
        self._on = False
        self._mesh: IMeshNetwork | None = None
        self._subscriber: rospy.Subscriber | None = None
        self._switch: rospy.Service | None = None
        self._debug_publisher: rospy.Publisher | None = None
        self._stop_debugging: Callable[[], None] | None = None

    def start_antenna(self, mesh: IMeshNetwork) -> None:
        """Power on, subscribe, announce; the simulator need not be there yet."""
        self._mesh = mesh
        self._on = True
        self._subscriber = rospy.Subscriber(
            names.node_topic(self.node_id), NRF24, self._heard, tcp_nodelay=True
        )
        self._switch = rospy.Service(
            names.power_switch(self.node_id), PowerSwitch, self._power_switched
        )
        self._link.add(self, lambda: self._seat.submit(mesh.on_antenna_registered))

    def stop_antenna(self) -> None:
        """Power off, and leave the ROS graph."""
        if self._subscriber is None or self._switch is None:
            return
        self._on = False
        self._link.announce(self)
        self._link.remove(self)
        self._subscriber.unregister()
        self._switch.shutdown()
        self._subscriber = self._switch = self._mesh = None

    def send_message_to(self, payload: bytes) -> bool:
        """To the node in byte 3. False: it did not get it, or there is no simulator."""
        return self._on and self._link.send(payload)

    def broadcast_message(self, payload: bytes) -> None:
        """To everybody in range."""
        if self._on:
            self._link.broadcast(payload)

    def debugging_mode(self, info: IMeshDebugInfo, on: bool) -> None:
        """Start or stop to publish NodeDebugInfo."""
        if self._stop_debugging is not None and self._debug_publisher is not None:
            self._stop_debugging()
            self._debug_publisher.unregister()
            self._stop_debugging = self._debug_publisher = None
        if on:
            publisher = rospy.Publisher(
                names.debug_topic(self.node_id), NodeDebugInfo, queue_size=2
            )
            self._debug_publisher = publisher
            self._stop_debugging = self._seat.call_every(
                DEBUG_PERIOD_S, lambda _now_s: publisher.publish(self._debug_info(info))
            )

    def on(self) -> bool:
        """Whether the antenna has power."""
        return self._on

    def _debug_info(self, info: IMeshDebugInfo) -> NodeDebugInfo:
        return NodeDebugInfo(
            nodeID=self.node_id,
            ConnectedWithGateway=info.get_connected_to_gateway(),
            familySize=min(info.get_router_tech_table_size(), _MAX_UINT16),
            totalMessages=info.get_total_message_sent(),
            prefferedGateWay=info.get_preferred_gateway(),
            on=self._on,
            hops=info.get_hops_from_gateway_away(),
            prefLoc=info.get_last_good_known_location_id(),
        )

    # Threads of rospy ------------------------------------------------------------------------

    def _heard(self, message: NRF24) -> None:
        payload = message.payload
        if payload[FROM] == self.node_id and self._link.probe_returned(self.node_id):
            return
        if self._on:
            self._seat.submit(lambda now_s: self._receive(payload, now_s))

    def _receive(self, payload: bytes, now_s: float) -> None:
        if self._on and self._mesh is not None:
            self._mesh.on_msg(payload, now_s)

    def _power_switched(self, request: PowerSwitch) -> PowerSwitchResponse:
        mesh = self._mesh
        if mesh is not None and request.power != self._on:
            self._on = request.power
            self._link.announce(self)
            done = threading.Event()

            def switch(now_s: float) -> None:
                mesh.on_antenna_power(request.power, now_s)
                done.set()

            self._seat.submit(switch)
            if not done.wait(SWITCH_TIMEOUT_S):
                _log.warning("node %d: switched, but the node has not noticed yet", self.node_id)
        return PowerSwitchResponse()
