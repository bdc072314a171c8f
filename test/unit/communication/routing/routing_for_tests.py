"""A foreign routing technique, and invalid ones, for test_routing.py."""

from drone_mesh.communication.routing.child_table_tree import ChildTableTree


class ForeignTree(ChildTableTree):
    """Chosen as routing_for_tests:ForeignTree."""


class NotRouting:
    """Has none of the functions."""


class WantsArguments(ChildTableTree):
    """Cannot be created by name alone."""

    def __init__(self, depth):
        super().__init__()
        self.depth = depth


A_NUMBER = 7
