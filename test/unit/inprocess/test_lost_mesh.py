"""What drones do whose mesh is lost: `lost_mesh`, and a battery that just reaches home."""

from __future__ import annotations

import itertools
import math

import pytest
from scenarios import events, flown

from drone_mesh.communication.interfaces import OrderState
from drone_mesh.communication.repair.options import LostMesh, RepairOptions
from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.communication.timing import Due
from drone_mesh.drone.battery import Battery, PowerModel
from drone_mesh.drone.fence import Fence, Zone
from drone_mesh.drone.location import Location
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.drone import PositionErrors

KEY = MeshKey(bytes(range(16)))
HIGH_M = 3.0
POSTS = [(20.0 + 5.0 * (n % 4), 5.0 * (n // 4)) for n in range(8)]
HOMES = [(2.0 * (n % 4), 2.0 * (n // 4)) for n in range(8)]


def hovering(mode, posts=POSTS, homes=HOMES, after_s=120.0, range_m=9.0, **options):
    """Gateway 0 beside the first post, and routers that hover on theirs; all connected."""
    chosen = RepairOptions(lost_mesh=mode, lost_mesh_after_s=after_s, range_m=range_m)
    network = Network(seed=1, repair_options=chosen, max_distance_m=range_m, **options)
    network.add_gateway(0, posts[0][0] - 3.0, posts[0][1])
    for node, ((x, y), home) in enumerate(zip(posts, homes), start=1):
        network.add_router(node, *home)
        network.nodes[node].drone.put(Location(y, x, HIGH_M))
    assert network.run_until(network.all_connected, within_s=60.0)
    network.run_for(30.0)  # all know where the others are
    return network


def charge(network, node, percent, hover_s=1200.0):
    battery = network.nodes[node].drone.battery = Battery(PowerModel(hover_s=hover_s))
    battery.use((100.0 - percent) / 100.0 * hover_s, 0.0)


def place(network, node):
    return network.location(node).to_vector()


def at(network, places, height_m):
    """The routers that are at these x and y, and so high."""
    return {
        node
        for node, (x, y) in enumerate(places, start=1)
        if math.dist(place(network, node), (x, y, height_m)) < 0.01
    }


def nearest_m(network, seconds, among):
    """How near any two of these drones come to each other."""
    until_s, least_m = network.now_s() + seconds, math.inf
    while network.now_s() < until_s:
        network.run_for(0.1)
        places = [place(network, node) for node in among]
        least_m = min(least_m, *itertools.starmap(math.dist, itertools.combinations(places, 2)))
    return least_m


def in_words(network, node):
    return network.nodes[node].component.get_repair_status().in_words(network.now_s())


@pytest.mark.parametrize(
    ("mode", "routing"),
    [*((mode, "child_table_tree") for mode in LostMesh), (LostMesh.RETURN, "beacon")],
)
def test_eight_drones_lose_their_gateway(mode, routing):
    network = hovering(mode, routing=routing)
    everybody, lost_s = set(network.nodes) - {0}, network.now_s()
    network.power(0, False)
    apart_m = nearest_m(network, 100.0, everybody)
    assert not at(network, HOMES, 0.0)
    apart_m = min(apart_m, nearest_m(network, 130.0, everybody))
    assert apart_m >= 1.0
    on_ground = {node for node in everybody if place(network, node)[2] == 0.0}
    is_home, stands = at(network, HOMES, 0.0), at(network, POSTS, HIGH_M)
    assert (
        tuple(who == everybody for who in (on_ground, is_home, stands))
        == {
            LostMesh.REPAIR: (False, False, False),
            LostMesh.HOLD: (False, False, True),
            LostMesh.RETURN: (True, True, False),
            LostMesh.LAND: (True, False, False),
        }[mode]
    )
    assert bool(flown(network)) is (mode is not LostMesh.HOLD)
    moved = len(events(network, "FLIGHT_DECIDED", since_s=lost_s))
    network.run_for(100.0)
    if mode is not LostMesh.REPAIR:  # nobody takes off again
        assert len(events(network, "FLIGHT_DECIDED", since_s=lost_s)) == moved


@pytest.mark.parametrize("percent", [90.0, 24.0])
def test_a_gateway_that_is_heard_on_the_way_ends_the_flight_home_unless_the_battery_is_low(percent):
    network = hovering(LostMesh.RETURN, POSTS[:2], HOMES[:2], range_m=50.0, repair="stay")
    charge(network, 1, percent)
    network.power(0, False)
    assert network.run_until(lambda: network.nodes[1].drone.path is not None, within_s=200.0)
    network.run_for(4.0)
    assert "flies home" in in_words(network, 1)
    network.power(0, True)
    network.run_for(40.0)
    assert network.all_connected()
    if percent < 50.0:
        assert place(network, 1) == (*HOMES[0], 0.0)
        return
    x, _y, height_m = place(network, 1)
    assert 3.0 < x < 18.0
    assert height_m == HIGH_M
    network.order(1, *POSTS[0], 3)
    network.run_for(30.0)
    assert place(network, 1) == (*POSTS[0], HIGH_M)
    (order,) = network.nodes[0].component.get_orders()
    assert order.state is OrderState.ARRIVED


@pytest.mark.parametrize("mode", LostMesh)
@pytest.mark.parametrize(
    ("percent", "hover_s", "lost", "goes"),
    [
        (27.0, 1200.0, True, False),
        (25.0, 1200.0, True, True),  # 10 s of flight, 30 s for others and 2 %, above 20 %
        (25.0, 1200.0, False, False),  # its gateway decides
        (20.7, 1200.0, True, None),  # it does not reach home, and lands where it is
    ],
)
def test_who_can_just_reach_home_goes_there(mode, percent, hover_s, lost, goes):
    network = hovering(mode, POSTS[:2], HOMES[:2], after_s=1000.0, repair="stay")
    charge(network, 1, percent, hover_s)
    network.power(0, not lost)
    network.run_for(29.0)
    assert place(network, 1) == (*POSTS[0], HIGH_M)
    network.run_for(60.0)
    lands_at = {True: (*HOMES[0], 0.0), None: (*POSTS[0], 0.0), False: (*POSTS[0], HIGH_M)}
    assert place(network, 1) == lands_at[goes]
    assert place(network, 2) == (*POSTS[1], HIGH_M)
    assert "just reaches home" in in_words(network, 1) or not goes


def test_a_battery_that_empties_fast_goes_home_sooner():
    network = hovering(LostMesh.HOLD, POSTS[:2], HOMES[:2])
    network.power(0, False)
    for seconds in range(0, 100, 5):  # 1 % in 3 s
        charge(network, 1, 60.0 - seconds / 3.0)
        network.run_for(5.0)
    assert place(network, 1) == (*HOMES[0], 0.0)


def test_a_flight_for_a_repair_ends_when_the_battery_just_reaches_home():
    network = hovering(LostMesh.REPAIR, [(40.0, 0.0)], [(44.0, 8.0)], repair="home")
    network.power(0, False)
    places = network.nodes[1].component.places
    places.update_gateway(Location(0.0, 0.0, 0.0), network.now_s())
    assert network.run_until(lambda: network.nodes[1].drone.path is not None, within_s=200.0)
    network.run_for(5.0)
    charge(network, 1, 24.0)
    network.run_for(60.0)
    assert place(network, 1) == (44.0, 8.0, 0.0)


@pytest.mark.parametrize("routing", ["child_table_tree", "beacon"])
@pytest.mark.parametrize(("cross", "at_once"), [(True, False), (False, True)])
def test_two_neighbours_return_at_the_same_time(cross, at_once, routing):
    homes = [(0.0, 4.0), (0.0, 0.0)][:: 1 if cross else -1]
    posts = [(20.0, 0.0), (20.0, 4.0)]
    network = hovering(LostMesh.RETURN, posts, homes, routing=routing, repair="stay")
    network.power(0, False)
    network.run_for(60.0)
    for node in (1, 2):
        deadlines = network.nodes[node].component.deadlines
        deadlines.set(Due.CHECK, network.now_s() + 5.0)
        network.nodes[node].plan()
    both_s, least_m = 0.0, math.inf
    for _ in range(1400):
        network.run_for(0.1)
        flying = [node for node in (1, 2) if network.nodes[node].drone.path is not None]
        far = all(math.dist(place(network, n)[:2], posts[n - 1]) > 1.0 for n in (1, 2))
        both_s += 0.1 * (len(flying) == 2 and far)
        least_m = min(least_m, math.dist(place(network, 1), place(network, 2)))
    assert least_m >= 1.0
    assert at(network, homes, 0.0) == {1, 2}
    assert (both_s > 3.0) is at_once


@pytest.mark.parametrize("key", [None, KEY])
@pytest.mark.parametrize("routing", ["child_table_tree", "beacon"])
def test_two_drones_with_the_same_home_land_beside_each_other(routing, key):
    network = hovering(
        LostMesh.RETURN, POSTS[:2], HOMES[:2], routing=routing, repair="stay", key=key
    )
    for node in (1, 2):
        network.nodes[node].drone.home_place = Location(0.0, 0.0, 0.0)
    network.power(0, False)
    assert nearest_m(network, 280.0, (1, 2)) >= 1.0
    assert len(at(network, [(0.0, 0.0)] * 2, 0.0)) == 1
    assert all(math.dist(place(network, node), (0.0, 0.0, 0.0)) < 1.2 for node in (1, 2))
    assert "has landed for good" in in_words(network, 1)


@pytest.mark.parametrize("pond_x_m", [8.0, 0.0])
def test_a_fence_that_changes_on_the_way_home_is_kept(pond_x_m):
    network = hovering(LostMesh.RETURN, POSTS[:2], HOMES[:2], range_m=50.0, repair="stay")
    network.power(0, False)
    assert network.run_until(lambda: place(network, 1)[0] < 17.0, within_s=200.0)
    pond = Fence.of([], [Zone.circle("pond", (pond_x_m, 0.0), 3.0, inside=False)])
    network.set_fence(pond)
    for _ in range(400):
        network.run_for(0.25)
        assert not any(pond.why_not(place(network, node)) for node in (1, 2))
    assert at(network, HOMES[:2], 0.0) == ({1, 2} if pond_x_m else set())
    assert pond_x_m or "fence pond" in in_words(network, 1)


def test_whoever_has_the_drone_keeps_it_and_it_returns_when_it_may():
    network = hovering(LostMesh.RETURN, POSTS[:2], HOMES[:2], repair="stay")
    drone = network.nodes[1].drone
    drone._why_not_fly = "in LOITER, flown by its pilot"
    network.power(0, False)
    network.run_for(300.0)
    assert place(network, 1) == (*POSTS[0], HIGH_M)
    assert "in LOITER, flown by its pilot" in in_words(network, 1)
    drone._why_not_fly = ""
    network.run_for(60.0)
    assert place(network, 1) == (*HOMES[0], 0.0)


@pytest.mark.parametrize("positions", [None, PositionErrors(sigma_m=0.2)])
def test_an_order_under_way_is_finished_first(positions):
    errors = {} if positions is None else {"positions": positions}
    network = hovering(LostMesh.RETURN, POSTS[:2], HOMES[:2], after_s=1.0, **errors)
    network.order(1, 60.0, 0.0, 3)
    network.run_for(4.0)
    network.power(0, False)
    network.run_for(18.0)
    assert place(network, 1) == (60.0, 0.0, 3.0)
    network.run_for(60.0)
    assert math.dist(place(network, 1), (*HOMES[0], 0.0)) < 1.5


def test_nobody_keeps_a_drone_in_the_air_by_claiming_to_fly_in_its_way():
    """A captured node, or any without a key; once its battery just reaches home, it flies on."""
    network = hovering(LostMesh.RETURN, POSTS[:2], HOMES[:2], repair="stay")
    drone, component = network.nodes[2].drone, network.nodes[2].component
    network.power(1, False)
    network.power(0, False)
    charge(network, 2, 40.0)
    assert network.run_until(lambda: drone.path is not None, within_s=300.0)
    to_13_0 = bytes.fromhex("0101 02 02fe 00000000 00005041 0180").ljust(32, b"\0")
    waits_s = 0
    for seconds in range(400):
        charge(network, 2, 40.0 - 0.1 * seconds)
        component.on_msg(to_13_0, network.now_s())
        network.run_for(1.0)
        waits_s += drone.path is None and drone.get_location().height > 0.0
    assert waits_s > 60
    assert place(network, 2) == (*HOMES[1], 0.0)
    assert drone.battery.percent > 0.0
