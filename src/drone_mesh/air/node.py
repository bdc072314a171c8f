"""Node: one antenna in the simulated air, and checks of its values."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Sequence, Tuple

from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.errors import MeshError

MAX_TOPIC_LENGTH = 200  # our choice; ROS itself sets no limit
# wiki.ros.org/Names; relative and private names have a different meaning in each node.
_TOPIC = re.compile(r"/?[A-Za-z]\w*(/\w+)*", re.ASCII)

Position = Tuple[float, float, float]  # longitude (x), latitude (y), height (z), metres


class AirError(MeshError):
    """Invalid message or request to the simulated air. Drop it, or reply with the text."""


@dataclass(frozen=True)
class Node:
    """One registered antenna."""

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
