"""What all radios have in common: how nodes get their antennas, and the panel of an antenna."""

from __future__ import annotations

import abc
import logging
import threading
from contextlib import ExitStack
from typing import Callable

import rospy

from drone_mesh.communication.interfaces import IMeshDebugInfo, IWirelessCommunication
from drone_mesh.execution import ExecutorSlot
from drone_mesh.msg import NodeDebugInfo
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.persistent_service import PersistentService, ServiceGone
from drone_mesh.srv import PowerSwitch, PowerSwitchRequest, PowerSwitchResponse

DEBUG_PERIOD_S = 1.0  # docs/ros.md, "Topics"
SWITCH_TIMEOUT_S = 2.0  # the power switch answers within this wall time
_ALL_DEBUG_QUEUE = 512  # messages of all nodes that may wait for a slow subscriber
_MAX_UINT16 = 0xFFFF

_log = logging.getLogger(__name__)


class Radios(abc.ABC):
    """Antennas of all nodes of a host. Any thread may call every function."""

    in_wall_time = False
    """Whether they run in wall time, in threads of their own, which end only when a node stops."""

    never_handed_over = 0
    """Packets, since the start, that the simulated air never accepted."""

    under_way = 0
    """Packets handed over minus packets processed; 0 if the world does not wait for these."""

    @property
    def ready(self) -> bool:
        """Whether packets can be sent."""
        return True

    @abc.abstractmethod
    def start(self) -> None:
        """Start connecting; does not wait for the connection."""

    @abc.abstractmethod
    def antenna(self, node_id: int, slot: ExecutorSlot) -> IWirelessCommunication:
        """The antenna of a node that runs in `slot`."""

    def remove(self, node_id: int) -> None:  # noqa: B027 - most have nothing left of it
        """The antenna of this node has stopped for good."""

    @abc.abstractmethod
    def fall_silent(self) -> None:
        """From now on no send blocks: each fails at once, or stays quick."""

    def close(self) -> None:  # noqa: B027 - most have ended when they are silent
        """Stop all threads; returns when they have ended."""


class AntennaPanel:
    """The ROS controls of one antenna, whatever kind of radio it has.

    Publishes: /Nodes/<id>/debug (NodeDebugInfo), 1 Hz of simulated time with debugging on;
               /debug, the same of all nodes, only while there is a subscriber
    Services:  /Nodes/<id>/powerSwitch (PowerSwitch)

    The switch is handled in a thread of rospy; everything else is for the executor's worker.
    """

    def __init__(
        self,
        node_id: int,
        slot: ExecutorSlot,
        is_on: Callable[[], bool],
        switch: Callable[[bool], None],
    ) -> None:
        """`switch` is called in a thread of rospy, and submits the node's part to `slot`."""
        self._node_id = node_id
        self._slot = slot
        self._is_on = is_on
        self._switch = switch
        self._offered, self._debugging = ExitStack(), ExitStack()  # what ends with each

    def start(self) -> None:
        name = names.power_switch(self._node_id)
        service = rospy.Service(name, PowerSwitch, self._power_switched)
        self._offered.callback(service.shutdown)

    def stop(self) -> None:
        """Withdraw the switch. A second call changes nothing."""
        self._offered.close()

    def debugging_mode(self, info: IMeshDebugInfo, on: bool) -> None:
        self._debugging.close()
        if on:
            publisher = rospy.Publisher(
                names.debug_topic(self._node_id), NodeDebugInfo, queue_size=2
            )
            of_all = rospy.Publisher(
                names.ALL_DEBUG_TOPIC, NodeDebugInfo, queue_size=_ALL_DEBUG_QUEUE
            )

            def publish(_now_s: float) -> None:
                message = self._debug_info(info)
                publisher.publish(message)
                if of_all.get_num_connections():
                    of_all.publish(message)

            for end in (publisher.unregister, of_all.unregister):
                self._debugging.callback(end)
            self._debugging.callback(self._slot.call_every(DEBUG_PERIOD_S, publish))

    def _debug_info(self, info: IMeshDebugInfo) -> NodeDebugInfo:
        return NodeDebugInfo(
            nodeID=self._node_id,
            ConnectedWithGateway=info.get_connected_to_gateway(),
            familySize=min(info.get_router_tech_table_size(), _MAX_UINT16),
            totalMessages=info.get_total_message_sent(),
            prefferedGateWay=info.get_preferred_gateway(),
            on=self._is_on(),
            hops=info.get_hops_from_gateway_away(),
            prefLoc=info.get_last_good_known_location_id(),
        )

    def _power_switched(self, request: PowerSwitchRequest) -> PowerSwitchResponse:
        if request.power != self._is_on():
            self._switch(request.power)
            done = threading.Event()
            self._slot.submit(lambda _now_s: done.set())
            if not done.wait(SWITCH_TIMEOUT_S):
                _log.warning("node %d: switched, but too busy to react yet", self._node_id)
        return PowerSwitchResponse()


def node_runs(node_id: int) -> bool:
    """Whether a process offers this node's power switch, and accepts connections."""
    switch = PersistentService(names.power_switch(node_id), PowerSwitch)
    try:
        switch.connect()
    except ServiceGone:
        return False
    switch.close()
    return True
