"""Each repair strategy keeps what it promises, in whole networks."""

from __future__ import annotations

import itertools
import math
import random
from collections import Counter

import pytest
from scenarios import LAYOUTS, events, fleet, flown, layout, line, outage, placed, run_until

from drone_mesh.communication.repair.interfaces import IRepairStrategy, Step
from drone_mesh.communication.repair.strategies import (
    REPAIR_STRATEGIES,
    Stay,
)
from drone_mesh.communication.routing.child_table_tree import ChildTableTree
from drone_mesh.communication.wire.messages import GoToLocationMessage
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.network import IDEAL_FIEDLER, ORACLE
from drone_mesh.lab.metrics.harm import harm
from drone_mesh.lab.sequence import run_sequence
from drone_mesh.nrf24.emulator.space import Noise
from drone_mesh.nrf24.registers import NS_PER_S
from drone_mesh.nrf24.settings import RadioSettings

FLYING = sorted(set(REPAIR_STRATEGIES) - {"stay"}) + [ORACLE, IDEAL_FIEDLER]
RANGE_M = 9.0


def broken_line(repair, routing="child_table_tree"):
    """Gateway 0, routers 1, 2, 3 in a line; 2 dies, and 3 is cut off."""
    network = line(3, spacing=8.0, repair=repair, routing=routing)
    network.run_for(20.0)
    network.power(2, False)
    assert run_until(network, lambda: not network.connected(3), within_s=30.0, step_s=1.0)
    return network


def order_from(sender, to, latitude):
    return GoToLocationMessage(0, sender, to, to, latitude, 0.0, 0).to_payload()


def start_of(case, node):
    """Where a layout puts a drone."""
    return {other: goal for other, goal in LAYOUTS.orders(case)}[node]


@pytest.mark.parametrize("routing", ["child_table_tree", "beacon"])
@pytest.mark.parametrize("repair", FLYING)
def test_a_drone_that_is_cut_off_flies_and_is_connected(repair, routing):
    network = broken_line(repair, routing)
    assert run_until(network, network.all_connected, within_s=180.0)
    assert flown(network) == {3}


class ToNowhere(IRepairStrategy):
    def on_emergency(self):
        self.mesh.fly(Step(Location(math.nan, 0.0, 0.0)))


@pytest.mark.timeout(30)
def test_a_strategy_that_names_no_place_sends_its_drone_nowhere_and_says_so():
    network = broken_line(ToNowhere)
    network.run_for(60.0)
    assert flown(network) == set()
    status = network.nodes[3].component.get_repair_status()
    assert status.reason == "its strategy names no place to fly to"


# test_sequences.py has a hundred sequences of `thesis`.
@pytest.mark.parametrize("repair", [name for name in FLYING if name != "thesis"])
def test_no_drone_is_harmed_in_sequences_of_faults(repair):
    harmed = [number for number in range(8) if harm(run_sequence(number, repair, largest=12))]
    assert harmed == []


def test_with_stay_no_drone_flies():
    network = broken_line("stay")
    network.run_for(300.0)
    assert flown(network) == set()
    assert not network.connected(3)
    assert network.status().repair_strategy == "stay"
    sentence = network.status().nodes[3].repair
    assert sentence == "waits for a gateway; does not fly: its strategy never flies"


def test_with_home_a_drone_flies_no_farther_than_it_needs_to_be_connected():
    network = broken_line("home")
    assert run_until(network, network.all_connected, within_s=120.0)
    network.run_for(30.0)
    assert 9.0 < network.location(3).longitude < 8.0 + RANGE_M


def test_with_nearest_the_drone_with_the_shortest_flight_flies():
    network = layout(202, repair="nearest")
    network.run_for(20.0)
    network.power(2, False)
    assert run_until(network, lambda: not network.connected(3), within_s=30.0, step_s=1.0)
    assert run_until(network, network.all_connected, within_s=120.0)
    two = start_of(202, 2)
    distances = {n: start_of(202, n).distance_m(two) for n in (3, 4, 5)}
    assert flown(network) == {min(distances, key=distances.get)}


def test_with_inward_no_drone_moves_more_than_half_the_range_at_once():
    network = broken_line("inward")
    before = network.location(3)
    while not network.connected(3) or network.nodes[3].drone.path is not None:
        network.run_for(0.5)
        if any(kind == "LANDED" for kind in _kinds(network, 3)):
            break
    network.run_for(1.0)
    assert 0.0 < network.location(3).distance_m(before) <= RANGE_M / 2 + 0.1


def test_with_follow_no_link_inside_the_moving_part_is_lost():
    network = line(5, spacing=8.0, repair="follow")
    network.run_for(20.0)
    network.power(1, False)
    assert run_until(network, lambda: not network.connected(5), within_s=30.0, step_s=1.0)
    assert run_until(network, network.all_connected, within_s=180.0)
    network.run_for(30.0)
    for one, other in ((2, 3), (3, 4), (4, 5)):
        assert network.location(one).distance_m(network.location(other)) < RANGE_M
    assert max(at_s for at_s, _n, _p in events(network, "FLIGHT_DECIDED")) < 90.0  # as one part


def alone_among_the_dead(repair):
    """The neighbours 2 and 3 of router 4 die together; router 1 is in reach of their places."""
    places = [(0.0, 0.0), (8.0, 0.0), (15.0, 2.0), (15.0, -2.0), (23.0, 0.0)]
    network = placed(places, repair=repair)
    network.run_for(20.0)
    for node in (2, 3):
        network.power(node, False)
    return network


@pytest.mark.parametrize("repair", ["thesis", "nearest", "follow"])
def test_a_drone_whose_neighbours_all_died_looks_around_early_and_stays_connected(repair):
    network = alone_among_the_dead(repair)
    assert run_until(network, network.all_connected, within_s=70.0, step_s=1.0)
    network.run_for(60.0)
    assert network.all_connected()
    assert len(events(network, "FLIGHT_DECIDED")) == 1


@pytest.mark.parametrize("silence_s", [45.0, 52.0, 120.0, 600.0])
def test_all_drones_are_back_at_their_places_after_a_silence(silence_s):
    """At 45 and 52 s some are on their way, and some listen."""
    network = fleet(8, 3)
    network.run_for(30.0)
    before = {node: network.location(node) for node in network.nodes}
    outage(network, silence_s)
    assert flown(network) != set()
    assert network.run_until(network.all_connected, within_s=20.0)
    network.run_for(20.0)
    assert {n for n, at in before.items() if network.location(n).distance_m(at) > 0.1} == set()
    flights = Counter(node for _at_s, node, _to in events(network, "FLIGHT_DECIDED"))
    assert set(flights.values()) <= ({2, 4, 6} if silence_s >= 300.0 else {2})  # there and back


def test_while_their_channel_is_jammed_no_drone_moves():
    network = fleet(8, 3)
    network.run_for(30.0)
    network.air.jammed = True
    network.run_for(600.0)
    assert not network.connected(8)
    assert "its channel is jammed" in network.status().nodes[8].repair
    assert network.status().nodes[8].jammed
    network.air.jammed = False
    assert network.run_until(network.all_connected, within_s=20.0)
    assert not network.status().nodes[8].jammed
    assert flown(network) == set()


@pytest.mark.parametrize("radio", ["shared", "chips"])
def test_a_carrier_is_measured_as_power_and_no_drone_moves(radio):
    network = Network(radio=radio, rate="1M")
    network.add_fleet(1, 4, 2, 6.0)
    assert network.run_until(network.all_connected, within_s=60.0)
    mhz = 2400 + RadioSettings().channel
    jammer = Noise((3.0, 3.0, 0.0), 20.0, random.Random(1), centre_mhz=mhz)
    network.air.space.noises.append(jammer)
    network.run_for(200.0)
    assert not network.connected(4)
    assert flown(network) == set()
    assert "its channel is jammed" in network.status().nodes[4].repair
    jammer.stop(round(network.now_s() * NS_PER_S))
    assert network.run_until(network.all_connected, within_s=60.0)
    assert flown(network) == set()
    network.stop()


def test_an_order_during_a_look_around_is_flown():
    network = alone_among_the_dead("thesis")
    assert run_until(network, lambda: flown(network) == {4}, within_s=60.0, step_s=0.5)
    network.nodes[4].component.on_msg(order_from(1, to=4, latitude=40.0), network.clock.now_s)
    network.nodes[4].plan()
    for node in (2, 3):
        network.power(node, True)
    ordered = pytest.approx(40.0)
    assert run_until(network, lambda: network.location(4).latitude == ordered, within_s=60.0)


DUMBBELL = [(0.0, 0.0), (0.0, 5.0), (-4.0, 2.5), (7.5, 2.5), (15.0, 0.0), (15.0, 5.0), (19.0, 2.5)]
BRIDGE, RIGHT = 3, {4, 5, 6}


@pytest.mark.parametrize("repair", ["virtual_spring", "fiedler", IDEAL_FIEDLER])
def test_the_part_of_a_dumbbell_without_the_gateway_flies_to_the_other_and_none_lands_on_another(
    repair,
):
    network = placed(DUMBBELL, repair=repair, routing="beacon")
    network.run_for(20.0)
    network.power(BRIDGE, False)
    network.run_for(5.0)
    assert run_until(network, network.all_connected, within_s=60.0)
    network.run_for(60.0)
    assert network.all_connected()
    assert flown(network) <= RIGHT  # the published controllers move all, the router forbids it
    ends = [network.location(node) for node in network.nodes]
    assert min(a.distance_m(b) for a, b in itertools.combinations(ends, 2)) >= 1.0


@pytest.mark.parametrize("repair", ["field", "virtual_spring", "fiedler"])
def test_leg_follows_leg_without_another_wait(repair):
    network = line(3, spacing=8.0, repair=repair, routing="beacon")
    network.run_for(20.0)
    network.power(2, False)
    assert run_until(network, lambda: len(events(network, "LANDED")) == 2, 30.0, step_s=1.0)


@pytest.mark.parametrize("repair", ["virtual_spring", "fiedler"])
def test_drones_whose_gateway_stays_off_come_to_rest(repair):
    network = fleet(8, 3, repair=repair)
    network.run_for(20.0)
    network.power(0, False)
    network.run_for(600.0)
    assert flown(network) != set()
    resting_s = network.now_s()
    network.run_for(1200.0)
    tries = events(network, "FLIGHT_DECIDED", since_s=resting_s)
    assert len(tries) <= 2  # with `nearest`, too, one tries the gateway's place again now and then


def test_a_network_takes_the_classes_of_a_technique_and_of_a_strategy():
    network = line(1, spacing=5.0, routing=ChildTableTree, repair=Stay)
    assert run_until(network, network.all_connected, within_s=15.0)
    status = network.status()
    assert (status.routing, status.repair_strategy) == ("ChildTableTree", "Stay")


@pytest.mark.parametrize(
    ("parts", "why"),
    [
        ({"routing": Stay}, "routing technique 'Stay' is not an ITechnique"),
        ({"repair": ChildTableTree}, "repair strategy 'ChildTableTree' is not an IRepairStrategy"),
        ({"routing": ChildTableTree()}, "'ChildTableTree' object is not callable"),
        ({"repair": IRepairStrategy}, "'IRepairStrategy' cannot be created without arguments"),
        ({"repair": None}, "unknown repair strategy 'None': use one of .*, field"),
    ],
)
def test_what_is_no_class_of_a_part_is_refused_in_one_sentence(parts, why):
    with pytest.raises(ConfigurationError, match=why) as caught:
        Network(**parts)
    assert "\n" not in str(caught.value)


def _kinds(network, node):
    return [event.kind.name for event in network.events if event.node == node]
