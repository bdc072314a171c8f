"""SteadyTree: a tree that keeps a route as long as it works."""

from __future__ import annotations

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.child_table_tree import ChildTableTree


class SteadyTree(ChildTableTree):
    """Keeps a known route until it fails; ChildTableTree follows the latest heartbeat."""

    def proven_path_to_node(self, other: int, node: int) -> None:
        """`node` was just reached through `other`: a new route only if there was none."""
        if self.get_direction_to_node(node) == NO_ROUTE:
            self.other_can_communicate_with_node(other, node)
