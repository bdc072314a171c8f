"""NodeTable: position, topic and power of each node, and which nodes are in range of each other."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Sequence, Tuple

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.communication.repair.options import RANGE_M
from drone_mesh.errors import MeshError

_UNKNOWN: Position = (0.0, 0.0, 0.0)


MAX_TOPIC_LENGTH = 200  # ROS itself sets no limit
# wiki.ros.org/Names; relative and private names have a different meaning in each node.
_TOPIC = re.compile(r"/?[A-Za-z]\w*(/\w+)*", re.ASCII)

Position = Tuple[float, float, float]  # longitude (x), latitude (y), height (z), metres


class AirError(MeshError):
    """Invalid message or request to the simulated air. Drop it, or reply with the text."""


@dataclass(frozen=True)
class Node:
    """One registered antenna in the simulated air."""

    node_id: int
    topic: str  # where it listens
    on: bool


def check_node_id(node_id: int) -> None:
    """Raise AirError for an invalid node id."""
    if not 0 <= node_id <= MAX_NODE_ID:
        raise AirError(f"invalid node id {node_id}: must be 0..{MAX_NODE_ID}")


def check_position(node_id: int, position: Sequence[float]) -> Position:
    """The position. Raises AirError if it is not three finite numbers."""
    if len(position) != 3 or not all(map(math.isfinite, position)):
        raise AirError(
            f"node {node_id}: invalid position {tuple(position)}: expected three finite numbers"
        )
    x, y, z = position
    return (float(x), float(y), float(z))


def check_topic(node_id: int, topic: str) -> None:
    """Raise AirError unless this is the global name of a ROS topic."""
    if len(topic) > MAX_TOPIC_LENGTH or not _TOPIC.fullmatch(topic):
        raise AirError(f"node {node_id}: invalid topic name {topic[:60]!r}")


class NodeTable:
    """The rules of the simulated air. Not thread-safe.

    docs/ros.md, "Wireless signal simulator" and "Sources of DroneInfo".
    """

    def __init__(self, max_distance_m: float = RANGE_M, obstacles: Obstacles | None = None) -> None:
        """Nodes within range of each other have a link unless `obstacles` cut it.

        Raises AirError unless the distance is a positive number.
        """
        if not max_distance_m > 0:
            raise AirError(f"invalid max_distance {max_distance_m}: must be above 0 metres")
        self._range_m = max_distance_m
        self._reach_m2 = max_distance_m * max_distance_m
        self._obstacles = obstacles
        self._nodes: dict[int, Node] = {}
        self._positions: dict[int, Position] = {}  # also of nodes that are not registered yet
        # Results of in_range, valid until a node moves or is switched.
        self._in_range: dict[int, tuple[int, ...]] = {}

    # DroneInfo -------------------------------------------------------------------------------

    def drone_info(self, node_id: int, position: Sequence[float], sub: str, on: bool) -> None:
        """Apply one DroneInfo. With `sub` it comes from an antenna; without, it is a position.

        Without `sub` and without a position it switches the power. With a position, `on` does not
        count, because engines leave it false.

        Raises AirError, and changes nothing, for an invalid id, position or topic.
        """
        check_node_id(node_id)
        place = check_position(node_id, position)
        if sub:
            check_topic(node_id, sub)
            self._apply_from_antenna(node_id, place, sub, on)
        else:
            self._apply_without_topic(node_id, place, on)

    def _apply_from_antenna(self, node_id: int, position: Position, topic: str, on: bool) -> None:
        known = self._nodes.get(node_id)
        if known is None:
            self._positions.setdefault(node_id, position)
        if known != Node(node_id, topic, on):
            self._set(Node(node_id, topic, on))

    def _apply_without_topic(self, node_id: int, position: Position, on: bool) -> None:
        node = self._nodes.get(node_id)
        stays_on = node is not None and node.on and on
        if position == _UNKNOWN and not stays_on:
            if node is not None and node.on != on:
                self._set(Node(node_id, node.topic, on))
        elif self._positions.get(node_id) != position:
            self._positions[node_id] = position
            self._in_range.clear()

    def _set(self, node: Node) -> None:
        self._nodes[node.node_id] = node
        self._in_range.clear()

    # Requests --------------------------------------------------------------------------------

    def node(self, node_id: int) -> Node | None:
        return self._nodes.get(node_id)

    def position(self, node_id: int) -> Position | None:
        """The position of a node, registered or not; metres."""
        return self._positions.get(node_id)

    def link(self, sender: int, receiver: int) -> str | None:
        """The topic on which `receiver` hears `sender`; None if there is no link.

        Both must be registered and on, closer than the maximum distance, and not separated by
        obstacles.
        """
        source, destination = self._nodes.get(sender), self._nodes.get(receiver)
        if source is None or destination is None or not (source.on and destination.on):
            return None
        here, there = self._positions[sender], self._positions[receiver]
        is_heard = self._reaches(here, there) and (sender == receiver or self._sees(here, there))
        return destination.topic if is_heard else None

    def in_range(self, node_id: int) -> tuple[int, ...]:
        """Ids of the nodes that a packet from `node_id` can reach, ascending.

        Raises AirError for an unregistered node; a node that is off reaches none.
        """
        answer = self._in_range.get(node_id)
        if answer is None:
            answer = self._in_range[node_id] = self._find_in_range(node_id)
        return answer

    def _find_in_range(self, node_id: int) -> tuple[int, ...]:
        node = self._nodes.get(node_id)
        if node is None:
            raise AirError(f"node {node_id} is not registered")
        if not node.on:
            return ()
        here, places = self._positions[node_id], self._positions
        near = [
            other
            for other, node in self._nodes.items()
            if node.on and self._reaches(here, places[other]) and other != node_id
        ]
        return tuple(other for other in sorted(near) if self._sees(here, places[other]))

    def _reaches(self, here: Position, there: Position) -> bool:
        x, y, z = here
        to_x, to_y, to_z = there
        apart_m2 = (to_x - x) * (to_x - x) + (to_y - y) * (to_y - y) + (to_z - z) * (to_z - z)
        return apart_m2 < self._reach_m2

    def _sees(self, here: Position, there: Position) -> bool:
        obstacles = self._obstacles
        return obstacles is None or obstacles.margin_db(here, there, self._range_m) > 0
