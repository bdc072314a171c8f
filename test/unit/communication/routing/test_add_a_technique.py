"""CONTRIBUTING.md, "Add a routing technique": one written from its interface alone, in a mesh."""

from __future__ import annotations

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.interfaces import IRoutingEssentials, IRoutingTechnique
from drone_mesh.inprocess import Network


class LatestNeighbour(IRoutingTechnique):
    """One next hop per node: the neighbour over which it was heard of last."""

    def __init__(self) -> None:
        self._next_hops: dict[int, int] = {}
        self._essentials: IRoutingEssentials | None = None

    def start_routing(self, essentials: IRoutingEssentials) -> None:
        self._essentials = essentials
        essentials.search_other_nodes_in_range()

    def maintain_routing(self) -> None:
        assert self._essentials is not None
        self._essentials.search_other_nodes_in_range()
        self._essentials.send_heartbeats(sorted(self.get_set_of_children()))

    def node_moved_location(self) -> None:
        self._next_hops.clear()

    def can_communicate_with_node(self, node: int) -> None:
        self._next_hops[node] = node

    def cant_communicate_with_node(self, node: int) -> int:
        known = len(self._next_hops)
        self._next_hops = {to: hop for to, hop in self._next_hops.items() if hop != node}
        return int(len(self._next_hops) < known)

    def other_can_communicate_with_node(self, other: int, node: int) -> None:
        self.can_communicate_with_node(other)
        if self._next_hops.get(node) != node:
            self._next_hops[node] = other

    def other_cant_communicate_with_node(self, other: int, node: int) -> int:
        if self._next_hops.get(node) != other:
            return 0
        del self._next_hops[node]
        return 1

    def get_direction_to_node(self, node: int) -> int:
        return self._next_hops.get(node, NO_ROUTE)

    def get_table_size(self) -> int:
        return len(self._next_hops)

    def get_set_of_children(self) -> frozenset[int]:
        return frozenset(node for node, hop in self._next_hops.items() if node == hop)


def test_a_technique_given_by_its_path_carries_a_mesh_its_orders_and_the_death_of_a_relay():
    network = Network(seed=3, routing=f"{__name__}:LatestNeighbour")
    network.add_fleet(gateways=1, routers=11, gridsize=4, spacing=6.0)
    assert network.run_until(network.all_connected, within_s=60.0)
    technique = network.nodes[5].component.control.routes
    assert isinstance(technique, LatestNeighbour)
    place = network.location(11)
    assert network.order(11, place.longitude + 1.0, place.latitude + 1.0)
    assert network.run_until(lambda: network.nodes[11].drone.path is not None, within_s=10.0)
    network.run_for(60.0)
    network.power(1, False)  # the others keep paths over the second row of the grid
    assert network.run_until(lambda: technique.get_direction_to_node(1) != 1, within_s=60.0)
    left = [node for node in range(2, 12) if node in network.shortest_hops()]
    assert len(left) == 10
    assert network.run_until(lambda: all(map(network.connected, left)), within_s=60.0)


def test_a_technique_knows_the_places_of_its_gateway_and_its_next_hop_and_of_no_other_neighbour():
    network = Network(seed=3, routing=f"{__name__}:LatestNeighbour")
    network.add_fleet(gateways=1, routers=11, gridsize=4, spacing=6.0)
    network.run_for(60.0)
    technique = network.nodes[11].component.control.routes
    next_hop, essentials = technique.get_direction_to_node(0), technique._essentials
    assert essentials.place_of(0) == network.location(0)
    assert essentials.place_of(next_hop) == network.location(next_hop)
    others = technique.get_set_of_children() - {0, next_hop}
    assert len(others) >= 2
    assert {essentials.place_of(node) for node in others} == {None}


def test_by_default_a_heartbeat_proves_a_path_and_other_packets_teach_it_only_to_the_unknown():
    data, heartbeat = 0x80, 0x04
    technique = LatestNeighbour()
    for from_, kind, learned in [(2, data, 2), (3, data, 2), (3, heartbeat, 3), (2, data, 3)]:
        assert technique.learn(5, from_, kind, bytes(32))
        assert technique.get_direction_to_node(5) == learned
        assert technique.get_direction_to_node(from_) == from_
    assert technique.learn(4, 4, heartbeat, bytes(32))
    assert technique.get_set_of_children() == {2, 3, 4}
