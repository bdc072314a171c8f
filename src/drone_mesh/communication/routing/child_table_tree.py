"""Trees: each neighbour and the nodes behind it (docs/protocol.md, "ChildTableTree")."""

from __future__ import annotations

from typing import Final, Sequence

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.interfaces import IRoutingEssentials, IRoutingTechnique
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.compiled import mypyc_attr

_HEARTBEAT: Final = int(MessageType.HEARTBEAT)


@mypyc_attr(allow_interpreted_subclasses=True)
class ChildTableTree(IRoutingTechnique):
    """Direct neighbours ("children"), and per child what it can reach ("grandchildren")."""

    _essentials: IRoutingEssentials  # from start_routing on

    def __init__(self) -> None:
        self._children: dict[int, set[int]] = {}
        # The inverse of the table, and the next hops that follow from it: no lookup has to search.
        self._children_with: dict[int, set[int]] = {}
        self._next_hops: dict[int, int] = {}
        self._entries = 0  # grandchildren in all sets together

    def get_direction_to_node(self, node: int) -> int:
        """The node itself if it is a child, else the child with the lowest id that has it."""
        return self._next_hops.get(node, NO_ROUTE)

    def may_reach(self, node: int) -> bool:
        return self.get_direction_to_node(node) != NO_ROUTE

    def directions(self, node: int, came_from: int, creator: int) -> Sequence[int]:
        """The next hop; the same as in the interface, in fewer calls for each packet."""
        to = self.get_direction_to_node(node)
        return () if to == NO_ROUTE else (to,)

    def start_routing(self, essentials: IRoutingEssentials) -> None:
        self._essentials = essentials
        essentials.search_other_nodes_in_range()

    def maintain_routing(self) -> None:
        """Introduce this node again, and check each child with a heartbeat."""
        self._essentials.search_other_nodes_in_range()
        self._essentials.send_heartbeats(sorted(self._children))

    def node_moved_location(self) -> None:
        self._children.clear()
        self._children_with.clear()
        self._next_hops.clear()
        self._entries = 0

    def cant_communicate_with_node(self, node: int) -> int:
        """Remove child `node` and its grandchildren."""
        grandchildren = self._children.pop(node, None)
        if grandchildren is None:
            return 0
        for grandchild in grandchildren:
            self._forget_holder(grandchild, node)
        self._choose_next_hop(node)
        return int(node not in self._children_with)

    def other_cant_communicate_with_node(self, other: int, node: int) -> int:
        """Remove `node` from the grandchildren of `other`."""
        if other == node:
            return self.cant_communicate_with_node(node)
        grandchildren = self._children.get(other)
        if grandchildren is None or node not in grandchildren:
            return 0
        grandchildren.remove(node)
        self._forget_holder(node, other)
        return int(node not in self._children_with and node not in self._children)

    def learn(self, creator: int, from_: int, kind: int, payload: bytes) -> bool:
        """See the interface. What is known already costs no call, as every packet passes here."""
        if from_ not in self._children:
            self.can_communicate_with_node(from_)
        if creator != from_:
            if kind == _HEARTBEAT:
                holders = self._children_with.get(creator)
                if holders is None or from_ not in holders or len(holders) > 1:
                    self.proven_path_to_node(from_, creator)
            elif self.get_direction_to_node(creator) == NO_ROUTE:
                self.other_can_communicate_with_node(from_, creator)
        return True

    def sent(self, neighbour: int, ok: bool, transmissions: int) -> None:
        if ok and neighbour not in self._children:
            self.can_communicate_with_node(neighbour)

    def can_communicate_with_node(self, node: int) -> None:
        if node not in self._children:
            self._children[node] = set()
            self._next_hops[node] = node

    def other_can_communicate_with_node(self, other: int, node: int) -> None:
        """`other` becomes a child and `node` its grandchild."""
        self.can_communicate_with_node(other)
        if other != node and node not in self._children[other]:
            self._children[other].add(node)
            self._children_with.setdefault(node, set()).add(other)
            self._entries += 1
            self._choose_next_hop(node)

    def proven_path_to_node(self, other: int, node: int) -> None:
        """List `node` under `other` and under no other child."""
        for child in self._children_with.get(node, set()) - {other}:
            self.other_cant_communicate_with_node(child, node)
        self.other_can_communicate_with_node(other, node)

    def get_table_size(self) -> int:
        return len(self._children) + self._entries

    def get_set_of_children(self) -> frozenset[int]:
        return frozenset(self._children)

    def _forget_holder(self, node: int, child: int) -> None:
        self._entries -= 1
        holders = self._children_with[node]
        holders.remove(child)
        if not holders:
            del self._children_with[node]
        self._choose_next_hop(node)

    def _choose_next_hop(self, node: int) -> None:
        """The entries for `node` have changed."""
        holders = self._children_with.get(node)
        if node in self._children:
            self._next_hops[node] = node
        elif holders:
            self._next_hops[node] = min(holders)
        else:
            self._next_hops.pop(node, None)


@mypyc_attr(allow_interpreted_subclasses=True)
class SteadyTree(ChildTableTree):
    """Keeps a known route until it fails; ChildTableTree follows the latest heartbeat."""

    def proven_path_to_node(self, other: int, node: int) -> None:
        """`node` was just reached through `other`: a new route only if there was none."""
        if self.get_direction_to_node(node) == NO_ROUTE:
            self.other_can_communicate_with_node(other, node)
