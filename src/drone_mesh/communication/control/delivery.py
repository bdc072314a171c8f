"""What the parts of a node use of its control plane: the sending of packets, and next hops."""

from __future__ import annotations

import abc

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.compiled import mypyc_attr

# Not abc.ABC: from that mypyc derives no dataclass.


@mypyc_attr(allow_interpreted_subclasses=True)
class IDelivery(metaclass=abc.ABCMeta):
    """Sends the packets of one node."""

    total_sent: int  # packets delivered, or handed to the antenna; broadcasts not counted

    @abc.abstractmethod
    def send_own(self, payload: bytes) -> bool:
        """Send this node's own packet towards its addressee. False: there is no way to it."""

    @abc.abstractmethod
    def send(self, payload: bytes, to: int) -> bool:
        """Send a packet to the neighbour `to`, and nowhere else. False: it did not take it."""


@mypyc_attr(allow_interpreted_subclasses=True)
class IRoutes(metaclass=abc.ABCMeta):
    """What a node knows about others. A reporting thread may call the first two at any time."""

    @abc.abstractmethod
    def get_direction_to_node(self, node: int) -> int:
        """The next hop for `node`, or NO_ROUTE."""

    def may_reach(self, node: int) -> bool:
        """Whether a packet for `node` may arrive: there is a next hop, or one may turn up soon."""
        return self.get_direction_to_node(node) != NO_ROUTE

    @abc.abstractmethod
    def get_table_size(self) -> int:
        """Number of known nodes; how often one counts is the technique's own matter."""

    @abc.abstractmethod
    def get_set_of_children(self) -> frozenset[int]:
        """Ids of the nodes in direct reach."""

    @abc.abstractmethod
    def node_moved_location(self) -> None:
        """This node is at another place, with other neighbours."""

    def heard_by(self, node: int) -> frozenset[int]:
        """The nodes that a neighbour has shown to hear; empty without such news."""
        return frozenset()

    def has_own_way(self, node: int) -> bool | None:
        """Whether a node in at most two hops has a way up that does not lead through this one.

        None: the technique cannot tell; the hops that it reported can.
        """
        return None
