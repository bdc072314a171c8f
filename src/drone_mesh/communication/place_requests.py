"""Requests for places: a REQUESTLOCATION, which its addressee answers with a LOCATION."""

from __future__ import annotations

from drone_mesh.communication.interfaces import BROADCAST
from drone_mesh.communication.messages import request_for_place
from drone_mesh.communication.parts import NodeParts


def ask_for_place(parts: NodeParts, node: int) -> None:
    """Ask `node` for its place, along the route to it."""
    parts.delivery.send_own(_request(parts, node))


def ask_all_for_places(parts: NodeParts, may_fly_on: bool = False) -> None:
    """Ask every node in range for its place; `may_fly_on`: also of others near, as in flight."""
    parts.antenna.broadcast_message(_request(parts, BROADCAST, may_fly_on))


def _request(parts: NodeParts, to: int, may_fly_on: bool = False) -> bytes:
    """A request with the place of this node: its destination, if it flies."""
    goal = parts.pilot.goal
    place = goal or parts.pilot.place()
    flies_there = may_fly_on or goal is not None
    return request_for_place(parts.node_id, to, place, flies_there=flies_there)
