"""The routing interface: what a technique learns, and what it may do (docs/techniques.md).

A technique has no thread, clock or randomness of its own: its component calls it, and it acts
through IRoutingEssentials.
"""

from __future__ import annotations

import abc
from typing import ClassVar, Sequence

from drone_mesh.communication.control.control_plane import ITechnique
from drone_mesh.communication.control.delivery import IRoutes
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.timing import UNDISTURBED, Medium
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location

_HEARTBEAT = int(MessageType.HEARTBEAT)


class IRoutingEssentials(abc.ABC):
    """The functions of the component that a routing technique may call."""

    @abc.abstractmethod
    def get_node_id(self) -> int:
        """This node's id, 0..253."""

    @abc.abstractmethod
    def get_preferred_gateway(self) -> int:
        """The gateway that this node uses, itself for a gateway; NO_ROUTE while it knows none."""

    @abc.abstractmethod
    def get_connected_to_gateway(self) -> bool:
        """Whether that gateway answered the last heartbeat, or may still answer it."""

    @abc.abstractmethod
    def now_s(self) -> float:
        """The time of the current call, in seconds of the component's clock."""

    @property
    def medium(self) -> Medium:
        """The properties of the antenna's medium. Constant."""
        return UNDISTURBED

    @abc.abstractmethod
    def wake_at(self, at_s: float) -> None:
        """Call `IRoutingTechnique.on_time` at this time; replaces an earlier request."""

    @abc.abstractmethod
    def search_other_nodes_in_range(self) -> None:
        """Introduce this node to every node in range, with the technique's extension bytes."""

    @abc.abstractmethod
    def send_heartbeat(self, other: int) -> bool:
        """Send a heartbeat towards node `other`. False: no route, or no next hop took it."""

    def send_heartbeats(self, others: Sequence[int]) -> None:
        """Send a heartbeat towards each of these nodes; failures show in the routes."""
        for other in others:
            self.send_heartbeat(other)

    @abc.abstractmethod
    def send_packet(self, kind: int, neighbour: int, body: bytes) -> bool:
        """Send a packet of the technique's own type (8..63, up to 27 bytes) to a neighbour."""

    @abc.abstractmethod
    def broadcast_packet(self, kind: int, body: bytes) -> None:
        """Send a packet of the technique's own type (8..63, up to 27 bytes) to all in range."""

    @abc.abstractmethod
    def own_place(self) -> Location | None:
        """The position of this node; None if the drone cannot report it."""

    @abc.abstractmethod
    def place_of(self, node: int) -> Location | None:
        """The last reported place of this node's gateway or next hop to it; None: of others."""


class IRoutingTechnique(ITechnique, IRoutes):
    """Decides by heartbeats which neighbour leads to which node.

    A node in direct reach is a "child"; nodes behind it are its "grandchildren".

    Called by one thread at a time, except `get_direction_to_node` and `get_table_size`, which a
    reporting thread may call at any time. If they raise, the previous report is kept.
    """

    @abc.abstractmethod
    def start_routing(self, essentials: IRoutingEssentials) -> None:
        """Start finding routes, through `essentials`."""

    @abc.abstractmethod
    def maintain_routing(self) -> None:
        """Check the routes; called once a check period."""

    @abc.abstractmethod
    def cant_communicate_with_node(self, node: int) -> int:
        """Neighbour `node` did not take a packet.

        Returns 1 if that removed something and `node` is no longer reachable, else 0.
        """

    @abc.abstractmethod
    def other_cant_communicate_with_node(self, other: int, node: int) -> int:
        """`other` reports that it cannot reach `node`; the return value is as above."""

    @abc.abstractmethod
    def can_communicate_with_node(self, node: int) -> None:
        """`node` is in direct reach."""

    @abc.abstractmethod
    def other_can_communicate_with_node(self, other: int, node: int) -> None:
        """Neighbour `other` can reach `node`."""

    def get_amount_of_children(self) -> int:
        """Number of nodes in direct reach."""
        return len(self.get_set_of_children())

    def empty(self) -> bool:
        """Whether no node is known."""
        return self.get_table_size() == 0

    def proven_path_to_node(self, other: int, node: int) -> None:
        """A packet created by `node` just arrived through `other`, which is now the route to it.

        Other routes to `node` are forgotten, except that it may itself be in direct reach
        (docs/protocol.md, "Receiving and learning": heartbeats prove a path).
        """
        for child in self.get_set_of_children():
            if child not in (other, node):
                self.other_cant_communicate_with_node(child, node)
        self.other_can_communicate_with_node(other, node)

    # Further behaviour; the defaults are the rules of a tree of children ------

    FLOODS: ClassVar[bool] = False
    """Packets go to several next hops, and the technique itself drops copies.

    Dead ends are then normal: they are neither reported nor answered with MISSING, and the
    component does not detect circulating packets.
    """

    TAKES_SHORTCUTS: ClassVar[bool] = True
    """Whether a router tries a neighbour that introduces itself with fewer hops.

    If so, its next heartbeat to the gateway goes through that neighbour, and the answer decides.
    """

    def learn(self, creator: int, from_: int, kind: int, payload: bytes) -> bool:
        """A packet arrived from neighbour `from_`, for this node or to be forwarded.

        `messages.hops` and `messages.extension` read the contents of PRESENT and HEARTBEAT. Return
        False to drop the packet. By default a heartbeat proves a path, and any other packet teaches
        a route to its creator if there was none (docs/protocol.md, "Receiving and learning").
        """
        self.can_communicate_with_node(from_)
        if creator != from_:
            if kind == _HEARTBEAT:
                self.proven_path_to_node(from_, creator)
            elif self.get_direction_to_node(creator) == NO_ROUTE:
                self.other_can_communicate_with_node(from_, creator)
        return True

    def sent(self, neighbour: int, ok: bool, transmissions: int) -> None:
        """A packet was delivered to `neighbour` (ok) or given up, after `transmissions`.

        A neighbour whose packet was given up is then reported to `cant_communicate_with_node`.
        """
        if ok:
            self.can_communicate_with_node(neighbour)

    def directions(self, node: int, came_from: int, creator: int) -> Sequence[int]:
        """The next hops for a packet to `node`; empty if there is no route.

        `came_from` is the neighbour that sent the packet, NO_ROUTE for this node's own packets.
        """
        to = self.get_direction_to_node(node)
        return () if to == NO_ROUTE else (to,)

    def gateway_lost(self, gateway: int) -> bool:
        """The gateway no longer answers. Returns whether to inform the neighbours."""
        tried: list[int] = []
        while True:
            to = self.get_direction_to_node(gateway)
            if to == NO_ROUTE or to in tried:
                return True
            tried.append(to)
            if to == gateway:
                self.cant_communicate_with_node(gateway)
            else:
                self.other_cant_communicate_with_node(to, gateway)

    def gateway_taken(self, neighbour: int, gateway: int) -> None:
        """This node has no gateway; `neighbour` uses this one, and earlier routes to it failed."""
        self.gateway_lost(gateway)
        self.other_can_communicate_with_node(neighbour, gateway)

    def circulated(self, node: int, used: int) -> None:
        """A packet for `node` that was sent to `used` came back."""
        if used not in (node, NO_ROUTE):
            self.other_cant_communicate_with_node(used, node)

    def extension(self, kind: int, room: int) -> bytes:
        """Up to `room` bytes to append to the body of this node's PRESENT or HEARTBEAT."""
        return b""

    def on_time(self, now_s: float) -> None:  # noqa: B027 (only some techniques need it)
        """The time requested with `IRoutingEssentials.wake_at` has come."""

    def on_packet(  # noqa: B027 (only some techniques need it)
        self, creator: int, from_: int, kind: int, body: bytes
    ) -> None:
        """A packet of the technique's own types 8..63 arrived; `body` has 27 bytes."""
