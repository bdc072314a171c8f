"""Neighbours: the nodes in direct reach, as their packets show them."""

from __future__ import annotations

from drone_mesh.communication.interfaces import NO_ROUTE


class Neighbours:
    """When each neighbour was last heard, and which gateway it uses.

    The only owner of this table: the other parts of a component report here what they learn. A
    node that is no longer a neighbour keeps its gateway on record until it names another one.
    """

    def __init__(self) -> None:
        self._heard_s: dict[int, float] = {}
        self._gateways: dict[int, int] = {}

    def heard(self, node: int, now_s: float) -> bool:
        """A packet arrived from `node`. True if it was not a neighbour before."""
        is_new = node not in self._heard_s
        self._heard_s[node] = now_s
        return is_new

    def lost(self, node: int) -> bool:
        """`node` is out of reach. True if it was a neighbour."""
        return self._heard_s.pop(node, None) is not None

    def forget_all(self) -> None:
        """This node moved, so it may have other neighbours."""
        self._heard_s.clear()

    def uses_gateway(self, node: int, gateway: int) -> None:
        """`node` is connected to `gateway`."""
        self._gateways[node] = gateway

    def gateway_of(self, node: int) -> int:
        """The gateway that `node` named last, or NO_ROUTE."""
        return self._gateways.get(node, NO_ROUTE)

    def heard_s(self) -> dict[int, float]:
        """A copy: for each neighbour the time of its last packet, in seconds."""
        return dict(self._heard_s)

    def last_heard_s(self, node: int, otherwise: float) -> float:
        """When `node` was last heard; `otherwise` if it is not a neighbour."""
        return self._heard_s.get(node, otherwise)
