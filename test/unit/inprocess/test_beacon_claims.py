"""What false or strange packets may not do to a mesh with the technique beacon."""

from __future__ import annotations

import itertools
import math

import pytest
from scenarios import line as in_line
from scenarios import placed

from drone_mesh.communication.beacon.packets import (
    NO_ANCESTORS,
    Beacon,
    Below,
    Motion,
    Search,
)
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.interfaces import BROADCAST, NO_ROUTE
from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.communication.timing import Due
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location
from drone_mesh.inprocess.drone import InProcessDrone
from drone_mesh.mobility.track import Legs, leg_to, rest

STILL = (0.0, 0.0, 0.0)
FAR = Location(2000.0, 2000.0, 0.0)
KEY = MeshKey(bytes(range(16)))


def line(**options):
    """Gateway 0, and routers 1 and 2 behind it."""
    network = in_line(2, seed=3, routing="beacon", **options)
    network.run_for(60.0)
    return network


def star(second_relay=False):
    """A gateway, a relay or two, and four routers behind them that all hear each other."""
    network = in_line(1, spacing=7.0, seed=1, routing="beacon")
    for node, (x, y) in enumerate([(12.0, 2.0), (12.0, -2.0), (13.0, 0.0), (12.5, 4.0)], 2):
        network.add_router(node, x, y)
    if second_relay:
        network.add_router(6, 7.0, 3.0)
    network.run_for(40.0)
    return network


def beacon_packet(creator, beacon, room=27):
    body = beacon.to_body(room)
    return messages.packet(MessageType.BEACON, creator, creator, BROADCAST, BROADCAST, body)


def say(network, to, creator, beacon):
    network.inject(to, messages.readdressed(beacon_packet(creator, beacon), to))


def farthest_m(network, node, seconds):
    """How far the drone gets from where it is, while the others are silent."""
    start, farthest = network.location(node), 0.0
    for other in network.nodes:
        if other != node:
            network.power(other, False)
    for _ in range(int(seconds)):
        network.run_for(1.0)
        farthest = max(farthest, network.location(node).distance_m(start))
    return farthest


def nearest_m(network):
    pairs = itertools.combinations(network.nodes, 2)
    return min(math.dist(network.location(one), network.location(two)) for one, two in pairs)


@pytest.fixture
def network():
    return line()


@pytest.mark.parametrize(("creator", "hops", "parent"), [(1, 1, 0), (0, 0, NO_ROUTE)])
def test_a_place_that_is_out_of_reach_leads_no_drone_there(network, creator, hops, parent):
    number = network.nodes[2].component.control.routes.number + 1
    motion = Motion(FAR, STILL)
    say(network, 2, creator, Beacon(0, number % 256, hops, parent, NO_ANCESTORS, 1.6, motion))
    network.run_for(0.1)
    counts = network.nodes[2].component.complaints.counts
    assert counts["a neighbour's place that is out of reach"] == 1
    assert farthest_m(network, 2, 300.0) < 20.0


@pytest.mark.parametrize(("creator", "hops", "parent"), [(1, 1, 0), (0, 0, NO_ROUTE)])
def test_with_a_key_the_gateways_own_word_about_its_place_counts(creator, hops, parent):
    """Any node with the key can send a beacon in another's name; the hop seal is behind it."""
    network = line(key=KEY)
    router = network.nodes[2].component
    places = router.places
    assert not places.asks_gateway
    lie = Location(9.0, 9.0, 0.0)
    for _ in range(60):
        number = (router.control.routes.number + 1) % 256
        motion, elsewhere = (None, lie) if creator else (Motion(lie, STILL), None)
        beacon = Beacon(0, number, hops, parent, NO_ANCESTORS, 1.6, motion, elsewhere)
        packet = beacon_packet(creator, beacon, room=20)
        router.on_msg(messages.readdressed(packet, 2), network.now_s())
        assert places.gateway_disputed
        network.run_for(0.5)
        assert places.gateway.distance_m(network.location(0)) < 0.5
    network.run_for(70.0)
    assert not places.gateway_disputed


@pytest.mark.parametrize("key", [None, KEY])
def test_where_a_gateway_is_that_moves_is_known_at_each_hop(key):
    network = in_line(5, seed=1, routing="beacon", key=key)
    network.run_for(60.0)
    now_s, speed_m_s = network.now_s(), 0.3
    tracks = {}
    for node in network.nodes:
        x, y, z = 6.0 * node, 0.0, 0.0
        away = (x, y + 300.0 * speed_m_s, z)
        tracks[node] = Legs(
            [rest(0.0, (x, y, z), now_s), leg_to(now_s, now_s + 300.0, (x, y, z), away)]
        )
    network.fly(tracks)
    for _ in range(20):
        network.run_for(10.0)
        for node in range(1, 6):
            away_m = network.nodes[node].component.places.gateway.distance_m(network.location(0))
            assert away_m < speed_m_s * (25.0 if key else 10.0), node


def test_a_packet_of_a_node_without_beacons_makes_no_neighbour_for_long():
    network = star()
    for node in range(1, 6):
        network.inject(node, messages.packet(MessageType.PROBE, 200, 200, node, node))
    network.run_for(1.0)
    assert all(200 in network.nodes[node].component.get_neighbours() for node in range(1, 6))
    network.run_for(9.0)
    assert not any(200 in network.nodes[node].component.get_neighbours() for node in range(1, 6))


def test_a_failed_medium_is_recognised_after_a_packet_of_a_node_without_beacons():
    network = star()
    for node in range(1, 6):
        network.inject(node, messages.packet(MessageType.PROBE, 200, 200, node, node))
    network.run_for(20.0)
    network.air.carries = lambda _payload: False
    network.run_for(10.0)
    assert all(network.nodes[node].component.get_repair_status().silent for node in range(2, 6))
    network.run_for(300.0)
    assert nearest_m(network) > 1.0


def test_a_failed_medium_is_recognised_after_a_neighbour_died_while_the_antenna_was_off():
    network = star(second_relay=True)
    for node in range(2, 6):
        network.power(node, False)
    network.power(6, False)
    network.run_for(10.0)
    for node in range(2, 6):
        network.power(node, True)
    network.run_for(5.0)
    assert not any(6 in network.nodes[node].component.get_neighbours() for node in range(2, 6))
    network.air.carries = lambda _payload: False
    network.run_for(8.0)
    assert all(network.nodes[node].component.get_repair_status().silent for node in range(2, 6))


def test_what_a_stranger_says_of_the_gateways_internet_disconnects_nobody(network):
    routes = network.nodes[1].component.control.routes
    ahead = Beacon(0, (routes.number + 100) % 256, 1, 0, NO_ANCESTORS, 1.6, offline=True)
    say(network, 1, 77, ahead)
    for _ in range(20):
        network.run_for(0.5)
        assert network.connected(1)
        assert network.connected(2)


def test_a_search_is_not_repeated_further_than_any_node_would_ask_for(network):
    sent = []
    network.nodes[1].antenna.broadcast_message = sent.append
    body = Search(77, 1, 255).to_body()
    network.inject(1, messages.packet(MessageType.SEARCH, 99, 2, 1, BROADCAST, body))
    (repeated,) = [packet for packet in sent if messages.type_of(packet) == MessageType.SEARCH]
    assert Search.from_body(messages.body(repeated)).hops_left == 11


def test_with_a_key_an_order_that_a_dead_neighbour_did_not_take_goes_another_way_at_once():
    square = [(6.0 * (node % 3), 6.0 * (node // 3)) for node in range(9)]
    network = placed(square, seed=2, routing="beacon", radio="shared", rate="1M", key=KEY)
    network.run_for(30.0)
    for step, dead in enumerate((4, 5, 7, 1, 3)):
        network.power(dead, False)
        network.run_for(0.05)
        ordered_s = network.now_s()
        network.order(8, 12.0 + 0.5 * (step % 2), 12.0 + 0.3 * step, allow_shared_place=True)

        def arrived(since_s=ordered_s):
            return any(
                e.kind is MeshEventKind.FLIGHT_ORDERED and e.node == 8 and e.now_s >= since_s
                for e in network.events
            )

        assert network.run_until(arrived, within_s=1.5), f"the order while {dead} was off"
        network.power(dead, True)
        network.run_for(15.0)


def test_a_gateway_knows_when_it_heard_a_node_over_a_relay(network):
    network.send(2, 0, b"hello")
    network.run_for(2.0)
    (known,) = [node for node in network.nodes[0].component.get_known_nodes() if node.node_id == 2]
    assert network.now_s() - known.heard_s < 3.0


def test_a_gateway_whose_receiver_errs_a_little_is_not_told_anew_with_each_beacon(network):
    relay, sent = network.nodes[1], []
    relay.antenna.broadcast_message = sent.append
    for step in range(40):
        here = Location(0.2 * (step % 2), 0.0, 0.0)
        number = relay.component.control.routes.number + 1
        beacon = Beacon(0, number % 256, 0, NO_ROUTE, NO_ANCESTORS, 1.6, Motion(here, STILL))
        say(network, 1, 0, beacon)
        network.run_for(0.5)
    beacons = [
        Beacon.from_body(messages.body(packet), relay.drone.get_location()) for packet in sent
    ]
    told = sum(beacon.gateway_place is not None for beacon in beacons)
    assert len(beacons) >= 10
    assert told <= len(beacons) / 3


def test_the_origins_digest_and_the_gateways_place_take_turns(monkeypatch):
    monkeypatch.setattr(InProcessDrone, "frame_digest", lambda _engine: 0x1234)
    network = line()
    relay, sent = network.nodes[1], []
    relay.antenna.broadcast_message = sent.append
    network.run_for(60.0)
    beacons = [
        Beacon.from_body(messages.body(packet), relay.drone.get_location()) for packet in sent
    ]
    assert any(beacon.digest for beacon in beacons)
    assert any(beacon.gateway_place for beacon in beacons)
    assert not any(beacon.digest and beacon.gateway_place for beacon in beacons)


def test_a_node_without_beacons_that_leaves_has_not_fallen_silent(network):
    network.inject(2, messages.packet(MessageType.PROBE, 200, 200, 2, 2))
    network.run_for(1.0)
    network.power(1, False)
    for _ in range(20):
        network.run_for(1.0)
        assert not network.nodes[2].component.get_repair_status().silent


def test_a_drone_that_is_flown_while_the_internet_is_off_learns_whom_to_step_back_to():
    network = in_line(4, seed=1, routing="beacon")
    network.add_router(9, 3.0, 3.0)
    network.run_for(30.0)
    network.internet(0, False)
    network.run_for(5.0)
    start = (3.0, 3.0, 0.0)
    begin_s = network.now_s()
    way = leg_to(begin_s, begin_s + 60.0, start, (26.0, 3.0, 0.0))
    network.fly({9: Legs([rest(0.0, start, begin_s), way])})
    network.run_for(70.0)
    places = network.nodes[9].component.places
    assert not network.connected(9)
    assert places.good_id in (3, 4)
    assert places.connected_at.distance_m(network.location(9)) < 0.5


def test_a_list_of_nodes_that_nobody_hears_is_soon_forgotten(network):
    say(network, 0, 77, Beacon(0, 1, 1, 0, NO_ANCESTORS, 1.6, below=Below(100, (101, 102, 103))))
    network.run_for(2.0)
    network.send(2, 0, b"hello")
    network.run_for(20.0)
    known = {node.node_id for node in network.nodes[0].component.get_known_nodes()}
    assert known == {1, 2}


def test_a_packet_that_is_held_is_tried_again_in_time(network):
    router = network.nodes[2].component
    network.air.carries = lambda _payload: False
    assert router.control.delivery.send_own(messages.packet(MessageType.FOUND + 1, 2, 2, 99, 99))
    assert router.deadlines.at_s[Due.ROUTING] <= network.now_s() + 0.15 + 1e-9


def test_a_child_of_a_dead_relay_tells_of_its_new_parent_at_once():
    network = placed([(0.0, 0.0), (6.0, 2.0), (6.0, -2.0), (12.0, 0.0)], seed=1, routing="beacon")
    network.run_for(30.0)
    router = network.nodes[3].component
    parent = router.control.next_hop()
    network.power(parent, False)
    network.send(3, 0, b"hello")
    network.run_for(0.02)
    assert router.control.next_hop() == 3 - parent
    assert router.deadlines.at_s[Due.ROUTING] <= network.now_s() + 0.3
