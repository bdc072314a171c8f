"""Networks and checks that several tests share."""

from __future__ import annotations

from pathlib import Path

from drone_mesh.formations.layouts import Layouts
from drone_mesh.inprocess import Network

LAYOUTS = Layouts.load(Path(__file__).parents[3] / "config" / "casus.yaml")


def layout(case, seed=0, **options):
    """A gateway at its place, and the drones of a layout at theirs, all started in step."""
    network = Network(seed=seed, **options)
    network.add_gateway(0, -1.0, 0.0)
    for node_id, goal in reversed(LAYOUTS.orders(case)):
        network.add_router(node_id, goal.longitude, goal.latitude)
    return network


def placed(places, **options):
    """Gateway 0 and routers 1, 2, ... at these x and y."""
    network = Network(**options)
    network.add_gateway(0, *places[0])
    for node, place in enumerate(places[1:], start=1):
        network.add_router(node, *place)
    return network


def line(routers, spacing=6.0, **options):
    """Gateway 0 and routers 1, 2, ... in a line along x."""
    return placed([(spacing * node, 0.0) for node in range(routers + 1)], **options)


def between_gateways(routers, **options):
    """Gateways 0 and 1 at the ends of a line of routers, 2, 3, ..."""
    network = line(0, **options)
    for node in range(2, routers + 2):
        network.add_router(node, 6.0 * (node - 1), 0.0)
    network.add_gateway(1, 6.0 * (routers + 1), 0.0)
    return network


def fleet(routers, gridsize, seed=0, gateways=1, **options):
    """The factory's fleet, 6 m apart, all started in step."""
    network = Network(seed=seed, **options)
    network.add_fleet(gateways, routers, gridsize, 6.0)
    return network


def events(network, *kinds, since_s=0.0):
    """(time, node, peer) of what happened of these kinds."""
    return [
        (event.now_s, event.node, event.peer)
        for event in network.events
        if event.now_s >= since_s and event.kind.name in kinds
    ]


def flown(network, since_s=0.0):
    """Ids of the drones that decided to fly."""
    return {node for _at_s, node, _to in events(network, "FLIGHT_DECIDED", since_s=since_s)}


def hops_across(network):
    """The longest of all shortest paths between two nodes, with or without power."""
    longest = 0
    for start in network.nodes:
        hops, edge = {start: 0}, [start]
        for node in edge:
            for other in network.air.in_range(node):
                if other not in hops:
                    hops[other] = hops[node] + 1
                    edge.append(other)
        longest = max(longest, *hops.values())
    return longest


def assert_hops_are_paths(network, above_shortest=1):
    """Each connected node's hop count is the length of its path, at most so much too long."""
    shortest = network.shortest_hops()
    for node in network.nodes:
        if not network.nodes[node].antenna.powered or not network.connected(node):
            continue
        path = network.path_to_gateway(node)
        assert path is not None, f"node {node} has no path"
        for sender, receiver in zip(path, path[1:]):
            assert network.nodes[receiver].antenna.powered
            assert receiver in network.air.in_range(sender)
        assert network.hops(node) == len(path) - 1, f"node {node}: {path}"
        assert network.hops(node) <= shortest[node] + above_shortest, f"node {node}: {path}"


def run_until(network, condition, within_s, step_s=5.0):
    """As Network.run_until, checking less often."""
    end_s = network.clock.now_s + within_s
    while not condition():
        if network.clock.now_s >= end_s:
            return False
        network.run_for(step_s)
    return True


def outage(network, seconds):
    """The medium loses every packet for a while; then it registers each antenna again."""
    network.air.loss = 1.0
    network.run_for(seconds)
    network.air.loss = 0.0
    for node in network.nodes.values():
        node.component.on_antenna_registered(network.clock.now_s)
        node.plan()
