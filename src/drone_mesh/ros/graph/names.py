"""Names in the ROS graph: those of docs/ros.md, "ROS interface", and our additions.

They are relative, so that a whole simulation lives in the namespace of its nodes. Comments and
docstrings write them as they are without a namespace: /mesh/state.
"""

from __future__ import annotations

from typing import Callable

from drone_mesh.air.node_table import AirError, check_topic
from drone_mesh.errors import ConfigurationError

SIGNAL_TOPIC = "WirelessSignalSimulator"  # DroneInfo: every engine and antenna -> simulator
SIGNAL_QUEUE = 4096  # DroneInfo that may wait for a slow simulator; the oldest is dropped
MESSAGE_SERVICE = "SignalSimulator/message"
OTHERS_IN_RANGE_SERVICE = "SignalSimulator/othersinRange"
JAMMER_TOPIC = "jammer"  # Bool, latched: users -> simulator and virtual antennas
# Additions: one call instead of one per packet or per neighbour.
MESSAGES_SERVICE = "SignalSimulator/messages"
BROADCAST_SERVICE = "SignalSimulator/broadcast"

LAYOUTS_PARAM = "DroneManager/casus"  # the file of the layouts; empty or not set: the package's
ORIGIN_PARAM = "drone_mesh/origin"  # LAT,LON,ALT: where the world is on the earth; empty: nowhere
GATEWAY_TOPIC = "gateway"  # RequestGatewayDroneFlight: DroneManager -> each gateway
SHARED_PLACE_TOPIC = "gateway/shared_place"  # the same, also to places of other drones
GATEWAY_ANSWERS_TOPIC = "gateway/answers"  # FlightOrderAnswer: each gateway -> DroneManager
REQUEST_MOVEMENT_SERVICE = "DroneManager/requestDroneMovement"
SET_TO_CASUS_SERVICE = "DroneManager/SetToCasus"
ORDER_FLIGHT_SERVICE = "DroneManager/orderFlight"  # OrderFlight
ORDER_FORMATION_SERVICE = "DroneManager/orderFormation"  # OrderFormation
ORDER_LAYOUT_SERVICE = "DroneManager/orderLayout"  # OrderLayout
PREVIEW_LAYOUT_SERVICE = "DroneManager/previewLayout"  # PreviewLayout
WITHDRAW_LAYOUT_SERVICE = "DroneManager/withdrawLayout"  # WithdrawLayout
LAYOUT_ACTION = "DroneManager/layout"  # Layout
LAYOUTS_TOPIC = "DroneManager/layouts"  # LayoutProgress, latched: DroneManager -> users
SET_FENCE_SERVICE = "DroneManager/setFence"  # SetFence
FENCE_TOPIC = "DroneManager/fence"  # String, latched: DroneManager -> world and hosts
FENCE_PARAM = "drone_mesh/fence"  # the same, from the start on; empty: there was none
STANDING_PARAM = "drone_mesh/standing"  # what is left to order, for a restarted DroneManager
# The same services under their short names.
SHORT_REQUEST_MOVEMENT_SERVICE = "requestDroneMovement"
SHORT_SET_TO_CASUS_SERVICE = "SetToCasus"
ALL_DEBUG_TOPIC = "debug"  # NodeDebugInfo of all nodes, only while there is a subscriber

CLOCK_TOPIC = "clock"
FACTOR_TOPIC = "DroneFactory/real_time_factor"  # Float32: the achieved factor, once a second
SPEED_SERVICE = "DroneFactory/setSpeed"  # SetSpeed
ADD_DRONE_SERVICE = "DroneFactory/addDrone"  # AddDrone
REMOVE_DRONE_SERVICE = "DroneFactory/removeDrone"  # RemoveDrone
PROGRESS_TOPIC = "mesh/progress"  # HostProgress: progress of a host in another process
SIM_TIME_PARAM = "/use_sim_time"  # one for all nodes of a master
FLEET_PARAM = "drone_mesh/fleet"  # the factory's configuration, for hosts in other processes
DRONES_PARAM = "drone_mesh/drones"  # the ids of the present drones, see fleet_parameter.py

REPORTS_TOPIC = "mesh/reports"  # HostReport: each process that hosts nodes -> DroneFactory
STATE_TOPIC = "mesh/state"  # MeshState, latched: DroneFactory -> users
EVENTS_TOPIC = "mesh/events"  # MeshEvent: DroneFactory -> users
PACKETS_TOPIC = "mesh/packets"  # PacketSample: simulator -> users, while there is a subscriber
DIAGNOSTICS_TOPIC = "diagnostics"  # DiagnosticArray: DroneFactory, hosts, simulator -> users
# ROS and its libraries use these two with a slash: remappings that keep them in the namespace.
REMAPPINGS = (f"/{CLOCK_TOPIC}:={CLOCK_TOPIC}", f"/{DIAGNOSTICS_TOPIC}:={DIAGNOSTICS_TOPIC}")

MARKERS_TOPIC = "mesh/markers"  # MarkerArray: mesh_markers -> rviz
TF_TOPIC = "tf"  # TFMessage: mesh_markers -> rviz
MAP_FRAME = "map"

GROUNDED_TOPIC = "Drones/grounded"  # GroundedDrones, latched: DroneFactory -> hosts


def check_namespace(namespace: str) -> None:
    """Raises ConfigurationError unless the names of a simulation are valid in this namespace."""
    try:
        check_topic(0, f"/{namespace.strip('/')}/{node_topic(0)}".replace("//", "/"))
    except AirError as error:
        raise ConfigurationError(
            f"invalid namespace {namespace!r}: must be letters, digits and _, and begin with a "
            "letter"
        ) from error


def host_param(host: str) -> str:
    """The parameter in which a ROS node declares the ids of the mesh nodes that it runs."""
    return f"drone_mesh/hosts/{host.strip('/')}"


OfNode = Callable[[int], str]  # the name of one node or drone, by its id

drone_frame: OfNode = "drone_{}".format  # tf frame, at the drone's underside
node_topic: OfNode = "Node/{}".format  # NRF24: simulator -> antenna
debug_topic: OfNode = "Nodes/{}/debug".format  # NodeDebugInfo: antenna -> users
power_switch: OfNode = "Nodes/{}/powerSwitch".format  # PowerSwitch, offered by the antenna
internet_switch: OfNode = "Nodes/{}/internetSwitch".format  # PowerSwitch, offered by a gateway
send_service: OfNode = "Nodes/{}/send".format  # SendData: users -> node
received_topic: OfNode = "Nodes/{}/received".format  # ReceivedData: node -> users
goal_topic: OfNode = "Drones/{}/goal".format  # Location: connector -> engine
mission_service: OfNode = "Drones/{}/mission".format  # FlyMission, offered by the engine
gps_service: OfNode = "Drones/{}/gps".format  # RequestGPS, offered by the engine
fly_action: OfNode = "Drones/{}/fly".format  # Fly, an action: users -> fly_actions
