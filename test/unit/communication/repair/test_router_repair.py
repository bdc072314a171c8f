"""What a router does about a lost connection: wait, negotiate, fly back."""

from __future__ import annotations

import itertools
import math
import struct

import pytest
from rig import FROM_0, Rig, packet

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.election import HOME_FAILED, TOOK_OFF, TOOK_OFF_HOME
from drone_mesh.communication.repair.interfaces import IRepairStrategy
from drone_mesh.communication.repair.options import LostPlace, RepairOptions
from drone_mesh.communication.repair.spots import Landing, own_spot, spot_beside_rivals
from drone_mesh.communication.repair.strategies import (
    REPAIR_STRATEGIES,
    Thesis,
    create_repair_strategy,
)
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.communication.wire.messages import GatewayPlace
from drone_mesh.drone.location import Location

LOCATION, REQUEST, PRESENT, HEARTBEAT, MISSING, BID, LAST_PLACE = 1, 2, 3, 4, 5, 7, 69
GATEWAY_AT_0_4 = "00 00 01 01 01 00 00 80 40"  # latitude 4
BESIDE_GATEWAY = Location(pytest.approx(5.1), pytest.approx(0.0), 0.0)  # coming from the north
A_LEG_FROM_12 = Location(pytest.approx(6.0), pytest.approx(0.0), 0.0)  # 6 m towards the gateway
NEIGHBOUR_2_AT_0_8 = "02 02 01 01 01 00 00 00 41"  # latitude 8
NEIGHBOUR_PLACE = Location(8.0, 0.0, 0.0)
# 1.1 clearances away, across the line to the gateway: so no link gets much longer
BESIDE_NEIGHBOUR = Location(pytest.approx(8.0), pytest.approx(-1.1), 0.0)
FROM_12 = "00 00 40 41 00 00 00 00 01 00"  # the place of the node that asks: latitude 12


EMERGENCY_S = 45.0
FIRST_EMERGENCY_S = 155.0  # of a router that was never connected
BIDS_S = EMERGENCY_S + 1.1  # the neighbours had their time to say where they are
TO_DECISION_S = 0.5  # from then on; bids of nodes farther away may still come


def bid(neighbour: int, score: float) -> str:
    return bytes((neighbour, neighbour, BID, 1, 1)).hex() + struct.pack("<f", score).hex()


def place(node: int, latitude: float, longitude: float = 0.0) -> str:
    """`node` reports its place."""
    return bytes((node, node, 1, 1, 1)).hex() + struct.pack("<ff", latitude, longitude).hex()


def own_bid(to: int, score: float) -> bytes:
    return (bytes((1, 1, BID, to, to)) + struct.pack("<f", score)).ljust(32, b"\0")


TWO_AT_8 = "02 02 01 01 01 00 00 00 41 00 00 00 00"  # node 2: latitude 8; a height follows
UNDERGROUND = "02 02 01 01 01 00 00 00 41 00 00 00 00 f5 ff"  # node 2: height -11 m


def connected_rig(latitude=0.0):
    """A router there, connected through 2."""
    rig = Rig()
    rig.engine.place = Location(latitude, 0.0, 0.0)
    rig.connect_through(2)
    return rig


def lone_rig(options=None, timing=None, repair=None, heard=()):
    """Connected through 2 to gateway 0, whose place is (0, 4); 2 stands at (0, 8). Then 2 dies.

    Before that it hears the packets `heard`.

    The check at 5 s notices, the one at 15 s starts the timer, that at EMERGENCY_S acts.
    """
    rig = Rig(timing=timing, options=options, repair=repair)
    rig.engine.place = Location(12.0, 0.0, 0.0)
    rig.connect_through(2)
    rig.hear("00 02 01 01 01 00 00 80 40", NEIGHBOUR_2_AT_0_8)
    assert rig.mesh.get_last_good_known_location_id() == 2
    rig.hear(*heard)
    rig.antenna.dead = {2}
    return rig


def group_rig(*neighbours, timing=None):
    """As above, and among unconnected neighbours that live on."""
    rig = lone_rig(timing=timing)
    rig.know_neighbour(*neighbours)
    return rig


def bidding_rig(*neighbours):
    """As above, when the bids have been sent."""
    rig = group_rig(*neighbours)
    rig.wait_until(BIDS_S)
    return rig


def decide(rig, *bids):
    """These bids are the last ones that are waited for."""
    rig.hear(*bids)
    rig.wait(TO_DECISION_S)


def fly(rig, place):
    """One second of flight."""
    rig.engine.place = place
    rig.wait(1.0)


# The place to step back to -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("heard", "node"), [([NEIGHBOUR_2_AT_0_8, "00 02 01 01 01 00 00 80 40"], 2), ([], 255)]
)
def test_the_place_of_the_next_hop_is_the_one_to_step_back_to(heard, node):
    rig = connected_rig()
    rig.hear(*heard)
    assert rig.mesh.get_last_good_known_location_id() == node


def test_where_the_next_hop_flies_to_is_no_place_to_step_back_to_and_kept_clear_of():
    rig = connected_rig()
    rig.hear(NEIGHBOUR_2_AT_0_8, "02 02 01 01 01 00 00 70 41 00 00 00 00 00 00 00 00 00 80")
    assert rig.mesh.places.good == Location(8.0, 0.0, 0.0)
    assert rig.mesh._neighbours.place_of(2).place == Location(15.0, 0.0, 0.0)


def test_a_goal_farther_away_than_the_next_hop_can_stand_is_no_wrong_place():
    rig = connected_rig()
    rig.hear("02 02 01 01 01 00 00 c8 42 00 00 00 00 00 00 00 00 00 80")  # 100 m to the north
    assert rig.mesh._neighbours.place_of(2).place == Location(100.0, 0.0, 0.0)
    assert not rig.mesh.complaints.counts


def test_a_gateway_that_is_the_next_hop_is_followed_to_where_it_flies(rig):
    rig.connect_to_gateway()
    rig.hear(GATEWAY_AT_0_4)
    assert rig.mesh.get_last_good_known_location_id() == 0
    rig.hear("00 00 01 01 01 00 00 c0 40 00 00 00 00 00 00 00 00 00 80")
    assert rig.mesh.places.gateway == rig.mesh.places.good == Location(6.0, 0.0, 0.0)


def test_a_drone_in_flight_answers_with_its_goal_and_says_so(rig):
    rig.know_neighbour(5)
    rig.hear("00 05 06 01 01 00 00 80 3f 00 00 00 c0 07 00")
    rig.antenna.taken.clear()
    rig.hear("05 05 02 01 01")
    (answer,) = rig.sent(LOCATION)
    assert answer[:15] == bytes.fromhex("01 01 01 05 05 00 00 80 3f 00 00 00 c0 07 00")
    assert answer[18] & 0x80
    fly(rig, Location(1.0, -2.0, 7))
    rig.antenna.taken.clear()
    rig.hear("05 05 02 01 01")
    (answer,) = rig.sent(LOCATION)
    assert not answer[18] & 0x80


def test_where_others_saw_a_drone_in_flight_does_not_replace_the_goal_that_it_told(rig):
    rig.hear("06 06 02 01 fe 00 00 00 41 00 00 00 00 01 80")  # flies to latitude 8
    rig.hear("05 05 45 01 01 00 00 06 00 00 80 40 00 00 00 00 04 00")  # was at latitude 4, 4 m up
    assert rig.mesh._neighbours.place_of(6).place == Location(8.0, 0.0, 0.0)


# Flight --------------------------------------------------------------------------------------


def test_an_order_is_flown_and_ends_the_connection():
    rig = connected_rig()
    rig.hear(GATEWAY_AT_0_4, NEIGHBOUR_2_AT_0_8, "00 02 06 01 01 00 00 80 3f 00 00 00 c0 07 00")
    assert rig.engine.goals == [Location(1.0, -2.0, 7)]
    assert not rig.mesh.get_connected_to_gateway()
    assert rig.mesh.get_hops_from_gateway_away() == 255
    assert rig.mesh.get_last_good_known_location_id() == 0
    assert "FLIGHT_ORDERED" in rig.kinds()


def test_a_drone_that_knows_no_gateway_location_has_no_place_to_step_back_to_after_an_order(rig):
    rig.hear(NEIGHBOUR_2_AT_0_8, "02 02 06 01 01 00 00 80 3f")
    assert rig.mesh.get_last_good_known_location_id() == 255


def test_an_ordered_flight_keeps_the_routes_until_the_landing():
    rig = connected_rig()
    rig.hear("00 02 06 01 01 00 00 a0 41")
    for latitude in (1.0, 8.0, 15.0):
        fly(rig, Location(latitude, 0.0, 0.0))
        assert rig.routing.get_set_of_children() == {2}
    fly(rig, Location(20.0, 0.0, 0.0))
    assert rig.routing.empty()
    assert rig.mesh.get_neighbours() == {}


def test_a_flight_of_a_quarter_of_the_range_keeps_the_connection_and_the_routes():
    rig = connected_rig()
    rig.hear(NEIGHBOUR_2_AT_0_8, "00 02 06 01 01 00 00 10 40")  # latitude 2.25
    assert rig.mesh.get_connected_to_gateway()
    fly(rig, Location(1.0, 0.0, 0.0))
    fly(rig, Location(2.25, 0.0, 0.0))
    assert "LANDED" in rig.kinds()
    assert rig.mesh.get_hops_from_gateway_away() == 2
    assert rig.mesh.get_last_good_known_location_id() == 2
    assert rig.routing.get_direction_to_node(0) == 2


def test_after_a_short_flight_it_looks_for_others_and_loses_those_left_behind(rig):
    rig.know_neighbour(3)
    rig.connect_through(2)
    rig.hear("00 02 06 01 01 00 00 00 40")  # latitude 2
    rig.antenna.dead = {3}
    fly(rig, Location(1.9, 0.0, 0.0))
    fly(rig, Location(2.0, 0.0, 0.0))
    goal = packet("01 01 01 fe fe 00 00 00 40 00 00 00 00 00 00 00 00 00 80")
    assert rig.broadcasts() == [goal, goal, packet("01 01 03 fe fe 02 01")]
    assert rig.routing.get_set_of_children() == {2}
    assert rig.sent(MISSING) == [packet("01 01 05 02 02 03")]


def test_several_orders_in_one_flight_count_from_where_it_began():
    rig = connected_rig()
    rig.hear("00 02 06 01 01 00 00 00 40")  # latitude 2
    fly(rig, Location(1.9, 0.0, 0.0))
    assert rig.mesh.get_connected_to_gateway()
    rig.hear("00 02 06 01 01 00 00 80 40")  # latitude 4
    assert not rig.mesh.get_connected_to_gateway()


def test_a_router_without_a_gateway_forgets_its_routes_after_a_short_flight_too(rig):
    rig.know_neighbour(2)
    rig.hear("02 02 06 01 01 00 00 00 40")
    fly(rig, Location(2.0, 0.0, 0.0))
    assert rig.routing.empty()


@pytest.mark.parametrize(
    "latitudes",
    [[2.0, 10.0, 19.89, 19.91], [7.0, 7.5, 7.5], [0.0] * 9 + [2.0, 20.0]],
    ids=["within a tenth of a metre of the goal", "it no longer moves", "once it had begun"],
)
def test_a_drone_introduces_itself_as_soon_as_it_has_landed(latitudes):
    rig = connected_rig()
    rig.hear("00 02 06 01 01 00 00 a0 41")
    for latitude in latitudes:
        assert "LANDED" not in rig.kinds()
        rig.forget()
        fly(rig, Location(latitude, 0.0, 0.0))
    assert "LANDED" in rig.kinds()
    assert rig.broadcasts() == [packet("01 01 03 fe fe ff 00")]


def test_a_flight_that_goes_on_to_another_goal_is_not_over_at_the_first_one(rig):
    rig.hear("02 02 06 01 01 00 00 a0 41")
    fly(rig, Location(19.0, 0.0, 0.0))
    rig.hear("02 02 06 01 01 00 00 20 41")  # back to latitude 10, which the engine hears late
    for latitude in (20.0, 20.0, 20.0, 19.0):
        fly(rig, Location(latitude, 0.0, 0.0))
    assert "LANDED" not in rig.kinds()
    fly(rig, Location(10.0, 0.0, 0.0))
    assert "LANDED" in rig.kinds()


@pytest.mark.parametrize(
    ("goal", "distance_m"), [("00 00 00 40", 2.0), ("00 00 a0 41", 20.0), ("00 00 fa 43", 500.0)]
)
def test_a_drone_that_does_not_set_out_in_a_time_that_fits_the_distance_has_landed(
    rig, goal, distance_m
):
    rig.hear(f"02 02 06 01 01 {goal}")
    gone_s = 10.0 + min(distance_m / 2.0, 10.0)
    rig.wait_until(gone_s - 0.5)
    assert "LANDED" not in rig.kinds()
    rig.wait_until(gone_s + 0.5)
    assert "LANDED" in rig.kinds()


@pytest.mark.parametrize(
    ("trouble", "within_s"), [({"grounded": "battery empty"}, 2.0), ({"place": None}, 30.0)]
)
def test_a_drone_that_cannot_fly_or_say_where_it_is_does_not_fly_for_ever(rig, trouble, within_s):
    rig.hear("02 02 06 01 01 00 00 a0 41")
    vars(rig.engine).update(trouble)
    rig.wait(within_s)
    assert "LANDED" in rig.kinds()


@pytest.mark.parametrize("begins_s", [1.0, 5.0])
def test_an_engine_that_says_whether_it_flies_ends_the_flight_once_it_has_begun(rig, begins_s):
    rig.engine.is_flying = lambda: rig.now_s >= begins_s
    rig.hear("02 02 06 01 01 00 00 a0 41")
    rig.wait_until(8.0)
    assert "LANDED" not in rig.kinds()
    rig.engine.is_flying = lambda: False
    rig.wait_until(9.0)
    assert "LANDED" in rig.kinds()


def test_it_asks_for_its_position_once_a_second_and_not_before(rig):
    rig.hear("02 02 06 01 01")  # where it stands
    rig.wait(0.9)
    assert "LANDED" not in rig.kinds()
    rig.wait(0.2)
    assert "LANDED" in rig.kinds()


def test_a_flight_is_not_turned_round_however_long_it_takes():
    rig = lone_rig()
    rig.hear("00 02 06 01 01 00 00 fa 43")  # 500 m away: no node there
    assert len(rig.engine.goals) == 1
    for second in range(250):
        fly(rig, Location(2.0 * second, 0.0, 0.0))
    assert len(rig.engine.goals) == 1
    assert rig.sent(MISSING) == []


def test_after_the_landing_the_time_without_a_gateway_counts_from_the_next_check(rig):
    rig.connect_to_gateway()
    rig.hear(GATEWAY_AT_0_4, "00 00 06 01 01 00 00 a0 41")
    for second in range(52):
        fly(rig, Location(second / 3, 0.0, 0.0))
    fly(rig, Location(20.0, 0.0, 0.0))  # at 53 s; checks at 55, 65, 75 and 85 s
    rig.wait_until(84.9)
    assert len(rig.engine.goals) == 1
    rig.wait_until(85.1)
    assert rig.engine.goals[1:] == [Location(pytest.approx(14.0), pytest.approx(0.0), 0.0)]


def test_an_order_ends_the_time_without_a_gateway():
    rig = lone_rig()
    rig.wait_until(30.0)  # the timer runs since 15 s
    rig.hear("09 03 06 01 01 00 00 a0 41")
    rig.antenna.dead = {2, 3, 9}
    fly(rig, Location(16.0, 0.0, 0.0))
    rig.hear(bid(3, 1.0))
    assert rig.sent(BID) == []
    fly(rig, Location(20.0, 0.0, 0.0))
    rig.wait_until(64.9)  # it runs again from the check at 35 s
    assert len(rig.engine.goals) == 1
    rig.wait_until(65.1)
    assert len(rig.engine.goals) == 2


@pytest.mark.parametrize(
    ("other", "goals"),
    [
        ("09 03 06 01 01 00 00 a0 41", [Location(20.0, 0.0, 0)]),
        ("07 02 06 01 01 00 00 a0 41", [Location(20.0, 0.0, 0)]),
        ("00 02 06 01 01 00 00 80 3f", [Location(20.0, 0.0, 0), Location(1.0, 0.0, 0)]),
    ],
)
def test_the_same_order_in_flight_is_no_new_one_and_another_replaces_the_first(rig, other, goals):
    rig.hear("00 02 06 01 01 00 00 a0 41", other)
    assert rig.engine.goals == goals
    assert rig.kinds().count("FLIGHT_ORDERED") == len(goals)


def test_a_drone_that_cannot_say_where_it_is_now_and_then_flies_on(rig):
    rig.hear("02 02 06 01 01 00 00 fa 43")
    for second in range(30):
        fly(rig, Location(2.0 * second, 0.0, 0.0) if second % 3 == 0 else None)
    assert "LANDED" not in rig.kinds()


def test_a_heartbeat_answered_in_flight_no_longer_counts_after_the_landing():
    rig = connected_rig()
    rig.hear("00 02 06 01 01 00 00 a0 41", "00 02 04 01 01 01 00 01")
    assert rig.mesh.get_connected_to_gateway()
    fly(rig, Location(20.0, 0.0, 0.0))
    assert "LANDED" in rig.kinds()
    assert not rig.mesh.get_connected_to_gateway()


# Lost connection -----------------------------------------------------------------------------


def test_a_lost_gateway_is_dropped_and_the_neighbours_are_informed():
    rig = connected_rig()
    rig.routing.other_can_communicate_with_node(3, 0)
    rig.mesh.control.send_heartbeat(0)
    rig.wait_until(4.9)
    rig.forget()
    assert rig.mesh.get_hops_from_gateway_away() == 2
    rig.wait_until(5.1)
    assert rig.mesh.get_hops_from_gateway_away() == 255
    assert rig.mesh.get_route_to_gateway() == NO_ROUTE
    assert rig.sent(MISSING) == [packet("01 01 05 02 02 00"), packet("01 01 05 03 03 00")]
    assert rig.routing.get_set_of_children() == {2, 3}


def test_a_router_that_never_knew_a_gateway_has_none_to_drop(rig):
    rig.know_neighbour(2)
    rig.wait_until(6.0)
    assert rig.sent(MISSING) == []


@pytest.mark.parametrize(
    ("timing", "flies_at_s"),
    [
        (MeshTiming(), 35.0),  # the check at 5 s finds it lost
        (MeshTiming(check_period_s=2.0), 31.0),
        (MeshTiming(connection_lost_after_s=5.0), 15.0),
        (MeshTiming(connection_lost_after_s=31.0), 45.0),
    ],
)
def test_the_emergency_comes_at_the_first_check_when_the_time_has_run_out(timing, flies_at_s):
    rig = Rig(timing=timing)
    rig.connect_through(2)
    rig.hear(NEIGHBOUR_2_AT_0_8)
    rig.mesh.control.send_heartbeat(0)  # never answered
    rig.wait_until(0.9)
    rig.antenna.dead = {2}
    rig.wait_until(flies_at_s - 0.1)
    assert rig.engine.goals == []
    rig.wait_until(flies_at_s + 0.1)
    assert len(rig.engine.goals) == 1


def test_the_timer_is_off_when_a_gateway_answers():
    rig = lone_rig()
    rig.wait_until(34.0)
    assert not rig.mesh.get_connected_to_gateway()
    rig.hear("00 03 04 01 01 01 00 04")
    rig.mesh.control.send_heartbeat(0)  # taken, but never answered
    rig.wait_until(44.9)  # lost again at the check at 35 s
    rig.antenna.dead = {2, 3}
    rig.wait_until(64.9)
    assert rig.engine.goals == []
    rig.wait_until(65.1)
    assert len(rig.engine.goals) == 1


# Emergency without neighbours ----------------------------------------------------------------


def test_a_router_without_neighbours_flies_to_the_place_to_step_back_to():
    rig = lone_rig()
    rig.wait_until(60.0)
    assert rig.engine.goals[:1] == [BESIDE_NEIGHBOUR]
    assert rig.kinds().count("EMERGENCY") == 1
    assert rig.mesh.get_last_good_known_location_id() == 0


def test_a_router_whose_neighbour_was_seen_to_move_waits_three_times_as_long():
    rig = lone_rig(heard=[place(2, 9.5), place(2, 7.0)])
    rig.wait_until(104.0)
    assert rig.engine.goals == []
    rig.wait_until(106.0)
    assert len(rig.engine.goals) == 1


@pytest.mark.parametrize("of_the_next_hop", [[], [NEIGHBOUR_2_AT_0_8, UNDERGROUND]])
def test_a_router_that_knows_no_other_place_to_fly_to_flies_to_the_gateway(of_the_next_hop):
    rig = connected_rig(12.0)
    rig.hear("00 02 01 01 01 00 00 80 40", *of_the_next_hop)
    assert rig.mesh.get_last_good_known_location_id() == (2 if of_the_next_hop else 255)
    rig.antenna.dead = {2}
    rig.wait_until(60.0)
    assert rig.engine.goals[:1] == [A_LEG_FROM_12]


def goals_of_one_that_hears_nobody(rig):
    """Beside the lost node, back to where it stood, and towards the gateway."""
    rig.wait_until(46.0)
    fly(rig, rig.engine.goals[-1])
    rig.wait(3.0)
    fly(rig, rig.engine.goals[-1])
    rig.wait_until(130.0)
    return rig.engine.goals[:3]


def test_after_one_step_back_the_next_one_is_to_the_gateway():
    step_back, start, home = goals_of_one_that_hears_nobody(lone_rig())
    assert step_back == BESIDE_NEIGHBOUR
    assert start == Location(12.0, 0.0, 0.0)  # it hears no node where it is now
    assert home == A_LEG_FROM_12


@pytest.mark.parametrize(
    ("hindrance", "why"),
    [("kept_by_pilot", "in LOITER, flown by its pilot"), ("grounded", "the battery is empty")],
)
def test_a_drone_that_cannot_fly_for_a_repair_stays_and_says_why(hindrance, why):
    rig = lone_rig()
    setattr(rig.engine, hindrance, why)
    rig.wait_until(200.0)
    assert "FLIGHT_DECIDED" not in rig.kinds()
    assert rig.engine.goals == []
    assert rig.mesh.get_repair_status().reason == f"cannot fly: {why}"


def test_a_router_that_knows_no_place_at_all_stays(rig):
    rig.wait_until(400.0)
    assert rig.engine.goals == []
    assert rig.kinds().count("EMERGENCY") > 1


@pytest.mark.parametrize("bids", [(), (bid(3, 1.0),)])
def test_a_router_does_not_fly_while_it_may_still_be_connected_for_the_first_time(rig, bids):
    """Others tell it where the gateway is before it has a route there itself."""
    rig.engine.place = Location(60.0, 0.0, 0.0)
    rig.know_neighbour(3)
    where = GatewayPlace(0, Location(4.0, 0.0, 0.0), age_s=1.0)
    rig.hear(place(3, 54.0), where.to_payload(3, 1).hex())
    assert rig.mesh.places.gateway == where.place
    rig.wait_until(FIRST_EMERGENCY_S - 1.0)
    rig.hear(*bids)
    rig.wait_until(FIRST_EMERGENCY_S - 0.1)
    assert rig.engine.goals == []
    rig.wait_until(FIRST_EMERGENCY_S + 60.0)
    assert len(rig.engine.goals) == 1


@pytest.mark.parametrize(
    "place", ["00 60 9c 45", "ff ff 7f 7f ff ff 7f 7f", "00 00 00 00 00 00 00 00 f5 ff"]
)
def test_a_place_where_no_drone_may_go_is_nowhere_to_fly(place):
    """Any node can claim any place."""
    rig = connected_rig()
    rig.hear(f"00 02 01 01 01 {place}", f"02 02 01 01 01 {place}")
    rig.antenna.dead = {2}
    rig.wait_until(100.0)
    assert rig.engine.goals == []


FAR_NEXT_HOP = "02 02 01 01 01 00 00 f8 41"  # 2 is at latitude 31, two ranges and 1 m away
FAR_GATEWAY = "00 02 01 01 01 00 00 20 42"  # 0 is at latitude 40, three ranges and 1 m away


def hearsay(latitude: str) -> str:
    """GATEWAY_PLACE of 7, through 2: the gateway is there now, at longitude 4."""
    return f"07 02 7d 01 01 01 00 00 {latitude} 00 00 80 40"


def test_a_place_where_the_next_hop_or_the_gateway_cannot_be_is_dropped():
    """The next hop is within two ranges of this node, a gateway two hops away within three."""
    rig = lone_rig()
    rig.hear(FAR_NEXT_HOP, FAR_GATEWAY, hearsay("00 00 20 42"))
    rig.wait_until(EMERGENCY_S + 0.1)
    assert rig.engine.goals[:1] == [BESIDE_NEIGHBOUR]
    assert rig.mesh.places.gateway == Location(4.0, 0.0, 0.0)
    assert rig.mesh.complaints.counts["a place where the gateway cannot be"] == 2


def lines_about_places(caplog):
    """What the log says of places that cannot be."""
    lines = [record.getMessage().split(": ") for record in caplog.records]
    return [why for _node, why, *_place in lines if "cannot be" in why]


@pytest.mark.parametrize(
    "place", [FAR_NEXT_HOP, FAR_GATEWAY, hearsay("00 00 20 42"), FAR_GATEWAY + " 00" * 9 + " 80"]
)
def test_a_place_that_cannot_be_may_be_a_goal_or_hearsay_and_is_no_line_in_the_log(caplog, place):
    rig = connected_rig()
    rig.hear(place)
    rig.wait(5.0)
    rig.hear(place)
    assert rig.mesh.places.gateway is None
    assert not lines_about_places(caplog)


@pytest.mark.parametrize(("place", "who"), [(FAR_NEXT_HOP, "next hop"), (FAR_GATEWAY, "gateway")])
def test_a_node_that_reports_for_half_a_minute_where_it_cannot_be_has_its_line(caplog, place, who):
    rig = connected_rig()
    for _ in range(4):
        rig.hear(place)
        rig.wait(10.0)
        rig.hear("00 02 04 01 01 01 00 01")  # the gateway answers
    assert lines_about_places(caplog) == [f"a place where the {who} cannot be"]


def test_a_place_of_a_gateway_that_it_does_not_prefer_is_not_judged():
    rig = connected_rig()
    rig.hear("07 02 7d 01 01 01 00 08 00 00 20 42 00 00 80 40")  # gateway 8, 40 m away
    assert not rig.mesh.complaints.counts


def test_what_others_say_of_the_gateway_does_not_replace_its_own_word_but_makes_the_node_ask_it():
    rig = lone_rig()
    rig.antenna.dead = set()
    rig.forget()
    rig.hear(hearsay("00 00 00 41"))
    assert rig.mesh.places.gateway == Location(4.0, 0.0, 0.0)
    rig.wait_until(5.5)
    assert [p for p in rig.sent(2) if p[4] == 0] != []
    rig.hear("00 02 01 01 01 00 00 00 41 00 00 80 40")
    assert rig.mesh.places.gateway == Location(8.0, 4.0, 0.0)


def test_a_cut_off_node_without_the_gateways_own_word_believes_the_newest_possible_news():
    rig = connected_rig(12.0)
    rig.mesh.places.forget_gateway()
    rig.antenna.dead = {2}
    rig.wait_until(12.0)
    assert not rig.mesh.get_connected_to_gateway()
    for latitude, place in (("00 00 00 41", 8.0), ("00 00 40 41", 12.0)):
        rig.hear(hearsay(latitude))
        assert rig.mesh.places.gateway == Location(place, 4.0, 0.0)


def test_a_drone_that_knows_no_place_flies_to_where_it_was_connected_last():
    rig = connected_rig(12.0)
    rig.antenna.dead = {2}
    rig.engine.place = Location(30.0, 0.0, 0.0)
    rig.wait_until(60.0)
    assert rig.engine.goals[:1] == [Location(12.0, 0.0, 0.0)]


def test_alone_after_every_step_it_looks_where_it_was_connected_last_and_then_starts_over():
    """It waits for long, as the gateway may be off, and then lands at its other side.

    The gateway, or a drone beyond it, may be just out of reach where it landed before.
    """
    rig = lone_rig()
    left_s = []
    while rig.now_s < 1800.0:
        rig.wait(1.0)
        if len(rig.engine.goals) > len(left_s):
            rig.engine.place = rig.engine.goals[-1]
            left_s.append(rig.now_s)
    there = rig.engine.goals.index(BESIDE_GATEWAY)
    beyond = Location(pytest.approx(2.9), pytest.approx(0.0), 0.0)
    assert rig.engine.goals[there + 1 : there + 4] == [HOME, BESIDE_GATEWAY, beyond]
    assert left_s[there + 1] - left_s[there] > 150.0
    assert left_s[there + 3] - left_s[there + 1] > 150.0
    sides = [goal for goal in rig.engine.goals if goal.distance_m(Location(4.0, 0.0, 0.0)) < 1.2]
    looked_from = [math.degrees(math.atan2(g.longitude, g.latitude - 4.0)) for g in sides]
    assert {round(bearing) % 360 for bearing in looked_from} == {0, 180, 300, 120}


def test_alone_after_every_step_it_looks_at_the_place_of_another_node_and_comes_back():
    """That one may have a gateway; of those that it knows, each time one, the latest first."""
    rig = lone_rig(heard=["06 02 01 01 01 00 00 d0 41"])  # latitude 26
    rig.wait(1.0)
    rig.hear("07 02 01 01 01 00 00 a0 41")  # latitude 20
    while rig.now_s < 2000.0:
        rig.wait(1.0)
        if rig.engine.goals:
            rig.engine.place = rig.engine.goals[-1]
    goals = rig.engine.goals
    looked = [n for n, goal in enumerate(goals) if goal.latitude > 13.5]
    assert [goals[n].latitude for n in looked] == pytest.approx([20.0, 26.0], abs=1.2)
    assert [goals[n + 1] for n in looked] == [goals[n - 1] for n in looked]


def test_a_drone_that_knows_no_place_and_is_where_it_was_connected_last_stays_and_says_so():
    rig = connected_rig(12.0)
    rig.antenna.dead = {2}
    rig.wait_until(60.0)
    assert rig.engine.goals == []
    assert "is where it was connected last, and knows no other place" in rig.repair_in_words()


@pytest.mark.parametrize("height", ["fd ff", "ff ff", "00 00"])  # -3, -1 and 0 m
def test_the_place_of_a_next_hop_a_few_metres_below_the_origin_is_flown_to_and_not_below_it(height):
    """A field slopes, and altitudes err by metres."""
    rig = lone_rig(heard=[f"{TWO_AT_8} {height}"])
    rig.wait_until(46.0)
    assert rig.engine.goals == [BESIDE_NEIGHBOUR]


@pytest.mark.parametrize("other", ["fe ff", "00 00"])  # -2 and 0 m
@pytest.mark.parametrize("height", ["fd ff", "00 00"])
def test_two_silent_drones_on_a_slope_both_keep_their_places(height, other):
    """5 was last heard where this drone would land otherwise."""
    rig = lone_rig(
        heard=[f"{TWO_AT_8} {height}", f"05 02 01 01 01 00 00 00 41 cd cc 8c bf {other}"]
    )
    rig.wait_until(46.0)
    (goal,) = rig.engine.goals
    assert goal.distance_m(Location(8.0, -1.1, 0.0)) >= 1.0
    assert goal.distance_m(NEIGHBOUR_PLACE) >= 1.0


@pytest.mark.parametrize("height", [-0.3, -4.0])
def test_a_drone_that_sees_itself_below_the_ground_flies_to_goals_on_it_and_back(height):
    rig = lone_rig()
    rig.engine.place = rig.engine.place._replace(height=height)
    step_back, start, home = goals_of_one_that_hears_nobody(rig)
    assert step_back == BESIDE_NEIGHBOUR
    assert start == Location(12.0, 0.0, 0.0)
    assert home.height == 0.0


# Negotiation ---------------------------------------------------------------------------------


def test_with_neighbours_it_bids_its_distance_to_the_gateway_in_three_dimensions():
    rig = group_rig(3, 4)
    rig.engine.place = Location(12.0, 8.0, 1.0)  # 8, 8 and 1 m away: the root of 129
    rig.wait_until(EMERGENCY_S - 0.1)
    assert rig.sent(BID) == []
    rig.wait_until(BIDS_S)
    assert rig.sent(BID) == [own_bid(3, 129**0.5), own_bid(4, 129**0.5)]
    assert rig.engine.goals == []


@pytest.mark.parametrize(
    ("bids", "flies"),
    [
        ([(3, 7.0), (4, 7.9)], True),
        ([(3, 8.5), (4, 7.0)], False),
        ([(3, -1.0), (4, -1.0)], True),
        ([(3, 8.0), (4, 1.0)], True),  # equal scores: the lowest id, which is this one's
    ],
)
def test_the_highest_score_flies(bids, flies):
    rig = group_rig(3, 4)
    rig.wait_until(BIDS_S)  # its own score is 8
    for neighbour, score in bids:
        assert rig.engine.goals == []
        decide(rig, bid(neighbour, score))
    assert rig.engine.goals == ([BESIDE_NEIGHBOUR] if flies else [])
    assert rig.kinds().count("NEGOTIATION_ENDED") == 1


def test_of_equal_scores_the_lowest_id_flies():
    rig = Rig(node_id=5)
    rig.engine.place = Location(12.0, 0.0, 0.0)
    rig.hear("00 02 04 05 05 01 00 01", "00 02 01 05 05 00 00 80 40", "02 02 01 05 05 00 00 00 41")
    rig.antenna.dead = {2}
    rig.hear("03 03 00 05 05")
    rig.wait_until(35.1)
    rig.hear("03 03 07 05 05 00 00 00 41")
    rig.wait(1.0 + TO_DECISION_S)
    assert rig.engine.goals == []
    assert rig.events[-1].peer == 3


def test_scores_are_compared_as_they_are_on_the_air():
    """Two drones at one place: rounded to a float32, each bid looks higher than one's own."""
    rig = group_rig(3)
    rig.engine.place = Location(4.0, 10.1, 0.0)  # 10.1 is 10.10000038 as a float32
    rig.wait_until(BIDS_S)
    decide(rig, bid(3, 10.1))
    assert len(rig.engine.goals) == 1


def test_no_router_flies_without_a_bid(rig):
    rig.know_neighbour(3)
    rig.wait_until(FIRST_EMERGENCY_S + 1.1)
    decide(rig, bid(3, -1.0))
    assert rig.engine.goals == []
    assert rig.events[-1].peer == NO_ROUTE


def without_gateway():
    """It knows no other place than that of the neighbour that died."""
    rig = Rig()
    rig.hear(NEIGHBOUR_2_AT_0_8)
    rig.antenna.dead = {2}
    rig.know_neighbour(3)
    return rig


def without_place():
    rig = group_rig(3)
    rig.engine.place = None
    return rig


def grounded():
    rig = group_rig(3)
    rig.engine.grounded = "the battery is empty"
    return rig


@pytest.mark.parametrize(
    ("make_rig", "at_s", "why"),
    [
        (without_gateway, FIRST_EMERGENCY_S + 1.1, "knows no place to fly to"),
        (without_place, BIDS_S, "does not know where it is"),
        (grounded, BIDS_S, "cannot fly: the battery is empty"),
    ],
)
def test_a_router_that_knows_no_way_or_cannot_fly_does_not_bid_and_says_why(make_rig, at_s, why):
    rig = make_rig()
    rig.wait_until(at_s)
    assert rig.sent(BID) == [own_bid(3, -1.0)]
    assert why in rig.repair_in_words()


def test_a_router_that_would_take_the_place_of_a_neighbour_does_not_bid():
    rig = group_rig(2, 3)
    rig.antenna.dead = set()  # it takes the heartbeats for the gateway, and no answer comes
    rig.wait_until(BIDS_S)
    assert own_bid(3, -1.0) in rig.sent(BID)


def test_a_router_that_knows_where_its_relay_stood_and_not_where_the_gateway_is_bids_its_way():
    """As after its mesh has passed to another gateway, whose place nobody has told yet."""
    rig = connected_rig(12.0)
    rig.hear(NEIGHBOUR_2_AT_0_8)
    rig.antenna.dead = {2}
    rig.know_neighbour(3)
    rig.wait_until(BIDS_S)
    assert rig.sent(BID) == [own_bid(3, 4.0)]
    decide(rig, bid(3, 1.0))
    (goal,) = rig.engine.goals
    assert goal.distance_m(NEIGHBOUR_PLACE) < 1.2


def test_a_router_that_knows_only_the_place_of_the_gateway_bids_for_flying_there():
    """Otherwise a group of such drones would stay for ever."""
    rig = connected_rig(12.0)
    rig.hear("00 02 01 01 01 00 00 80 40")
    rig.antenna.dead = {2}
    rig.know_neighbour(3)
    rig.wait_until(BIDS_S)
    assert rig.sent(BID) == [own_bid(3, 8.0)]
    decide(rig, bid(3, 1.0))
    assert rig.engine.goals == [A_LEG_FROM_12]


def test_a_gateway_with_an_impossible_place_does_not_break_the_bids():
    rig = group_rig(3)
    rig.hear("00 03 01 01 01 ff ff 7f 7f ff ff 7f 7f", "00 03 04 01 01 01 00 05")
    rig.wait_until(100.0)
    assert len(rig.sent(BID)) >= 1


@pytest.mark.parametrize(("dies", "after_s"), [(True, TO_DECISION_S), (False, 10.0)])
def test_a_neighbour_that_does_not_bid_is_waited_for_until_it_dies_or_for_a_period(dies, after_s):
    rig = bidding_rig(3, 4)
    rig.hear(bid(3, 1.0))
    if dies:
        rig.antenna.dead = {2, 4}
        rig.mesh.control.send_heartbeat(4)
    rig.wait_until(BIDS_S + after_s - 0.2)
    assert rig.engine.goals == []
    rig.wait_until(BIDS_S + after_s)
    assert rig.engine.goals == [BESIDE_NEIGHBOUR]
    assert rig.kinds().count("EMERGENCY") == 1


def test_a_neighbour_that_dies_while_the_bid_is_sent_is_not_waited_for():
    rig = group_rig(3)
    rig.antenna.gets_lost = lambda payload: payload[2] == BID
    rig.wait_until(BIDS_S + TO_DECISION_S)
    assert rig.engine.goals == [BESIDE_NEIGHBOUR]


def test_bids_that_came_before_the_emergency_count():
    rig = group_rig(3, 4)
    rig.wait_until(14.0)  # its timer starts at 15 s
    rig.hear(bid(3, 9.0))
    assert rig.sent(BID) == [packet("03 01 07 04 04 00 00 10 41")]  # passed on, not answered
    rig.wait_until(16.0)
    rig.hear(bid(4, 1.0))
    rig.wait(1.0 + TO_DECISION_S)
    assert rig.events[-1].kind.name == "NEGOTIATION_ENDED"
    assert rig.events[-1].peer == 3


def test_a_bid_makes_an_unconnected_node_with_a_running_timer_join_at_once():
    rig = group_rig(3, 4)
    rig.wait_until(20.0)
    rig.hear(bid(3, 1.0))
    assert rig.broadcasts()[-1:] == [packet("01 01 02 fe fe" + FROM_12)]  # asks where they are
    rig.hear(place(3, 30.0), place(4, 31.0))
    assert rig.sent(BID)[-2:] == [own_bid(3, 8.0), own_bid(4, 8.0)]
    rig.hear(bid(4, 2.0))
    rig.wait(1.0 + TO_DECISION_S)
    assert rig.engine.goals == [BESIDE_NEIGHBOUR]


def test_a_bid_before_the_timer_runs_is_kept_and_not_answered():
    rig = group_rig(3)
    rig.mesh.control.send_heartbeat(0)
    rig.wait(0.6)
    rig.hear(bid(3, 9.0))
    assert rig.sent(BID) == []


def test_a_connected_node_does_not_negotiate():
    rig = connected_rig()
    rig.hear(NEIGHBOUR_2_AT_0_8, bid(3, 9.0))
    rig.wait(1.0)
    assert rig.sent(BID) == []
    assert "NEGOTIATION_STARTED" not in rig.kinds()


def switch_off(rig):
    rig.antenna.powered = False
    rig.mesh.on_antenna_power(False, rig.now_s)


def connect(rig):
    rig.hear("00 03 04 01 01 01 00 03", bid(3, 1.0), bid(4, 1.0))


@pytest.mark.parametrize("ends", [switch_off, connect])
def test_a_connection_or_an_antenna_that_is_off_ends_a_negotiation(ends):
    rig = bidding_rig(3, 4)
    ends(rig)
    rig.wait(12.0)
    assert rig.engine.goals == []
    assert "NEGOTIATION_ENDED" not in rig.kinds()


def test_old_bids_do_not_count():
    """Node 4 bid more, and has disappeared since."""
    rig = group_rig(3)
    rig.mesh.on_msg(packet(bid(4, 99.0)), rig.now_s)
    rig.antenna.dead = {2, 4}
    rig.wait_until(BIDS_S)
    decide(rig, bid(3, 1.0))
    assert rig.engine.goals == [BESIDE_NEIGHBOUR]


def test_the_list_is_cleared_after_a_negotiation():
    rig = bidding_rig(3, 4)
    decide(rig, bid(3, 99.0), bid(4, 1.0))
    assert rig.kinds().count("NEGOTIATION_ENDED") == 1
    rig.hear(bid(3, TOOK_OFF))
    rig.wait_until(EMERGENCY_S + 10.5)  # the timer runs again
    rig.hear(bid(4, 1.0))
    rig.wait(2.0)
    assert rig.kinds().count("NEGOTIATION_STARTED") == 2
    assert rig.kinds().count("NEGOTIATION_ENDED") == 1  # what 3 bids now is not known


def test_after_the_first_flight_of_the_group_later_rounds_come_three_times_as_soon():
    """The check 10 s after the emergency starts the timer, the next one acts."""
    rig = bidding_rig(3, 4)
    rig.hear(bid(3, TOOK_OFF))
    rig.wait_until(EMERGENCY_S + 20.9)
    assert rig.kinds().count("NEGOTIATION_STARTED") == 1
    rig.wait_until(BIDS_S + 20.1)
    assert rig.kinds().count("NEGOTIATION_STARTED") == 2


def test_after_three_rounds_without_a_flight_rounds_are_as_rare_as_before_the_first_flight():
    rig = group_rig(3, 4)
    rig.engine.grounded = "the battery is empty"
    rig.wait_until(BIDS_S)
    rig.hear(bid(3, TOOK_OFF))
    starts_s = []
    while rig.now_s < EMERGENCY_S + 150.0:
        known = rig.kinds().count("NEGOTIATION_STARTED")
        rig.wait(1.0)
        if rig.kinds().count("NEGOTIATION_STARTED") > known:
            starts_s.append(rig.now_s - BIDS_S)
    assert starts_s == pytest.approx([20.0, 40.0, 60.0, 100.0, 140.0])


def test_a_late_bid_does_not_start_the_same_negotiation_again():
    rig = bidding_rig(3, 4)
    decide(rig, bid(3, 99.0), bid(4, 1.0))
    rig.hear(bid(3, TOOK_OFF))
    rig.forget()
    rig.hear(bid(4, 2.0))
    assert rig.sent(BID) == []
    assert rig.engine.goals == []


def test_a_bid_that_one_neighbour_brings_and_another_distorts_is_passed_on_once():
    rig = bidding_rig(3, 4, 5)
    rig.forget()
    for _ in range(3):
        for through, score in ((4, 99.0), (3, 1e6)):  # no node of the group is that far away
            rig.hear(bytes((9, through, BID, 1, 1)).hex() + struct.pack("<f", score).hex())
    assert sorted(sent[3] for sent in rig.sent(BID) if sent[0] == 9) == [3, 5]


def test_a_node_in_flight_does_not_negotiate(rig):
    rig.connect_to_gateway()
    rig.hear(GATEWAY_AT_0_4, "00 00 06 01 01 00 00 fa 43")
    rig.forget()
    for second in range(1, 60):
        fly(rig, Location(2.0 * second, 0.0, 0.0))
        rig.hear(bid(3, 9.0))
    assert rig.sent(BID) == []
    assert len(rig.engine.goals) == 1


# Occupied places -----------------------------------------------------------------------------


@pytest.mark.parametrize(("latitude", "score"), [(8.3, -1.0), (9.6, 8.0)])  # 2's place is at 8
def test_a_place_on_which_a_neighbour_stands_is_occupied(latitude, score):
    rig = group_rig(3, 4)
    rig.wait_until(EMERGENCY_S)
    rig.hear(place(3, latitude), place(4, 30.0))
    assert rig.sent(BID) == [own_bid(3, score), own_bid(4, score)]
    words = "does not bid: the place of 2 is occupied by 3"
    assert (rig.repair_in_words() == f"negotiating, {words}") is (score < 0)


@pytest.mark.parametrize(("age", "score"), [("22 01", -1.0), ("36 01", 8.0)])  # 290 s, 310 s
def test_a_far_node_that_stood_at_a_place_minutes_ago_does_not_occupy_it(age, score):
    """The route to it may be as old; a drone that flies there asks who is there."""
    rig = group_rig(3, 4)
    rig.wait_until(EMERGENCY_S - 1.0)
    rig.routing.other_can_communicate_with_node(3, 6)
    rig.hear(f"03 03 45 01 01 {age} 06 00 00 04 41")  # 6 was at latitude 8.25; 2's place is at 8
    rig.wait_until(EMERGENCY_S)
    rig.hear(place(3, 30.0), place(4, 30.0))
    assert own_bid(3, score) in rig.sent(BID)


def test_each_step_of_an_election_is_described():
    rig = group_rig(3, 4)
    rig.wait_until(EMERGENCY_S - 3.5)
    assert rig.repair_in_words() == "waits 4 s for a gateway"
    rig.wait_until(EMERGENCY_S)
    assert rig.repair_in_words() == "asks where its neighbours are"
    rig.hear(place(3, 30.0), place(4, 30.0))
    assert rig.repair_in_words() == "negotiating, bids 8.0 m for the place of 2"
    rig.hear(bid(3, 9.0), bid(4, 1.0))
    rig.wait_until(BIDS_S + TO_DECISION_S)
    assert rig.repair_in_words() == "waits for 3 to take off"
    rig.hear(bid(3, TOOK_OFF))
    assert rig.repair_in_words() == "does not fly: 3 flies instead"
    rig.connect_to_gateway()
    assert rig.repair_in_words() == ""


def test_a_place_is_occupied_while_its_owner_answers_over_whatever_route():
    rig = group_rig(3)
    rig.wait_until(EMERGENCY_S - 1.0)
    rig.routing.other_can_communicate_with_node(3, 2)
    rig.wait_until(EMERGENCY_S)
    assert packet("01 01 02 03 02" + FROM_12) in rig.sent(REQUEST)  # asks the owner itself
    rig.hear(place(3, 30.0), "02 03 01 01 01 00 00 f0 41")  # 2 lives, somewhere else
    assert rig.sent(BID) == [own_bid(3, -1.0)]


def test_who_stands_beside_the_gateways_place_and_has_no_gateway_does_not_occupy_it():
    """Its link may have failed: it stood there for minutes while others could have looked."""
    rig = group_rig(2, 3)
    rig.antenna.dead = set()
    rig.hear(place(3, 5.0))  # the gateway's place is at 4
    for round_s in (0.0, 40.0):
        rig.wait_until(BIDS_S + round_s)
        rig.hear(bid(2, -1.0), bid(3, -1.0))
        rig.wait(TO_DECISION_S)
    rig.forget()
    rig.wait_until(BIDS_S + 80.0)
    assert own_bid(2, 1 / 9) in rig.sent(BID)


def test_after_two_rounds_without_a_flier_the_place_of_the_gateway_counts():
    rig = group_rig(2, 3)
    rig.antenna.dead = set()
    rig.wait_until(BIDS_S)
    for round_s in (0.0, 40.0):
        rig.wait_until(BIDS_S + round_s)
        assert own_bid(3, -1.0) in rig.sent(BID)
        rig.hear(bid(2, -1.0), bid(3, -1.0))
        rig.wait(TO_DECISION_S)
    rig.wait_until(BIDS_S + 80.0)
    assert own_bid(3, 1 / 9) in rig.sent(BID)  # the nearest flies: 1 / (1 + 8 m)
    decide(rig, bid(2, -1.0), bid(3, -1.0))
    assert rig.engine.goals == [A_LEG_FROM_12]


# Which drone flies ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("place", "grounded"),
    [
        ("00 60 9c 45", ""),  # latitude 5004
        ("00 00 00 00 00 60 9c c5", ""),  # longitude -5004
        ("00 00 00 00 00 00 00 00 f5 01", ""),  # height 501
        ("00 00 00 00 00 00 00 00 ff ff", ""),  # height -1
        ("00 00 80 3f", "the battery is empty"),
    ],
)
def test_an_order_that_the_drone_cannot_follow_is_refused_and_counted(place, grounded):
    rig = connected_rig()
    rig.engine.grounded = grounded
    rig.hear(f"00 02 06 01 01 {place}")
    assert rig.engine.goals == []
    assert rig.mesh.get_connected_to_gateway()
    assert rig.mesh.complaints.counts["order refused"] == 1


def test_a_better_bid_is_passed_on_to_the_other_neighbours_and_a_worse_one_is_not():
    rig = bidding_rig(3, 4, 5)
    rig.forget()
    rig.hear("09 03 07 01 01 00 00 10 41")  # 9 bids 9, and 3 passes it on
    assert rig.sent(BID) == [
        packet("09 01 07 04 04 00 00 10 41"),
        packet("09 01 07 05 05 00 00 10 41"),
    ]
    rig.hear("08 04 07 01 01 00 00 80 40")
    assert rig.sent(BID) == []


def test_the_winner_announces_its_flight_with_its_goal_and_asks_at_once_who_is_there():
    """It may be dead a second later, and then hang there."""
    rig = bidding_rig(3)
    rig.forget()
    decide(rig, bid(3, 1.0))
    goal = "00 00 00 41 cd cc 8c bf"  # BESIDE_NEIGHBOUR
    assert rig.sent(BID) == [packet(f"01 01 07 03 03 28 6b ee 4e 01 00 00 {goal}")]
    assert rig.broadcasts() == [packet(f"01 01 02 fe fe {goal} 01 80")]
    assert rig.routing.empty()
    assert rig.mesh.get_neighbours() == {}
    assert "FLIGHT_DECIDED" in rig.kinds()


def test_a_drone_keeps_clear_of_the_goal_of_one_that_took_off_and_was_not_heard_again():
    rig = bidding_rig(3)
    decide(rig, bid(3, 99.0))
    rig.hear(bid(3, TOOK_OFF) + "01 00 00 00 00 00 41 cd cc 8c bf 00 00")  # BESIDE_NEIGHBOUR
    rig.antenna.dead = {2, 3}
    while not rig.engine.goals:
        rig.wait(1.0)
    (goal,) = rig.engine.goals
    assert goal.distance_m(Location(8.0, -1.1, 0.0)) >= 1.0
    assert goal[:2] == pytest.approx((8.8, 1.1))  # a spot that is not 3's, whatever it does


def test_a_winner_that_takes_off_is_waited_for():
    rig = bidding_rig(3, 4)
    decide(rig, bid(3, 99.0), bid(4, 1.0))
    rig.hear(bid(3, TOOK_OFF))
    rig.wait(20.0)
    assert rig.engine.goals == []


def test_a_winner_that_does_not_take_off_within_5_s_is_passed_over():
    """It died after its bid."""
    rig = bidding_rig(3, 4)
    rig.hear(bid(3, 99.0), bid(4, 1.0))
    rig.wait(TO_DECISION_S + 4.8)
    rig.forget()
    rig.wait(0.2)
    assert rig.sent(BID) == [own_bid(3, 8.0), own_bid(4, 8.0)]
    decide(rig, bid(4, 1.0))
    assert rig.engine.goals == [BESIDE_NEIGHBOUR]


@pytest.mark.parametrize(
    ("about", "goals", "why"),
    [
        ("", [], "another drone flew to the gateway without success"),
        ("01 00 00 00 00 20 42 00 00 00 00 00 00", [A_LEG_FROM_12], ""),  # to (0, 40), not (0, 4)
    ],
)
def test_where_another_drone_found_no_gateway_is_no_second_choice(about, goals, why):
    rig = group_rig(2, 3)
    rig.antenna.dead = set()
    for round_s in (0.0, 40.0, 80.0):
        rig.wait_until(BIDS_S + round_s)
        rig.hear(bid(3, HOME_FAILED) + about, bid(2, -1.0))
        rig.wait(TO_DECISION_S)
    assert rig.engine.goals == goals
    assert why in rig.repair_in_words()


def test_twenty_rounds_after_another_drone_was_at_the_gateway_in_vain_it_tries_itself():
    """The first one repeats in each round that it failed; perhaps only its radio is deaf."""
    rig = group_rig(2, 3)
    rig.antenna.dead = set()
    while rig.now_s < 800.0:
        assert rig.engine.goals == []
        rig.wait(5.0)
        rig.hear(bid(3, HOME_FAILED), bid(2, -1.0))
    while not rig.engine.goals and rig.now_s < 900.0:
        rig.wait(5.0)
        rig.hear(bid(3, HOME_FAILED), bid(2, -1.0))
    assert rig.engine.goals == [A_LEG_FROM_12]


AT_LATITUDE_20 = "01 00 00 00 00 a0 41 00 00 00 00 00 00"  # of which a bid tells


def goals_after_the_gateway(rig, score, *told):
    """When and where it flies after it was at the gateway's place; 3 sends this bid all the time.

    Before it flies there, it hears the packets `told`.
    """
    rig.antenna.dead = {2, 6, 7}
    left_s, goals = [], rig.engine.goals
    while rig.now_s < 3000.0:
        rig.wait(1.0)
        if len(goals) > len(left_s):
            left_s.append(rig.now_s)
            rig.engine.place = goals[-1]
        if len(goals) == 1:
            rig.hear(*told)
            told = ()
        if rig.now_s % 2 < 1:
            rig.hear(bid(3, score))
    assert [goal.latitude for goal in goals[:2]] == pytest.approx([8.0, 5.0], abs=0.1)
    return [(at_s - left_s[1], goal) for at_s, goal in zip(left_s[2:], goals[2:])]


@pytest.mark.parametrize(("score", "rounds"), [(-1.0, 25), (HOME_FAILED, 5)])
def test_after_the_gateways_place_it_looks_once_beside_a_node_out_of_reach_and_comes_back(
    score, rounds
):
    """Sooner if another drone was there in vain, too; 60 m away no gateway can be in reach."""
    rig = group_rig(3)
    rig.hear(place(6, 20.0), place(7, 60.0))
    stood = Location(pytest.approx(5.1, abs=0.1), pytest.approx(-0.3, abs=0.1), 0.0)
    (out_s, goal), (back_s, back) = goals_after_the_gateway(rig, score)
    assert out_s == pytest.approx(rounds * 40.0, abs=15.0)
    assert goal.distance_m(Location(20.0, 0.0, 0.0)) == pytest.approx(1.1)
    assert (back, back_s - out_s < 10.0) == (stood, True)


def test_it_looks_also_where_another_drone_did_whose_link_may_have_failed():
    looked = goals_after_the_gateway(group_rig(3), HOME_FAILED, bid(3, TOOK_OFF) + AT_LATITUDE_20)
    assert [round(goal.latitude) for _at_s, goal in looked] == [19, 5]


def test_away_from_its_group_it_does_not_pass_on_who_was_at_the_gateway_in_vain():
    """Another group there would wait for so much longer before one of it flies to the gateway."""
    rig = group_rig(3)
    rig.hear(place(6, 20.0))
    rig.antenna.dead = {2, 6}
    goals = rig.engine.goals
    while rig.now_s < 3000.0 and len(goals) < 3:
        rig.wait(1.0)
        rig.engine.place = goals[-1] if goals else rig.engine.place
        rig.hear(bid(3, HOME_FAILED))
    rig.wait(1.0)
    rig.engine.place = goals[-1]
    rig.wait(3.0)
    rig.forget()
    rig.hear(bid(8, -1.0), "04 09 07 01 01 28 6b 6e 4f", bid(9, 7.0))
    rig.wait(1.0)
    assert (rig.sent(BID), len(goals)) == ([], 3)


def test_it_does_not_look_beside_a_drone_that_it_heard_without_a_gateway():
    """On a flight it forgets its routes: that one is of its group, far from the gateway."""
    assert goals_after_the_gateway(group_rig(3), HOME_FAILED, place(6, 20.0)) == []


def test_an_announcement_is_passed_on_with_the_place_that_it_is_about():
    rig = group_rig(3, 4)
    rig.wait_until(EMERGENCY_S - 1.0)
    rig.forget()
    rig.hear(bid(3, TOOK_OFF_HOME) + "01 00 00 00 00 20 42 00 00 00 00 00 00")
    passed_on = "03 01 07 04 04 5e d0 32 4f 01 00 00 00 00 20 42"
    assert rig.sent(BID) == [bytes.fromhex(passed_on).ljust(32, b"\0")]


def test_after_a_flight_of_another_drone_to_the_gateway_there_is_none_for_a_minute():
    """With rounds so short that the first one after that minute comes within 10 s."""
    rig = group_rig(3, timing=MeshTiming(check_period_s=1.0, connection_lost_after_s=3.0))
    rig.hear(UNDERGROUND)  # the place of 2 is nowhere to fly
    rig.antenna.dead = {2}
    rig.wait_until(4.0)
    rig.hear(bid(3, TOOK_OFF_HOME))
    rig.wait(59.9)
    assert rig.engine.goals == []
    assert rig.kinds().count("NEGOTIATION_ENDED") > 3
    rig.wait(10.0)
    assert len(rig.engine.goals) == 1


# Silence -------------------------------------------------------------------------------------


def silent_rig():
    """As lone_rig, with neighbours 3 and 4, which die together with 2: its medium may be down."""
    rig = group_rig(3, 4)
    rig.antenna.dead = {2, 3, 4}
    return rig


HOME = Location(12.0, 0.0, 0.0)


def test_a_drone_whose_neighbours_fell_silent_together_looks_around_once_and_comes_back():
    """It flies after the usual time, and then waits five times as long."""
    rig = silent_rig()
    rig.wait_until(EMERGENCY_S + 0.1)
    (there,) = rig.engine.goals
    fly(rig, there)
    rig.wait(3.0)
    assert rig.engine.goals == [there, HOME]
    fly(rig, HOME)
    rig.wait_until(EMERGENCY_S + 150.0)
    assert rig.engine.goals == [there, HOME]
    rig.wait(30.0)
    assert len(rig.engine.goals) > 2


def test_later_looks_at_the_same_place_end_at_other_spots():
    rig = silent_rig()
    while rig.now_s < 1300.0:
        rig.wait(1.0)
        rig.engine.place = (rig.engine.goals or [HOME])[-1]
    goals = rig.engine.goals
    looks = [goal for goal, after in zip(goals, goals[1:]) if after == HOME]  # and not legs
    assert len(looks) == len(set(looks)) == 3
    assert all(look.distance_m(Location(4.0, 0.0, 0.0)) < 13.0 for look in looks)


def test_it_stays_where_it_hears_a_node_that_it_did_not_know():
    rig = silent_rig()
    rig.wait_until(EMERGENCY_S + 0.1)
    fly(rig, rig.engine.goals[0])
    rig.wait(0.9)  # it asks whether another drone is there
    rig.hear("09 09 03 01 fe 01 01")
    rig.wait(7.0)
    assert len(rig.engine.goals) == 1
    rig.hear("00 09 04 01 01 01 00 01")
    assert rig.mesh.get_connected_to_gateway()


def test_it_comes_back_if_a_lost_neighbour_turns_out_to_live():
    """So the medium was down. A gateway's answer that comes before does not keep it there."""
    rig = silent_rig()
    rig.wait_until(EMERGENCY_S + 0.1)
    fly(rig, rig.engine.goals[0])
    rig.wait(0.9)
    rig.hear("00 09 04 01 01 01 00 01")
    assert not rig.mesh.get_connected_to_gateway()
    rig.hear("03 03 03 01 fe 01 01")
    assert rig.engine.goals[1:] == [HOME]


def test_it_flies_to_a_spot_near_the_place_that_belongs_to_it_alone():
    rig = silent_rig()
    rig.wait_until(EMERGENCY_S + 0.1)
    (goal,) = rig.engine.goals
    assert 1.0 <= goal.distance_m(NEIGHBOUR_PLACE) < 7.0
    assert goal == own_spot(
        NEIGHBOUR_PLACE, 1, RepairOptions(), [NEIGHBOUR_PLACE, Location(4.0, 0.0, 0.0)]
    )


@pytest.mark.parametrize("x_m", [-2003.7, -2.9, 0.0, 8.3, 4100.2])
def test_the_spots_of_all_ids_are_near_a_place_and_clear_of_each_other(x_m):
    place = Location(x_m, x_m - 40.0, 0.0)
    spots = [own_spot(place, node, RepairOptions()) for node in range(64)]
    assert max(spot.distance_m(place) for spot in spots) < 6.3
    assert all(one.distance_m(other) >= 1.0 for one, other in itertools.combinations(spots, 2))


@pytest.mark.parametrize("node", range(64))
def test_where_a_fence_leaves_a_drone_no_spot_of_its_own_it_takes_one_in_reach(node):
    place = Location(8.7, 0.4, 0.0)

    def allows(spot):
        return spot.longitude < 3.0 or spot.distance_m(place) > 9.0

    goal = own_spot(place, node, RepairOptions(range_m=9.0), [place], allows)
    assert allows(goal)
    assert 1.0 <= goal.distance_m(place) < 9.0


@pytest.mark.parametrize("east_m", [0.5, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("group", [(1, 5), (9, 13), (1, 5, 9), (2, 4, 6, 8), (1, 3, 17, 33)])
def test_drones_that_a_fence_leaves_few_spots_take_different_ones(east_m, group):
    place, options = Location(8.7, 0.4, 0.0), RepairOptions(range_m=9.0)

    def allows(spot):
        return spot.longitude < east_m or spot.distance_m(place) > 9.0

    for silent in (True, False):
        goals = []
        for node in group:
            rivals = sorted({*group} - {node})
            if silent:
                goals.append(own_spot(place, node, options, [place], allows, rivals))
            else:
                landing = Landing(place)
                goals.append(
                    spot_beside_rivals(place, node, rivals, landing, options, [place], allows)
                )
        assert all(one.distance_m(two) >= 1.0 for one, two in itertools.combinations(goals, 2))


def beside_rivals(place, node, rivals, links=()):
    """Where `node` lands beside a lost node at `place` that may still be there."""
    landing = Landing(Location(0.0, 0.0, 0.0), links)
    return spot_beside_rivals(place, node, rivals, landing, RepairOptions(), [place])


@pytest.mark.parametrize("ids", [(1, 2), (1, 2, 11), (1, 9, 65), (3, 19, 35, 67), (0, 2, 4, 16)])
@pytest.mark.parametrize("x_m", [-2003.7, 0.0, 8.3, 4100.2])
def test_drones_that_cannot_hear_each_other_take_different_spots_beside_a_lost_one(ids, x_m):
    """Also if one of them has more rivals, or is in a silence, and so takes larger blocks."""
    place = Location(x_m, 14.0, 0.0)
    first, *others = (
        [
            beside_rivals(place, node, {*ids, *more} - {node})
            for more in ([], [5, 30, 101], [node + 128])
        ]
        + [own_spot(place, node, RepairOptions(), [place])]
        for node in ids
    )
    assert all(spot.distance_m(place) >= 1.0 for spots in (first, *others) for spot in spots)
    for spots in others:
        assert all(one.distance_m(two) >= 1.0 for one in first for two in spots)


def test_the_spots_beside_one_rival_are_mostly_nearer_than_in_a_silence():
    place = Location(8.3, 14.0, 0.0)
    assert beside_rivals(place, 1, [2]).distance_m(place) < 2.5


def test_a_drone_beside_rivals_takes_the_spot_that_keeps_the_links_of_the_lost_node():
    links = [Location(0.0, 0.0, 0.0), Location(16.0, 0.0, 0.0)]
    spot = beside_rivals(Location(8.0, 0.0, 0.0), 10, [3], links)
    assert all(spot.distance_m(other) < 9.0 for other in links)


def test_a_node_that_is_heard_again_gives_the_mesh_time_to_recover():
    rig = silent_rig()
    rig.wait_until(EMERGENCY_S - 1.0)
    rig.antenna.dead = {2, 4}
    rig.know_neighbour(3)
    rig.wait(20.0)
    assert rig.engine.goals == []
    assert rig.sent(BID) == []


# A jammer --------------------------------------------------------------------------------------


@pytest.mark.parametrize("make_rig", [lone_rig, silent_rig])
def test_a_drone_whose_channel_is_jammed_stays_says_so_and_tries_again(make_rig):
    rig = make_rig()
    rig.antenna.power = lambda: True
    rig.wait_until(600.0)
    assert rig.engine.goals == []
    assert rig.repair_in_words().endswith("does not fly: its channel is jammed")
    said = [event.detail for event in rig.events if event.kind.name == "EMERGENCY"]
    assert said.count("its channel is jammed: it stays") == 1
    rig.antenna.power = lambda: False
    rig.wait(25.0)
    assert rig.engine.goals == []  # the others need time to be heard again
    rig.wait(20.0)
    assert rig.engine.goals != []


@pytest.mark.parametrize("strategy", [*REPAIR_STRATEGIES, "reckless"])
def test_a_drone_whose_own_radio_does_not_work_stays_and_says_so(strategy):
    repair = Reckless() if strategy == "reckless" else create_repair_strategy(strategy)
    rig = lone_rig(repair=repair)
    rig.antenna.is_whole = False
    rig.wait_until(3600.0)
    assert rig.engine.goals == []
    assert rig.repair_in_words().endswith("does not fly: its radio does not work")
    said = [event.detail for event in rig.events if event.kind.name == "EMERGENCY"]
    assert said == ["its radio does not work: it stays"]
    rig.antenna.is_whole = True
    rig.wait(60.0)
    assert (rig.engine.goals == []) is (strategy == "stay")


class Reckless(IRepairStrategy):
    """Flies whenever it is asked anything, without asking whether it can."""

    def patience(self, silent):
        self.on_emergency()
        return 1.0

    def on_emergency(self):
        self.mesh.fly(self.mesh.steps[0])


def test_a_drone_alone_flies_for_hours_without_leaving_the_places_that_it_knows():
    rig = lone_rig(RepairOptions(clearance_m=5.0))
    for _flight in range(200):
        flown = len(rig.engine.goals)
        while len(rig.engine.goals) == flown:
            rig.wait(10.0)
        rig.engine.place = rig.engine.goals[-1]
    farthest_m = max(goal.distance_m(Location(4.0, 0.0, 0.0)) for goal in rig.engine.goals)
    assert farthest_m < 8.0 + 2 * 5.5 + 0.1  # two rings around where it was connected last


def test_power_in_a_few_samples_is_a_frame_of_strangers_and_no_jammer():
    rig = lone_rig()
    samples = iter([True, False, False, True, False, False, True, False])
    rig.antenna.power = lambda: next(samples)
    rig.wait_until(EMERGENCY_S + 2.0)
    assert len(rig.engine.goals) == 1


def test_an_election_that_begins_while_it_measures_the_power_ends_the_measurement():
    rig = lone_rig()
    rig.antenna.power = lambda: False
    rig.wait_until(EMERGENCY_S + 0.2)
    rig.know_neighbour(3)
    rig.antenna.dead = {2, 3}  # its own bid finds nobody any more
    rig.hear(bid(3, 1.0), place(3, 13.0))
    rig.wait(5.0)
    assert len(rig.engine.goals) == 1


def test_a_drone_that_hears_nodes_does_not_ask_about_power():
    rig = group_rig(3)
    rig.antenna.power = None  # an error if it is called
    rig.wait_until(EMERGENCY_S + 5.0)


def test_neighbours_that_fall_silent_at_different_checks_did_not_do_so_together():
    rig = group_rig(3)
    rig.wait_until(6.0)  # the check at 5 s found 2 dead
    rig.antenna.dead = {2, 3}
    rig.wait_until(EMERGENCY_S + 0.1)
    assert len(rig.engine.goals) == 1


def test_neighbours_that_it_flew_away_from_are_not_silent():
    """A flight so short that it keeps its routes, to where no neighbour hears it."""
    rig = group_rig(3, 4)
    rig.antenna.dead = set()
    rig.hear("00 02 06 01 01 00 00 60 41")  # 2 m on, to latitude 14
    fly(rig, Location(14.0, 0.0, 0.0))
    assert "LANDED" in rig.kinds()
    rig.antenna.dead = {2, 3, 4}
    rig.wait_until(EMERGENCY_S + 0.1)
    assert rig.engine.goals[1:] == [BESIDE_NEIGHBOUR]


# Places of silent drones ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("option", "height", "goal"),
    [
        (LostPlace.BESIDE, "00 00", BESIDE_NEIGHBOUR),
        (LostPlace.ABOVE, "00 00", NEIGHBOUR_PLACE._replace(height=1.0)),
        (LostPlace.ABOVE, "fd ff", NEIGHBOUR_PLACE._replace(height=1.0)),  # 3 m below the origin
        (
            LostPlace.BELOW,
            "00 00",
            NEIGHBOUR_PLACE._replace(height=1.0),
        ),  # the ground is in the way
        (LostPlace.BELOW, "04 00", NEIGHBOUR_PLACE._replace(height=3.0)),
        (LostPlace.EXACT, "00 00", NEIGHBOUR_PLACE),
    ],
)
def test_the_goal_keeps_clear_of_the_silent_drone_as_the_option_says(option, height, goal):
    rig = lone_rig(RepairOptions(lost_place=option), heard=[f"{TWO_AT_8} {height}"])
    rig.wait_until(46.0)
    assert rig.engine.goals == [goal]


def test_the_side_is_the_one_that_keeps_the_links_of_the_lost_node():
    """Neighbour 3 was 8.5 m from it: on the side of the gateway this drone would not reach 3."""
    rig = group_rig(3)
    rig.wait_until(EMERGENCY_S)
    rig.hear(place(3, 16.5), bid(3, 1.0))
    rig.wait_until(BIDS_S + TO_DECISION_S)
    (goal,) = rig.engine.goals
    assert goal.distance_m(Location(16.5, 0.0, 0.0)) < 9.0
    assert goal.distance_m(Location(4.0, 0.0, 0.0)) < 9.0
    assert 1.0 <= goal.distance_m(NEIGHBOUR_PLACE) < 1.2


def test_a_drone_that_was_silent_since_keeps_its_place_and_one_that_moved_does_not():
    rig = lone_rig()
    rig.hear("05 02 01 01 01 00 00 00 41 00 00 c0 bf")  # latitude 8, longitude -1.5
    rig.hear("06 02 01 01 01 00 00 00 41 00 00 c0 3f")  # longitude 1.5
    rig.hear("06 02 01 01 01 00 00 c8 42")  # 6 moved to latitude 100
    rig.wait_until(46.0)
    (goal,) = rig.engine.goals
    assert goal == Location(pytest.approx(8.0), pytest.approx(1.1), 0)


@pytest.mark.parametrize(
    "heard",
    [
        ("07 07 01 01 01 00 00 c8 42", "09 09 45 01 01 3c 00 07 00 00 00 41 00 00 c0 bf"),
        ("09 09 45 01 01 3c 00 07 00 00 c0 7f", "08 08 02 01 01 00 00 c0 7f 00 00 00 00 01 80"),
    ],
    ids=["7 was seen at latitude 100 since", "no numbers"],
)
def test_old_news_and_places_that_are_no_numbers_change_nothing(heard):
    rig = flying_rig()
    rig.hear(*heard)
    assert rig.engine.goals == [BESIDE_NEIGHBOUR]


def test_a_node_that_comes_into_reach_in_flight_is_asked_at_once():
    """It may be the only one that knows who is at the goal, and the next second is too late."""
    rig = flying_rig()
    rig.wait(0.5)
    rig.forget()
    rig.hear("09 09 03 01 fe 00 01", "09 09 03 01 fe 00 01")  # 9 introduces itself, twice
    asked = [sent for sent in rig.sent(REQUEST) if sent[3] == 9]
    assert [sent[4] for sent in asked] == [9]
    rig.hear("09 09 45 01 01 01 00 07 00 00 00 41 00 00 8c bf")  # 7 was at the goal a second ago
    assert rig.engine.goals[-1] != BESIDE_NEIGHBOUR


@pytest.mark.parametrize(
    ("flies", "told"), [("80", [packet("01 01 45 03 03 3c 00 05 00 00 00 41")]), ("00", [])]
)
def test_only_a_drone_in_flight_hears_who_was_last_heard_near_its_goal(rig, flies, told):
    rig.know_neighbour(3)
    rig.hear("05 03 02 01 01 00 00 00 41 00 00 00 00 01 00")  # 5 asks, from latitude 8
    rig.hear("06 03 02 01 01 00 00 48 42 00 00 00 00 01 00")  # 6 asks, from latitude 50
    rig.wait(60.0)
    rig.forget()
    rig.hear(f"03 03 02 01 fe 00 00 e0 40 00 00 00 00 01 {flies}")  # 3 is at, or flies to, 7
    assert rig.sent(LAST_PLACE) == told


@pytest.mark.parametrize(
    ("asked", "knows", "told"),
    [
        ("01", "", [packet("01 01 45 fe fe 3c 00 05 00 00 00 40")]),
        ("01", "05 05 03 01 fe 00 01", []),
        ("fe", "", []),
    ],
    ids=["5 is silent", "5 is a neighbour", "a question to all"],
)
def test_who_asks_this_router_alone_makes_it_tell_all_who_is_silent_beside_it(
    rig, asked, knows, told
):
    """It may step back to the place of this router one day."""
    rig.know_neighbour(3)
    rig.hear("05 03 02 01 01 00 00 00 40 00 00 00 00 01 00")  # 5 asks, from latitude 2
    rig.hear("06 03 02 01 01 00 00 80 40 00 00 00 00 01 00")  # 6 asks, from latitude 4
    rig.wait(60.0)
    if knows:
        rig.hear(knows)
    for again_s in (0.0, 10.0, 20.0):  # all within a minute: once is enough
        rig.wait(again_s)
        rig.hear(f"03 03 02 01 {asked} 00 00 e0 40 00 00 00 00 01 00")  # 3 asks, from latitude 7
    assert [sent for sent in rig.antenna.broadcasts if sent[2] == LAST_PLACE] == told
    rig.wait(31.0)
    rig.hear(f"03 03 02 01 {asked} 00 00 e0 40 00 00 00 00 01 00")
    assert sum(sent[2] == LAST_PLACE for sent in rig.antenna.broadcasts) == 2 * len(told)


def test_who_says_again_and_again_that_it_has_just_connected_is_told_once_in_ten_seconds(rig):
    rig.know_neighbour(3)
    rig.hear("05 03 02 01 01 00 00 00 40 00 00 00 00 01 00")  # 5 asks, from latitude 2
    rig.wait(60.0)
    for _ in range(18):
        rig.hear("03 03 01 01 fe 00 00 e0 40")  # 3 is at latitude 7
        rig.hear("03 03 02 01 01 00 00 e0 40 00 00 00 00 01 00")  # and asks this router
        rig.wait(0.5)
    told = [packet("01 01 45 fe fe 3c 00 05 00 00 00 40")]
    assert [sent for sent in rig.antenna.broadcasts if sent[2] == LAST_PLACE] == told
    rig.wait(2.0)
    rig.hear("03 03 01 01 fe 00 00 e0 40")
    rig.hear("03 03 02 01 01 00 00 e0 40 00 00 00 00 01 00")
    assert sum(sent[2] == LAST_PLACE for sent in rig.antenna.broadcasts) == 2


class Impatient(Thesis):
    """Notes when it is asked for its patience."""

    def __init__(self, rig):
        self.rig = rig
        self.asked_s = []

    def patience(self, silent):
        self.asked_s.append(self.rig[0].now_s)
        return 0.5


def test_a_strategy_is_asked_for_its_patience_at_the_checks_and_at_no_other_time():
    holder = []
    strategy = Impatient(holder)
    rig = Rig(repair=strategy)
    holder.append(rig)
    rig.connect_through(2)
    rig.hear("00 02 01 01 01 00 00 80 40", NEIGHBOUR_2_AT_0_8)
    rig.antenna.dead = {2}
    for _ in range(400):
        rig.hear("03 03 04 01 01")  # a node without a gateway
        rig.wait(0.1)
    assert "EMERGENCY" in rig.kinds()
    assert strategy.asked_s == pytest.approx([15.0, 25.0, 35.0])
    assert rig.kinds().count("EMERGENCY") == 1


def test_a_drone_that_stays_where_it_looked_around_ends_its_elections_in_time():
    rig = lone_rig()
    rig.wait_until(46.0)
    (there,) = rig.engine.goals
    for _ in range(3):
        fly(rig, there)
        rig.know_neighbour(5)  # it has no gateway either, and never bids
    rig.wait(50.0)
    assert rig.kinds()[-2:] == ["NEGOTIATION_ENDED", "FLIGHT_DECIDED"]


# In flight -----------------------------------------------------------------------------------


def flying_rig():
    """As lone_rig, in flight to the place of 2."""
    rig = lone_rig()
    rig.wait_until(46.0)
    assert rig.engine.goals == [BESIDE_NEIGHBOUR]
    rig.forget()
    return rig


def test_in_flight_it_asks_all_nodes_in_range_where_they_are_once_a_second_and_before_it_lands():
    """On its way down it comes into reach of others, and can still turn aside for a moment."""
    rig = flying_rig()
    rig.engine.place = Location(11.0, 0.0, 2.0)
    rig.wait(0.9)
    assert rig.broadcasts() == []
    rig.wait(0.05)  # it took off 1.95 s ago, and will be 1.5 m above its goal
    requests = rig.broadcasts()
    assert len(requests) == 1
    fly(rig, Location(10.0, 0.0, 2.0))
    fly(rig, Location(9.0, 0.0, 2.0))
    requests += rig.broadcasts()
    starts = [request[:9].hex(" ") for request in requests]
    assert starts == ["01 01 02 fe fe 00 00 00 41"] * 3  # latitude 8
    assert [request[13:15].hex(" ") for request in requests] == ["01 80"] * 3  # it flies there


def test_to_the_gateway_it_flies_in_legs_and_presents_itself():
    """So low that it hears nodes on the ground: it lands where it is connected."""
    rig = connected_rig(12.0)
    rig.hear("00 02 01 01 01 00 00 80 40")
    rig.antenna.dead = {2}
    rig.wait_until(EMERGENCY_S + 0.1)
    assert rig.engine.goals == [A_LEG_FROM_12]
    rig.forget()
    fly(rig, Location(9.0, 0.0, 3.0))
    assert packet("01 01 03 fe fe ff") in rig.broadcasts()
    fly(rig, Location(6.0, 0.0, 0.0))
    assert rig.engine.goals == [A_LEG_FROM_12, BESIDE_GATEWAY]
    fly(rig, Location(6.2, 0.0, 0.2))
    rig.hear("00 00 04 01 01 01 00 00")
    assert rig.engine.goals[-1] == Location(6.2, 0.0, 0.0)


def test_one_whose_antenna_goes_off_in_flight_ends_it_where_it_told_the_others_last():
    """Nobody would hear where the next leg ends, so another one could fly to the same place."""
    rig = connected_rig(12.0)
    rig.hear("00 02 01 01 01 00 00 80 40")
    rig.antenna.dead = {2}
    rig.wait_until(EMERGENCY_S + 0.1)
    fly(rig, Location(9.0, 0.0, 3.0))
    switch_off(rig)
    fly(rig, Location(6.0, 0.0, 0.0))
    rig.wait(20.0)
    assert rig.engine.goals == [A_LEG_FROM_12]
    assert rig.kinds()[-1] == "LANDED"


def test_no_leg_ends_on_a_drone_whose_place_is_known_or_told_on_the_way():
    rig = lone_rig()
    rig.hear(UNDERGROUND)  # the place of 2 is nowhere to fly
    rig.hear("05 05 02 01 01 cd cc bc 40 00 00 00 00 01 00")  # node 5 asks, from latitude 5.9
    rig.antenna.dead = {2, 5}
    while not rig.engine.goals:
        rig.wait(1.0)
    (first,) = rig.engine.goals
    assert 1.0 <= first.distance_m(Location(5.9, 0.0, 0.0)) < 1.3
    fly(rig, Location(9.0, 0.0, 3.0))
    flown = len(rig.engine.goals)
    told = struct.pack("<ff", first.latitude + 0.1, first.longitude).hex()
    rig.hear(f"06 06 01 01 01 {told}")
    assert len(rig.engine.goals) == flown + 1
    assert rig.engine.goals[-1].distance_m(first) >= 0.9
    assert rig.engine.goals[-1].height == 0.0


def test_the_last_leg_ends_at_the_goal_and_not_just_before_it(rig):
    """Beside the goal there may be less than the clearance to another drone."""
    rig.engine.place = Location(11.18, 0.0, 0.0)  # a leg of 6 m would end 8 cm before the goal
    rig.connect_through(2)
    rig.hear("00 02 01 01 01 00 00 80 40")
    rig.antenna.dead = {2}
    rig.wait_until(EMERGENCY_S + 0.1)
    fly(rig, rig.engine.goals[-1])
    rig.wait(1.0)
    assert rig.kinds().count("LANDED") == 1
    assert rig.engine.goals == [BESIDE_GATEWAY]


@pytest.mark.parametrize("its_goal_is_taken", [False, True])
def test_in_flight_it_accepts_a_connection_only_if_it_hears_that_its_goal_is_taken(
    its_goal_is_taken,
):
    rig = flying_rig()
    fly(rig, Location(10.0, 0.0, 2.0))
    if its_goal_is_taken:
        rig.hear(NEIGHBOUR_2_AT_0_8)  # 2 lives there after all
    fly(rig, Location(9.5, 0.0, 2.0))
    rig.hear("00 02 04 01 01 01 00 01")
    assert rig.mesh.get_connected_to_gateway() is its_goal_is_taken
    assert (rig.engine.goals[-1] == Location(9.5, 0.0, 0.0)) is its_goal_is_taken


@pytest.mark.parametrize(
    "heard",
    [place(9, 8.0, -1.5), "09 09 45 01 01 3c 00 07 00 00 00 41 00 00 c0 bf"],
    ids=["itself", "from another node, a minute later"],
)
def test_it_lands_beside_a_drone_of_which_it_hears_that_it_is_at_its_goal(heard):
    rig = flying_rig()
    fly(rig, Location(10.0, 0.0, 2.0))
    rig.hear(heard)
    assert len(rig.engine.goals) == 2
    assert rig.engine.goals[-1].distance_m(Location(8.0, -1.5, 0.0)) >= 1.0
    assert 1.0 <= rig.engine.goals[-1].distance_m(NEIGHBOUR_PLACE) < 1.2


@pytest.mark.parametrize(("ago_s", "keeps_clear"), [(4.5, True), (5.5, False)])
def test_with_exact_only_a_drone_that_said_within_five_seconds_where_it_is_takes_its_place(
    ago_s, keeps_clear
):
    def goal_beside(third):
        rig = lone_rig(RepairOptions(lost_place=LostPlace.EXACT))
        rig.wait_until(46.0)
        for node_place in third:
            rig.hear(f"08 08 01 01 01 {struct.pack('<ff', *node_place).hex()}")
        for part in range(1, 12):
            rig.engine.place = Location(12.0 - 0.1 * part, 0.0, 2.0)
            rig.wait(ago_s / 11)
        rig.hear(place(9, 8.1))
        return rig.engine.goals[-1]

    spot = goal_beside([])
    moved_on = goal_beside([(spot.latitude, spot.longitude)])
    assert (moved_on.distance_m(spot) >= 1.0) == keeps_clear


def test_it_stops_where_it_is_connected_if_a_gateway_reached_its_group():
    rig = bidding_rig(3)
    decide(rig, bid(3, 1.0))
    fly(rig, Location(10.0, 0.0, 2.0))
    rig.hear("00 03 04 01 01 01 00 05")
    assert rig.mesh.get_connected_to_gateway()
    assert rig.engine.goals == [BESIDE_NEIGHBOUR, Location(10.0, 0.0, 0.0)]


def test_on_the_ground_it_asks_again_and_moves_aside_for_a_drone_that_it_did_not_hear_before():
    rig = flying_rig()
    fly(rig, rig.engine.goals[-1])
    assert "LANDED" not in rig.kinds()
    rig.hear(place(9, 8.0, -1.5))
    assert rig.engine.goals[-1].distance_m(Location(8.0, -1.5, 0.0)) >= 1.0
    fly(rig, rig.engine.goals[-1])
    rig.wait(1.0)
    assert rig.kinds().count("LANDED") == 1


def test_on_the_ground_it_asks_for_the_places_of_drones_that_it_cannot_hear():
    rig = flying_rig()
    fly(rig, rig.engine.goals[-1])
    requests = [request for request in rig.broadcasts() if request[2] == REQUEST]
    assert [request[13:15].hex(" ") for request in requests] == ["01 80"] * len(requests)
    rig.hear("05 05 45 01 01 00 00 09 00 00 00 41 00 00 c0 bf 00 00")  # 9 was last at (8, -1.5)
    assert rig.engine.goals[-1].distance_m(Location(8.0, -1.5, 0.0)) >= 1.0


@pytest.mark.parametrize(("away_m", "steps_aside"), [(0.45, True), (1.2, False)])
def test_after_a_landing_in_silence_it_asks_who_stands_there_before_it_connects(
    away_m, steps_aside
):
    rig = lone_rig()
    while rig.now_s < 150.0:  # one step and back, and at last to the gateway
        rig.wait(1.0)
        rig.engine.place = here = (rig.engine.goals or [HOME])[-1]
    goals = len(rig.engine.goals)
    assert "FLYING" not in rig.mesh.get_repair_status().state.name
    rig.hear("09 09 03 01 fe 01 01")
    rig.wait(0.2)
    rig.hear(place(9, here.latitude, here.longitude + away_m))
    rig.hear("00 09 04 01 01 01 00 01")
    assert not rig.mesh.get_connected_to_gateway()
    rig.wait(1.0)
    assert len(rig.engine.goals) == goals + steps_aside
    assert rig.engine.goals[-1].distance_m(here._replace(longitude=here.longitude + away_m)) >= 1.0
    if steps_aside:
        fly(rig, rig.engine.goals[-1])
        rig.wait(1.0)
    rig.hear("09 09 03 01 fe 01 01", "00 09 04 01 01 01 00 01")
    assert rig.mesh.get_connected_to_gateway()


# The place of the gateway --------------------------------------------------------------------


@pytest.mark.parametrize("after_s", [0.0, 0.1, 0.35, 0.55])
def test_the_flight_ends_although_the_antenna_goes_off_on_the_ground(after_s):
    rig = flying_rig()
    fly(rig, rig.engine.goals[-1])
    rig.wait(after_s)
    assert "LANDED" not in rig.kinds()
    switch_off(rig)
    rig.wait(1.0)
    assert "LANDED" in rig.kinds()
    rig.antenna.powered = True
    rig.mesh.on_antenna_power(True, rig.now_s)
    rig.wait(0.5)
    assert packet("01 01 03 fe fe ff") in rig.broadcasts()


def test_the_flight_ends_although_a_gateway_answers_on_the_ground():
    rig = flying_rig()
    rig.hear("02 02 01 01 01 00 00 00 41")  # 2 lives there: it may end where it is connected
    fly(rig, rig.engine.goals[-1])
    rig.hear("00 02 04 01 01 01 00 01")
    assert rig.mesh.get_connected_to_gateway()
    assert "LANDED" not in rig.kinds()
    rig.wait(1.0)
    assert "LANDED" in rig.kinds()


def test_a_router_learns_where_the_gateway_is_from_an_answer_that_it_forwards():
    rig = connected_rig()
    rig.know_neighbour(5)
    rig.hear("00 02 01 01 05 00 00 80 40", "07 02 01 01 05 00 00 00 41")
    assert rig.mesh.places.gateway == Location(4.0, 0.0, 0.0)
    assert [payload[4] for payload in rig.sent(LOCATION)] == [5, 5]


def test_a_next_hop_passes_on_where_the_gateway_is_unless_newer_news_came():
    rig = connected_rig()
    relayed = "02 02 01 01 01 00 00 00 41 00 00 00 00 00 00 00 00 00 00 0b 00 00 00 00 80 40"
    rig.hear(relayed)
    assert rig.mesh.places.gateway == Location(4.0, 0.0, 0.0)
    assert rig.mesh.places.gateway_seen_s == -10.0  # ten seconds ago
    rig.hear("09 09 02 01 01")
    (answer,) = rig.sent(LOCATION)
    assert answer[19:] == bytes.fromhex("0b 00 00 00 00 80 40").ljust(13, b"\0")
    rig.hear("00 02 01 01 01 00 00 80 3f", relayed)
    assert rig.mesh.places.gateway == Location(1.0, 0.0, 0.0)


def test_the_gateway_itself_is_asked_before_its_place_is_three_periods_old():
    rig = connected_rig()
    rig.hear("00 02 01 01 01 00 00 80 3f")
    asked_s = []
    for check_s in (5.0, 15.0, 25.0):
        rig.wait_until(check_s)
        rig.hear("00 02 04 01 01 01 00 01")
        if packet("01 01 02 02 00" + FROM_0) in rig.sent(REQUEST):
            asked_s.append(check_s)
    assert asked_s == [25.0]
