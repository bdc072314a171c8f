"""GatewayRoutes: the common base of techniques with their own routes to gateways."""

from __future__ import annotations

import abc

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.child_table_tree import ChildTableTree

ETX_GAIN = 0.1  # weight of a new sample; CTP (TEP 123) uses the same exponential average
WORST_ETX = 16.0  # worse links count as this value


def newer_by(sequence: int, other: int) -> int:
    """The distance from `other` to `sequence` on a circle of 2**16; negative: it is older."""
    return (sequence - other + 2**15) % 2**16 - 2**15


class GatewayRoutes(ChildTableTree):
    """Routes to gateways come from `next_hop_to_gateway`; all others are those of the tree.

    A heartbeat on its way to a gateway teaches the relays the route back, as in the tree.
    """

    TAKES_SHORTCUTS = False

    def __init__(self) -> None:
        super().__init__()
        self._etx: dict[int, float] = {}

    @abc.abstractmethod
    def next_hop_to_gateway(self, gateway: int) -> int:
        """The next hop to `gateway`; NO_ROUTE if this technique knows none."""

    @abc.abstractmethod
    def forget_neighbour(self, neighbour: int) -> None:
        """`neighbour` is out of reach: drop routes to gateways through it."""

    @abc.abstractmethod
    def forget_gateway(self, gateway: int) -> None:
        """`gateway` did not answer: drop all routes to it."""

    def on_time(self, now_s: float) -> None:
        """Advertise what has changed: PRESENT carries it, where the technique says so."""
        self._essentials.search_other_nodes_in_range()

    def get_direction_to_node(self, node: int) -> int:
        to = self.next_hop_to_gateway(node)
        return to if to != NO_ROUTE else super().get_direction_to_node(node)

    def etx(self, neighbour: int) -> float:
        """Expected transmissions per packet to a neighbour (De Couto et al., 2003).

        1.0 for a link that never lost a packet or had no traffic yet.
        """
        return self._etx.get(neighbour, 1.0)

    def sent(self, neighbour: int, ok: bool, transmissions: int) -> None:
        """Measure the link; a packet that was given up counts twice."""
        sample = min(float(transmissions if ok else 2 * transmissions), WORST_ETX)
        before = self.etx(neighbour)
        self._etx[neighbour] = before + ETX_GAIN * (sample - before)
        super().sent(neighbour, ok, transmissions)

    def cant_communicate_with_node(self, node: int) -> int:
        self.forget_neighbour(node)
        return super().cant_communicate_with_node(node)

    def gateway_lost(self, gateway: int) -> bool:
        self.forget_gateway(gateway)
        return super().gateway_lost(gateway)

    def node_moved_location(self) -> None:
        """Forget the neighbours and the routes through them, but not the sequence numbers."""
        for child in self.get_set_of_children():
            self.forget_neighbour(child)
        super().node_moved_location()
