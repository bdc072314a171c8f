"""The state of a mesh at one moment.

NodeStatus and MeshStatus are NodeState.msg and MeshState.msg without ROS: the same field names.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import islice
from typing import Iterable, Iterator, Sequence

from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.events.observer import explanation
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.election import NO_BID
from drone_mesh.communication.repair.options import RANGE_M
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role

UNKNOWN_POSITION = (math.nan, math.nan, math.nan)
REPAIR_STATES = tuple(RepairState)  # in the order of the constants of NodeState.msg


@dataclass
class NodeStatus:
    """One node, as NodeState.msg describes it, with the units and special values given there."""

    id: int
    role: int = Role.ROUTER
    on: bool = True
    connected: bool = False
    gateway: int = NO_ROUTE
    hops: int = NO_ROUTE
    next_hop: int = NO_ROUTE
    fallback: int = NO_ROUTE
    fallback_age: float = math.nan  # simulated s; NaN: none
    known_nodes: int = 0
    total_messages: int = 0
    neighbours: bytes = b""
    neighbour_ages: bytes = b""  # s, one per neighbour, 255 means 255 or more
    route: bytes = b""
    position: Sequence[float] = UNKNOWN_POSITION  # (3,) m, map frame, of the underside
    path: Sequence[float] = ()  # (3 * waypoints,) m, map frame
    heading: Sequence[float] = ()  # (3,) m, map frame, where its pilot flies it to; empty: nowhere
    report_age: float = 0.0  # wall seconds
    airtime: float = 0.0  # share of the time that its frames occupy a shared channel
    tries: float = 0.0  # per packet on a shared channel; 0 on another medium
    queue: int = 0  # packets that wait to be sent
    given_up: int = 0  # packets that were given up after all attempts
    data_sent: int = 0  # users' messages submitted at this node
    data_bytes_sent: int = 0
    data_sent_at: float = 0.0  # simulated s; 0: none
    data_received: int = 0  # users' messages delivered at this node
    data_bytes_received: int = 0
    data_received_at: float = 0.0  # simulated s; 0: none
    data_queued: int = 0  # now
    data_given_up: int = 0
    repair_state: int = 0  # index of REPAIR_STATES
    bid: float = NO_BID
    place_of: int = NO_ROUTE
    emergency_in: float = math.inf  # simulated s
    battery: float = math.nan  # percent; NaN: none, or unknown
    crashed: bool = False
    shares_id: bool = False  # another radio with its id was heard lately
    jammed: bool = False  # it hears nobody, and measures power in its channel
    why_not_fly: str = ""  # why its drone cannot fly now; empty: it can, or unknown
    mission: str = ""  # what its pilot flies, and how far it is, in words; empty: none
    repair: str = ""  # what the node does about a lost connection, and why; empty: nothing
    repair_reason: str = ""  # that why alone: of a node that does not fly or bid, or lands early
    time_left: float = math.nan  # simulated s that it can hover until it comes down; NaN: unknown
    home: Sequence[float] = ()  # (3,) m, its pad, where crews swap its battery; empty: none
    pad: str = ""  # what they do for it, in words; empty: nothing
    relieves: int = NO_ROUTE  # the drone whose place it takes; NO_ROUTE: none
    outside_fence: str = ""  # why its drone may not be where it is; empty: it may


@dataclass(frozen=True)
class ObstacleStatus:
    """One box of the world, as Obstacle.msg describes it."""

    center: Sequence[float]  # (3,) m, map frame
    size: Sequence[float]  # (3,) m, full edges along its own x, y and z
    yaw: float = 0.0  # rad, turned about its vertical axis


def footprint(box: ObstacleStatus) -> list[tuple[float, float]]:
    """The four corners of a box as seen from above, in metres, counterclockwise."""
    cos, sin = math.cos(box.yaw), math.sin(box.yaw)
    half_x, half_y = box.size[0] / 2, box.size[1] / 2
    return [
        (box.center[0] + cos * x - sin * y, box.center[1] + sin * x + cos * y)
        for x, y in ((-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y))
    ]


@dataclass(frozen=True)
class AreaStatus:
    """One area of the fence, as FenceArea.msg describes it."""

    name: str
    inside: bool  # drones stay inside any of these; otherwise out of it
    lowest: float  # m; -inf: no lower end
    highest: float  # m; inf: no upper end
    corners: Sequence[float]  # (2 * corners,) m, map frame, ring after ring
    rings: Sequence[int]  # how many corners each has; an odd number of rings surrounds the inside


def rings_of(area: AreaStatus) -> list[list[tuple[float, float]]]:
    """The corners of each ring of an area, in metres."""
    corners = iter(zip(area.corners[::2], area.corners[1::2]))
    return [list(islice(corners, size)) for size in area.rings]


@dataclass(frozen=True)
class EventRecord:
    """One event at one node, as MeshEvent.msg describes it."""

    stamp_s: float
    node: int
    kind: str
    peers: tuple[int, ...] = ()
    detail: str = ""
    order: int = 0
    place: Location | None = None

    def explanation(self) -> str:
        """The words that views display after the kind."""
        return explanation(self.order, self.place, self.detail)


@dataclass(frozen=True)
class MeshStatus:
    """All nodes at one moment, as MeshState.msg describes it."""

    stamp_s: float
    nodes: Sequence[NodeStatus]  # ascending ids
    max_distance: float = RANGE_M  # m
    real_time_factor: float = 1.0
    achieved_real_time_factor: float = 0.0
    paused: bool = False
    routing: str = ""  # name of the routing technique; empty: not known
    repair_strategy: str = ""  # name of the repair strategy; empty: not known
    obstacles: Sequence[ObstacleStatus] = ()
    shape: str = ""  # how drones are drawn: a value of view.scene.Shape; empty: the default
    layouts: Sequence[str] = ()  # how far each ordered layout has come, in words
    fence: Sequence[AreaStatus] = ()


def channel_in_words(node: NodeStatus) -> str:
    """A node's use of a shared channel, as text; empty on another medium."""
    if not node.tries:
        return ""
    return (
        f"{100 * node.airtime:.1f} % airtime, {node.tries:.2f} tries per packet, "
        f"{node.queue} waiting, {node.given_up} given up"
    )


def data_in_words(node: NodeStatus) -> str:
    """The users' messages that a node sent and received, as text; empty if none."""
    if not (node.data_sent or node.data_received):
        return ""
    return (
        f"{node.data_sent} sent ({node.data_bytes_sent} bytes), "
        f"{node.data_received} received ({node.data_bytes_received} bytes), "
        f"{node.data_queued} waiting, {node.data_given_up} given up"
    )


def another_radio(node: int) -> str:
    """The trouble of a node whose id another radio uses, in words."""
    return f"another radio uses id {node}"


def waypoints(path: Sequence[float]) -> list[Sequence[float]]:
    """The places in a NodeStatus.path, each (3,) m."""
    return [path[at : at + 3] for at in range(0, len(path), 3)]


def position_is_known(node: NodeStatus) -> bool:
    """Whether the world or the node itself has reported where the node is."""
    return math.isfinite(node.position[0])


def known_positions(states: Iterable[MeshStatus]) -> Iterator[tuple[float, int, Sequence[float]]]:
    """Stamp (s), node, and x, y, z (m), of each node whose position is known, in each state."""
    for mesh in states:
        for node in mesh.nodes:
            if position_is_known(node):
                yield mesh.stamp_s, node.id, node.position
