"""Written by scripts/message_stubs from the files in msg/ and action/."""

from typing import Final, Sequence

import rospy
import std_msgs.msg
from genpy import Message

from drone_mesh.state.model import NodeStatus, ObstacleStatus

class DroneInfo(Message):
    nodeID: int
    position: Sequence[float]
    sub: str
    on: bool
    def __init__(
        self,
        nodeID: int = ...,
        position: Sequence[float] = ...,
        sub: str = ...,
        on: bool = ...,
    ) -> None: ...

class FlightOrderAnswer(Message):
    SENT: Final = 1
    NO_ROUTE: Final = 2
    REFUSED: Final = 3
    PLACE_TAKEN: Final = 4
    gateway: int
    drone: int
    outcome: int
    reason: str
    taken_by: int
    def __init__(
        self,
        gateway: int = ...,
        drone: int = ...,
        outcome: int = ...,
        reason: str = ...,
        taken_by: int = ...,
    ) -> None: ...

class FlyAction(Message): ...

class FlyFeedback(Message):
    state: str
    latitude: float
    longitude: float
    height: float
    distance: float
    def __init__(
        self,
        state: str = ...,
        latitude: float = ...,
        longitude: float = ...,
        height: float = ...,
        distance: float = ...,
    ) -> None: ...

class FlyGoal(Message):
    latitude: float
    longitude: float
    height: int
    def __init__(
        self,
        latitude: float = ...,
        longitude: float = ...,
        height: int = ...,
    ) -> None: ...

class FlyResult(Message):
    ARRIVED: Final = 1
    REFUSED: Final = 2
    NO_ROUTE: Final = 3
    GIVEN_UP: Final = 4
    CANCELLED: Final = 5
    REPLACED: Final = 6
    LOST_CONTACT: Final = 7
    outcome: int
    message: str
    def __init__(self, outcome: int = ..., message: str = ...) -> None: ...

class GroundedDrones(Message):
    ids: bytes
    reasons: Sequence[str]
    def __init__(self, ids: bytes | Sequence[int] = ..., reasons: Sequence[str] = ...) -> None: ...

class HostProgress(Message):
    host: str
    done: rospy.Time
    under_way: int
    def __init__(self, host: str = ..., done: rospy.Time = ..., under_way: int = ...) -> None: ...

class HostReport(Message):
    header: std_msgs.msg.Header
    host: str
    nodes: list[NodeState]
    events: list[MeshEvent]
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        host: str = ...,
        nodes: Sequence[NodeState] = ...,
        events: Sequence[MeshEvent] = ...,
    ) -> None: ...

class LayoutAction(Message): ...

class LayoutFeedback(Message):
    id: int
    arrived: bytes
    flying: bytes
    message: str
    def __init__(
        self,
        id: int = ...,
        arrived: bytes | Sequence[int] = ...,
        flying: bytes | Sequence[int] = ...,
        message: str = ...,
    ) -> None: ...

class LayoutGoal(Message):
    caseID: int
    at_once: bool
    def __init__(self, caseID: int = ..., at_once: bool = ...) -> None: ...

class LayoutProgress(Message):
    id: int
    name: str
    arrived: bytes
    flying: bytes
    later: bytes
    waiting: bytes
    refused: bytes
    reasons: Sequence[str]
    replaced: bytes
    not_in_fleet: bytes
    over: bool
    message: str
    def __init__(
        self,
        id: int = ...,
        name: str = ...,
        arrived: bytes | Sequence[int] = ...,
        flying: bytes | Sequence[int] = ...,
        later: bytes | Sequence[int] = ...,
        waiting: bytes | Sequence[int] = ...,
        refused: bytes | Sequence[int] = ...,
        reasons: Sequence[str] = ...,
        replaced: bytes | Sequence[int] = ...,
        not_in_fleet: bytes | Sequence[int] = ...,
        over: bool = ...,
        message: str = ...,
    ) -> None: ...

class LayoutResult(Message):
    id: int
    complete: bool
    message: str
    def __init__(self, id: int = ..., complete: bool = ..., message: str = ...) -> None: ...

class Location(Message):
    latitude: float
    longitude: float
    height: int
    def __init__(
        self,
        latitude: float = ...,
        longitude: float = ...,
        height: int = ...,
    ) -> None: ...

class MeshEvent(Message):
    STARTED: Final = 0
    CONNECTED: Final = 1
    DISCONNECTED: Final = 2
    GATEWAY_CHANGED: Final = 3
    NEIGHBOUR_FOUND: Final = 4
    NEIGHBOUR_LOST: Final = 5
    NODE_MISSING: Final = 6
    NO_ROUTE: Final = 7
    POWER_ON: Final = 8
    POWER_OFF: Final = 9
    EMERGENCY: Final = 10
    NEGOTIATION_STARTED: Final = 11
    NEGOTIATION_ENDED: Final = 12
    FLIGHT_DECIDED: Final = 13
    FLIGHT_ORDERED: Final = 14
    LANDED: Final = 15
    CRASHED: Final = 16
    BATTERY_LOW: Final = 17
    BATTERY_EMPTY: Final = 18
    GOAL_REFUSED: Final = 19
    ORDER_SENT: Final = 20
    ORDER_ACCEPTED: Final = 21
    ORDER_REFUSED: Final = 22
    ORDER_ARRIVED: Final = 23
    ORDER_GIVEN_UP: Final = 24
    TOOK_OFF: Final = 25
    CANNOT_FLY: Final = 26
    CAN_FLY: Final = 27
    ORDER_REPLACED: Final = 28
    ORDER_LOST_CONTACT: Final = 29
    stamp: rospy.Time
    node: int
    code: int
    kind: str
    peers: bytes
    detail: str
    order: int
    place: list[Location]
    def __init__(
        self,
        stamp: rospy.Time = ...,
        node: int = ...,
        code: int = ...,
        kind: str = ...,
        peers: bytes | Sequence[int] = ...,
        detail: str = ...,
        order: int = ...,
        place: Sequence[Location] = ...,
    ) -> None: ...

class MeshState(Message):
    header: std_msgs.msg.Header
    max_distance: float
    real_time_factor: float
    achieved_real_time_factor: float
    paused: bool
    routing: str
    repair_strategy: str
    nodes: list[NodeState]
    shape: str
    layouts: Sequence[str]
    obstacles: list[Obstacle]
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        max_distance: float = ...,
        real_time_factor: float = ...,
        achieved_real_time_factor: float = ...,
        paused: bool = ...,
        routing: str = ...,
        repair_strategy: str = ...,
        nodes: Sequence[NodeState] = ...,
        shape: str = ...,
        layouts: Sequence[str] = ...,
        obstacles: Sequence[Obstacle] = ...,
    ) -> None: ...

class NRF24(Message):
    payload: bytes
    def __init__(self, payload: bytes | Sequence[int] = ...) -> None: ...

class NodeDebugInfo(Message):
    nodeID: int
    ConnectedWithGateway: bool
    familySize: int
    totalMessages: int
    prefferedGateWay: int
    on: bool
    hops: int
    prefLoc: int
    def __init__(
        self,
        nodeID: int = ...,
        ConnectedWithGateway: bool = ...,
        familySize: int = ...,
        totalMessages: int = ...,
        prefferedGateWay: int = ...,
        on: bool = ...,
        hops: int = ...,
        prefLoc: int = ...,
    ) -> None: ...

class NodeState(Message, NodeStatus):
    ROUTER: Final = 0
    GATEWAY: Final = 1
    UNKNOWN: Final = 255
    AT_REST: Final = 0
    LOST: Final = 1
    ASKING: Final = 2
    NEGOTIATING: Final = 3
    WATCHING: Final = 4
    FLYING: Final = 5
    id: int
    role: int
    on: bool
    connected: bool
    gateway: int
    hops: int
    next_hop: int
    fallback: int
    fallback_age: float
    known_nodes: int
    total_messages: int
    neighbours: bytes
    neighbour_ages: bytes
    route: bytes
    position: Sequence[float]
    path: Sequence[float]
    heading: Sequence[float]
    report_age: float
    airtime: float
    tries: float
    queue: int
    given_up: int
    data_sent: int
    data_bytes_sent: int
    data_sent_at: float
    data_received: int
    data_bytes_received: int
    data_received_at: float
    data_queued: int
    data_given_up: int
    repair_state: int
    bid: float
    place_of: int
    emergency_in: float
    battery: float
    crashed: bool
    shares_id: bool
    why_not_fly: str
    repair: str
    repair_reason: str
    def __init__(
        self,
        id: int = ...,
        role: int = ...,
        on: bool = ...,
        connected: bool = ...,
        gateway: int = ...,
        hops: int = ...,
        next_hop: int = ...,
        fallback: int = ...,
        fallback_age: float = ...,
        known_nodes: int = ...,
        total_messages: int = ...,
        neighbours: bytes | Sequence[int] = ...,
        neighbour_ages: bytes | Sequence[int] = ...,
        route: bytes | Sequence[int] = ...,
        position: Sequence[float] = ...,
        path: Sequence[float] = ...,
        heading: Sequence[float] = ...,
        report_age: float = ...,
        airtime: float = ...,
        tries: float = ...,
        queue: int = ...,
        given_up: int = ...,
        data_sent: int = ...,
        data_bytes_sent: int = ...,
        data_sent_at: float = ...,
        data_received: int = ...,
        data_bytes_received: int = ...,
        data_received_at: float = ...,
        data_queued: int = ...,
        data_given_up: int = ...,
        repair_state: int = ...,
        bid: float = ...,
        place_of: int = ...,
        emergency_in: float = ...,
        battery: float = ...,
        crashed: bool = ...,
        shares_id: bool = ...,
        why_not_fly: str = ...,
        repair: str = ...,
        repair_reason: str = ...,
    ) -> None: ...

class Obstacle(Message, ObstacleStatus):
    center: Sequence[float]
    size: Sequence[float]
    yaw: float
    def __init__(
        self,
        center: Sequence[float] = ...,
        size: Sequence[float] = ...,
        yaw: float = ...,
    ) -> None: ...

class PacketSample(Message):
    carried: int
    senders: bytes
    receivers: bytes
    types: bytes
    ages: Sequence[float]
    def __init__(
        self,
        carried: int = ...,
        senders: bytes | Sequence[int] = ...,
        receivers: bytes | Sequence[int] = ...,
        types: bytes | Sequence[int] = ...,
        ages: Sequence[float] = ...,
    ) -> None: ...

class ReceivedData(Message):
    header: std_msgs.msg.Header
    sender: int
    port: int
    to_all: bool
    reliable: bool
    payload: bytes
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        sender: int = ...,
        port: int = ...,
        to_all: bool = ...,
        reliable: bool = ...,
        payload: bytes | Sequence[int] = ...,
    ) -> None: ...

class RequestGatewayDroneFlight(Message):
    ID: int
    latitude: float
    longitude: float
    height: int
    def __init__(
        self,
        ID: int = ...,
        latitude: float = ...,
        longitude: float = ...,
        height: int = ...,
    ) -> None: ...
