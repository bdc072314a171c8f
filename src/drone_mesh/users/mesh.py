"""Mesh: a program's own messages, in one line each, through the node of this machine."""

from __future__ import annotations

from typing import Iterator, NamedTuple

from drone_mesh.communication.data.ticket import TO_ALL, TO_GATEWAY
from drone_mesh.users.local_client import node_here

GATEWAY, ALL = TO_GATEWAY, TO_ALL


class MeshMessage(NamedTuple):
    """A message that arrived."""

    node: int  # who sent it
    type: int  # the port of the other interfaces, 0..255
    data: bytes


class Mesh:
    """The node that runs on this machine, of raspberry_router or raspberry_gateway.

    Needs no ROS; any number of programs may use one node, also after it was started again.
    """

    def __init__(self, node: int | None = None) -> None:
        """`node`: its id; None: the only one that runs here. Raises MeshError."""
        self._node = node_here(node)

    def write(self, node: int, type: int, data: bytes, wait_s: float = 10.0) -> bool:
        """Send up to 1,024 bytes to a node, to GATEWAY or to ALL; whether they arrived in `wait_s`.

        The node keeps trying for 240 s. To ALL a message is sent once, and nobody confirms it.
        Raises MeshError if the node does not run or refuses the message.
        """
        arrived, _ticket = self._node.send(
            node, data, port=type, reliable=node != ALL, wait_s=wait_s
        )
        return arrived

    def read(self, type: int | None = None) -> Iterator[MeshMessage]:
        """The messages that arrive from now on, of one type or of all, until the node stops."""
        for message in self._node.listen(type):
            yield MeshMessage(message["sender"], message["port"], message["payload"])
