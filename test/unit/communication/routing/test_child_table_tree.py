"""ChildTableTree: the original's own cases, and each rule of docs/protocol.md."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
from routing_rig import RecordingEssentials

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.child_table_tree import ChildTableTree
from drone_mesh.communication.routing.interfaces import IRoutingTechnique


def tree_with(*pairs):
    tree = ChildTableTree()
    for other, node in pairs:
        tree.other_can_communicate_with_node(other, node)
    return tree


def test_the_original_case_of_a_grandchild_under_two_children():
    tree = tree_with((1, 4), (2, 5), (3, 5))
    assert tree.get_direction_to_node(5) == 2
    assert tree.other_cant_communicate_with_node(2, 5) == 0
    assert tree.get_direction_to_node(5) == 3


def test_the_original_case_of_a_child_that_is_lost():
    tree = tree_with((1, 4), (2, 5), (3, 6))
    assert (tree.get_table_size(), tree.get_amount_of_children()) == (6, 3)
    assert tree.cant_communicate_with_node(2) == 1
    assert tree.get_direction_to_node(5) == NO_ROUTE


def test_maintaining_asks_for_all_children_together_even_if_one_heartbeat_costs_two_of_them():
    tree = tree_with((1, 4), (2, 5), (3, 6))
    essentials = RecordingEssentials(technique=tree, gone=(1, 2))
    tree.start_routing(essentials)
    tree.maintain_routing()
    assert essentials.asked == ["search", "search", 1, 2, 3]
    assert tree.get_set_of_children() == {3}


class Naive(IRoutingTechnique):
    """The rules as written, without optimisation. `proven_path_to_node` is the interface's."""

    def __init__(self):
        self.sets = {}

    def reachable(self, node):
        return node in self.sets or any(node in behind for behind in self.sets.values())

    def get_direction_to_node(self, node):
        if node in self.sets:
            return node
        return min((child for child in self.sets if node in self.sets[child]), default=NO_ROUTE)

    def start_routing(self, essentials):
        raise NotImplementedError

    def maintain_routing(self):
        raise NotImplementedError

    def node_moved_location(self):
        self.sets = {}

    def cant_communicate_with_node(self, node):
        removed = self.sets.pop(node, None) is not None
        return int(removed and not self.reachable(node))

    def other_cant_communicate_with_node(self, other, node):
        if other == node:
            return self.cant_communicate_with_node(node)
        removed = node in self.sets.get(other, ())
        if removed:
            self.sets[other] = self.sets[other] - {node}
        return int(removed and not self.reachable(node))

    def can_communicate_with_node(self, node):
        self.sets.setdefault(node, set())

    def other_can_communicate_with_node(self, other, node):
        self.can_communicate_with_node(other)
        if other != node:
            self.sets[other] = self.sets[other] | {node}

    def get_table_size(self):
        return sum(1 + len(behind) for behind in self.sets.values())

    def get_set_of_children(self):
        return frozenset(self.sets)


node_id = st.integers(0, 6)  # few, so that they meet
operation = st.one_of(
    st.tuples(
        st.sampled_from(["can_communicate_with_node", "cant_communicate_with_node"]), node_id
    ),
    st.tuples(
        st.sampled_from(
            [
                "other_can_communicate_with_node",
                "other_cant_communicate_with_node",
                "proven_path_to_node",
            ]
        ),
        node_id,
        node_id,
    ),
    st.tuples(st.just("node_moved_location")),
)


@settings(derandomize=True, deadline=None, database=None, max_examples=150)
@given(st.lists(operation, max_size=40))
def test_behaves_as_the_protocol_describes(operations):
    tree, naive = ChildTableTree(), Naive()
    for name, *ids in operations:
        assert getattr(tree, name)(*ids) == getattr(naive, name)(*ids), (name, ids)
        for node in range(8):
            assert tree.get_direction_to_node(node) == naive.get_direction_to_node(node)
        assert tree.get_table_size() == naive.get_table_size()
        assert tree.get_amount_of_children() == naive.get_amount_of_children()
        assert tree.get_set_of_children() == naive.get_set_of_children()
        assert tree.empty() == naive.empty()
