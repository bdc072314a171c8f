"""What a router does about a lost connection: wait, negotiate, fly back."""

from __future__ import annotations

import struct

import pytest
from rig import Rig, packet

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.drone.interfaces import Location

HEARTBEAT, PRESENT, MISSING, BID = 4, 3, 5, 7
GATEWAY_AT_0_4 = "00 00 01 01 01 00 00 80 40"  # latitude 4
GATEWAY_PLACE = Location(4.0, 0.0, 0.0)
NEIGHBOUR_2_AT_0_8 = "02 02 01 01 01 00 00 00 41"  # latitude 8
NEIGHBOUR_PLACE = Location(8.0, 0.0, 0.0)


EMERGENCY_S = 45.0


def bid(neighbour: int, score: float) -> str:
    return bytes((neighbour, neighbour, BID, 1, 1)).hex() + struct.pack("<f", score).hex()


def own_bid(to: int, score: float) -> bytes:
    return (bytes((1, 1, BID, to, to)) + struct.pack("<f", score)).ljust(32, b"\0")


def lone_rig():
    """Connected through 2 to gateway 0, whose place is (0, 4); 2 stands at (0, 8). Then 2 dies.

    The check at 5 s notices, the one at 15 s starts the timer, that at EMERGENCY_S acts.
    """
    rig = Rig()
    rig.engine.place = Location(12.0, 0.0, 0.0)
    rig.connect_through(2)
    rig.hear("00 02 01 01 01 00 00 80 40", NEIGHBOUR_2_AT_0_8)
    assert rig.mesh.get_last_good_known_location_id() == 2
    rig.antenna.dead = {2}
    return rig


def group_rig(*neighbours):
    """As above, and among unconnected neighbours that live on."""
    rig = lone_rig()
    rig.know_neighbour(*neighbours)
    return rig


def fly(rig, place):
    """One second of flight."""
    rig.engine.place = place
    rig.wait(1.0)


# The place to step back to -------------------------------------------------------------------


def test_the_place_of_the_next_hop_is_the_one_to_step_back_to():
    rig = Rig()
    rig.connect_through(2)
    rig.hear(NEIGHBOUR_2_AT_0_8, "00 02 01 01 01 00 00 80 40")
    assert rig.mesh.get_last_good_known_location_id() == 2


def test_it_is_the_gateways_when_that_is_the_next_hop():
    rig = Rig()
    rig.connect_to_gateway()
    rig.hear(GATEWAY_AT_0_4)
    assert rig.mesh.get_last_good_known_location_id() == 0


def test_it_is_unknown_until_a_location_arrives():
    rig = Rig()
    rig.connect_through(2)
    assert rig.mesh.get_last_good_known_location_id() == 255


# Flight --------------------------------------------------------------------------------------


def test_an_order_is_flown_and_ends_the_connection():
    rig = Rig()
    rig.connect_through(2)
    rig.hear(GATEWAY_AT_0_4, NEIGHBOUR_2_AT_0_8, "00 02 06 01 01 00 00 80 3f 00 00 00 c0 07 00")
    assert rig.engine.goals == [Location(1.0, -2.0, 7)]
    assert not rig.mesh.get_connected_to_gateway()
    assert rig.mesh.get_hops_from_gateway_away() == 255
    assert rig.mesh.get_last_good_known_location_id() == 0
    assert "FLIGHT_ORDERED" in rig.kinds()


def test_a_drone_that_knows_no_gateway_location_has_no_place_to_step_back_to_after_an_order():
    rig = Rig()
    rig.hear(NEIGHBOUR_2_AT_0_8, "02 02 06 01 01 00 00 80 3f")
    assert rig.mesh.get_last_good_known_location_id() == 255


def test_an_ordered_flight_keeps_the_routes_until_the_landing():
    rig = Rig()
    rig.connect_through(2)
    rig.hear("00 02 06 01 01 00 00 a0 41")
    for latitude in (1.0, 8.0, 15.0):
        fly(rig, Location(latitude, 0.0, 0.0))
        assert rig.routing.get_set_of_children() == {2}
    fly(rig, Location(20.0, 0.0, 0.0))
    assert rig.routing.empty()
    assert rig.mesh.get_neighbours() == {}


def test_it_has_landed_within_a_tenth_of_a_metre_of_the_goal_and_then_introduces_itself():
    rig = Rig()
    rig.connect_through(2)
    rig.hear("00 02 06 01 01 00 00 a0 41")
    rig.forget()
    for latitude in (2.0, 10.0, 19.89):
        fly(rig, Location(latitude, 0.0, 0.0))
        assert "LANDED" not in rig.kinds()
    fly(rig, Location(19.91, 0.0, 0.0))
    assert "LANDED" in rig.kinds()
    assert rig.broadcasts() == [packet("01 01 03 fe fe ff 00")]


def test_it_has_landed_when_it_no_longer_moves():
    rig = Rig()
    rig.hear("02 02 06 01 01 00 00 a0 41")
    fly(rig, Location(7.0, 0.0, 0.0))
    fly(rig, Location(7.5, 0.0, 0.0))
    assert "LANDED" not in rig.kinds()
    fly(rig, Location(7.5, 0.0, 0.0))
    assert "LANDED" in rig.kinds()


def test_it_asks_for_its_position_once_a_second_and_not_before():
    rig = Rig()
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


def test_after_the_landing_the_time_without_a_gateway_counts_from_the_next_check():
    rig = Rig()
    rig.connect_to_gateway()
    rig.hear(GATEWAY_AT_0_4, "00 00 06 01 01 00 00 a0 41")
    for second in range(52):
        fly(rig, Location(second / 3, 0.0, 0.0))
    fly(rig, Location(20.0, 0.0, 0.0))  # at 53 s; checks at 55, 65, 75 and 85 s
    rig.wait_until(84.9)
    assert len(rig.engine.goals) == 1
    rig.wait_until(85.1)
    assert rig.engine.goals[1:] == [GATEWAY_PLACE]


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


def test_the_same_order_during_the_flight_is_no_new_flight():
    rig = Rig()
    rig.hear("00 02 06 01 01 00 00 a0 41", "09 03 06 01 01 00 00 a0 41")
    assert rig.engine.goals == [Location(20.0, 0.0, 0)]


def test_the_same_order_of_a_second_gateway_is_reported_once():
    rig = Rig()
    rig.hear("00 02 06 01 01 00 00 a0 41", "07 02 06 01 01 00 00 a0 41")
    assert rig.kinds().count("FLIGHT_ORDERED") == 1


def test_another_order_during_the_flight_replaces_the_first():
    rig = Rig()
    rig.hear("00 02 06 01 01 00 00 a0 41", "00 02 06 01 01 00 00 80 3f")
    assert rig.engine.goals == [Location(20.0, 0.0, 0), Location(1.0, 0.0, 0)]


@pytest.mark.parametrize(
    "place",
    [
        "00 60 9c 45",  # latitude 5004
        "00 00 00 00 00 60 9c c5",  # longitude -5004
        "00 00 00 00 00 00 00 00 f5 01",  # height 501
        "00 00 00 00 00 00 00 00 ff ff",  # height -1
    ],
)
def test_an_order_out_of_bounds_is_refused_and_counted(place):
    rig = Rig()
    rig.connect_through(2)
    rig.hear(f"00 02 06 01 01 {place}")
    assert rig.engine.goals == []
    assert rig.mesh.get_connected_to_gateway()
    assert rig.mesh.complaints.counts["order refused"] == 1


def test_a_drone_that_cannot_say_where_it_is_now_and_then_flies_on():
    rig = Rig()
    rig.hear("02 02 06 01 01 00 00 fa 43")
    for second in range(30):
        fly(rig, Location(2.0 * second, 0.0, 0.0) if second % 3 == 0 else None)
    assert "LANDED" not in rig.kinds()


def test_a_drone_that_cannot_say_where_it_is_does_not_fly_for_ever():
    rig = Rig()
    rig.hear("02 02 06 01 01 00 00 a0 41")
    rig.engine.place = None
    rig.wait(30.0)
    assert "LANDED" in rig.kinds()


def test_a_heartbeat_that_is_answered_in_flight_counts_no_more_after_the_landing():
    rig = Rig()
    rig.connect_through(2)
    rig.hear("00 02 06 01 01 00 00 a0 41", "00 02 04 01 01 01 00 01")
    assert rig.mesh.get_connected_to_gateway()
    fly(rig, Location(20.0, 0.0, 0.0))
    assert "LANDED" in rig.kinds()
    assert not rig.mesh.get_connected_to_gateway()


# Lost connection -----------------------------------------------------------------------------


def test_a_lost_gateway_is_dropped_and_the_neighbours_are_informed():
    rig = Rig()
    rig.connect_through(2)
    rig.routing.other_can_communicate_with_node(3, 0)
    rig.mesh.send_heartbeat(0)
    rig.wait_until(4.9)
    rig.forget()
    assert rig.mesh.get_hops_from_gateway_away() == 2
    rig.wait_until(5.1)
    assert rig.mesh.get_hops_from_gateway_away() == 255
    assert rig.mesh.get_route_to_gateway() == NO_ROUTE
    assert rig.sent(MISSING) == [packet("01 01 05 02 02 00"), packet("01 01 05 03 03 00")]
    assert rig.routing.get_set_of_children() == {2, 3}


def test_a_router_that_never_knew_a_gateway_has_none_to_drop():
    rig = Rig()
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
    rig.mesh.send_heartbeat(0)  # never answered
    rig.wait_until(0.9)
    rig.antenna.dead = {2}
    rig.wait_until(flies_at_s - 0.1)
    assert rig.engine.goals == []
    rig.wait_until(flies_at_s + 0.1)
    assert rig.engine.goals == [NEIGHBOUR_PLACE]


def test_the_timer_is_off_when_a_gateway_answers():
    rig = lone_rig()
    rig.wait_until(34.0)
    assert not rig.mesh.get_connected_to_gateway()
    rig.hear("00 03 04 01 01 01 00 04")
    rig.mesh.send_heartbeat(0)  # taken, but never answered
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
    assert rig.engine.goals[:1] == [NEIGHBOUR_PLACE]
    assert rig.kinds().count("EMERGENCY") == 1
    assert rig.mesh.get_last_good_known_location_id() == 0


def test_a_router_that_knows_no_other_place_flies_to_the_gateway():
    rig = Rig()
    rig.engine.place = Location(12.0, 0.0, 0.0)
    rig.connect_through(2)
    rig.hear("00 02 01 01 01 00 00 80 40")
    assert rig.mesh.get_last_good_known_location_id() == 255
    rig.antenna.dead = {2}
    rig.wait_until(60.0)
    assert rig.engine.goals[:1] == [GATEWAY_PLACE]


def test_after_one_step_back_the_next_one_is_to_the_gateway():
    rig = lone_rig()
    rig.wait_until(46.0)
    fly(rig, NEIGHBOUR_PLACE)
    rig.wait_until(120.0)
    assert rig.engine.goals[:2] == [NEIGHBOUR_PLACE, GATEWAY_PLACE]


def test_a_router_that_knows_no_place_at_all_stays():
    rig = Rig()
    rig.wait_until(200.0)
    assert rig.engine.goals == []
    assert rig.kinds().count("EMERGENCY") > 1


@pytest.mark.parametrize(
    "place", ["00 60 9c 45", "ff ff 7f 7f ff ff 7f 7f", "00 00 00 00 00 00 00 00 ff ff"]
)
def test_a_place_where_no_drone_may_go_is_nowhere_to_fly(place):
    """Anybody can say anything of where he is."""
    rig = Rig()
    rig.connect_through(2)
    rig.hear(f"00 02 01 01 01 {place}", f"02 02 01 01 01 {place}")
    rig.antenna.dead = {2}
    rig.wait_until(100.0)
    assert rig.engine.goals == []


def test_a_next_hop_that_says_nonsense_does_not_hide_the_place_of_the_gateway():
    rig = lone_rig()
    rig.hear("02 02 01 01 01 00 60 9c 45")
    rig.antenna.dead = {2}
    rig.wait_until(60.0)
    assert rig.engine.goals[:1] == [GATEWAY_PLACE]


# Negotiation ---------------------------------------------------------------------------------


def test_with_neighbours_it_bids_its_distance_to_the_gateway_in_three_dimensions():
    rig = group_rig(3, 4)
    rig.engine.place = Location(12.0, 8.0, 1.0)  # 8, 8 and 1 m away: the root of 129
    rig.wait_until(EMERGENCY_S - 0.1)
    assert rig.sent(BID) == []
    rig.wait_until(EMERGENCY_S + 0.1)
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
    rig.wait_until(EMERGENCY_S + 0.1)  # its own score is 8
    for neighbour, score in bids:
        assert rig.engine.goals == []
        rig.hear(bid(neighbour, score))
    assert rig.engine.goals == ([NEIGHBOUR_PLACE] if flies else [])
    assert rig.kinds().count("NEGOTIATION_ENDED") == 1


def test_of_equal_scores_the_lowest_id_flies():
    rig = Rig(node_id=5)
    rig.engine.place = Location(12.0, 0.0, 0.0)
    rig.hear("00 02 04 05 05 01 00 01", "00 02 01 05 05 00 00 80 40", "02 02 01 05 05 00 00 00 41")
    rig.antenna.dead = {2}
    rig.hear("03 03 00 05 05")
    rig.wait_until(35.1)
    rig.hear("03 03 07 05 05 00 00 00 41")
    assert rig.engine.goals == []
    assert rig.events[-1].peer == 3


def test_scores_are_compared_as_they_are_on_the_air():
    """Two drones at one place: rounded to a float32, each bid looks higher than one's own."""
    rig = group_rig(3)
    rig.engine.place = Location(4.0, 10.1, 0.0)  # 10.1 is 10.10000038 as a float32
    rig.wait_until(EMERGENCY_S + 0.1)
    rig.hear(bid(3, 10.1))
    assert rig.engine.goals == [NEIGHBOUR_PLACE]


def test_no_router_flies_without_a_bid():
    rig = Rig()
    rig.know_neighbour(3)
    rig.wait_until(35.1)
    assert rig.sent(BID) == [own_bid(3, -1.0)]
    rig.hear(bid(3, -1.0))
    assert rig.engine.goals == []
    assert rig.events[-1].peer == NO_ROUTE


def test_a_router_that_would_take_the_place_of_a_neighbour_does_not_bid():
    rig = group_rig(2, 3)
    rig.antenna.dead = set()  # it takes the heartbeats for the gateway, and no answer comes
    rig.wait_until(EMERGENCY_S + 0.1)
    assert own_bid(3, -1.0) in rig.sent(BID)


def test_a_router_that_knows_no_gateway_location_does_not_bid():
    rig = Rig()
    rig.hear(NEIGHBOUR_2_AT_0_8)
    rig.antenna.dead = {2}
    rig.know_neighbour(3)
    rig.wait_until(35.1)
    assert rig.sent(BID) == [own_bid(3, -1.0)]


def test_a_router_that_knows_only_the_place_of_the_gateway_bids_for_flying_there():
    """Else a group of such drones would stay for ever (the place to fly to without neighbours)."""
    rig = Rig()
    rig.engine.place = Location(12.0, 0.0, 0.0)
    rig.connect_through(2)
    rig.hear("00 02 01 01 01 00 00 80 40")
    rig.antenna.dead = {2}
    rig.know_neighbour(3)
    rig.wait_until(EMERGENCY_S + 0.1)
    assert rig.sent(BID) == [own_bid(3, 8.0)]
    rig.hear(bid(3, 1.0))
    assert rig.engine.goals == [GATEWAY_PLACE]


def test_a_router_that_does_not_know_its_location_does_not_bid():
    rig = group_rig(3)
    rig.engine.place = None
    rig.wait_until(EMERGENCY_S + 0.1)
    assert rig.sent(BID) == [own_bid(3, -1.0)]


def test_a_gateway_that_says_it_is_beyond_all_bounds_does_not_break_the_bids():
    rig = group_rig(3)
    rig.hear("00 03 01 01 01 ff ff 7f 7f ff ff 7f 7f", "00 03 04 01 01 01 00 05")
    rig.wait_until(100.0)
    assert len(rig.sent(BID)) >= 1


def test_a_neighbour_that_does_not_bid_is_waited_for_no_longer_than_a_period():
    rig = group_rig(3, 4)
    rig.wait_until(EMERGENCY_S + 0.1)
    rig.hear(bid(3, 1.0))
    rig.wait_until(EMERGENCY_S + 9.9)
    assert rig.engine.goals == []
    rig.wait_until(EMERGENCY_S + 10.1)
    assert rig.engine.goals == [NEIGHBOUR_PLACE]
    assert rig.kinds().count("EMERGENCY") == 1


def test_a_neighbour_that_dies_in_the_middle_is_not_waited_for():
    rig = group_rig(3, 4)
    rig.wait_until(EMERGENCY_S + 0.1)
    rig.hear(bid(3, 1.0))
    rig.antenna.dead = {2, 4}
    rig.mesh.send_heartbeat(4)
    rig.wait(0.1)
    assert rig.engine.goals == [NEIGHBOUR_PLACE]


def test_a_neighbour_that_dies_while_the_bid_is_sent_is_not_waited_for():
    rig = group_rig(3)
    rig.antenna.gets_lost = lambda payload: payload[2] == BID
    rig.wait_until(EMERGENCY_S + 0.1)
    assert rig.engine.goals == [NEIGHBOUR_PLACE]


def test_bids_that_came_before_the_emergency_count():
    rig = group_rig(3, 4)
    rig.wait_until(14.0)  # its timer starts at 15 s
    rig.hear(bid(3, 9.0))
    assert rig.sent(BID) == []
    rig.wait_until(16.0)
    rig.hear(bid(4, 1.0))
    assert rig.events[-1].kind.name == "NEGOTIATION_ENDED"
    assert rig.events[-1].peer == 3


def test_a_bid_makes_an_unconnected_node_with_a_running_timer_join_at_once():
    rig = group_rig(3, 4)
    rig.wait_until(20.0)
    rig.hear(bid(3, 1.0))
    assert rig.sent(BID) == [own_bid(3, 8.0), own_bid(4, 8.0)]
    rig.hear(bid(4, 2.0))
    assert rig.engine.goals == [NEIGHBOUR_PLACE]


def test_a_bid_before_the_timer_runs_is_kept_and_not_answered():
    rig = group_rig(3)
    rig.mesh.send_heartbeat(0)
    rig.wait(0.6)
    rig.hear(bid(3, 9.0))
    assert rig.sent(BID) == []


def test_a_connected_node_does_not_negotiate():
    rig = Rig()
    rig.connect_through(2)
    rig.hear(NEIGHBOUR_2_AT_0_8, bid(3, 9.0))
    rig.wait(1.0)
    assert rig.sent(BID) == []
    assert "NEGOTIATION_STARTED" not in rig.kinds()


def test_switching_the_antenna_off_ends_a_negotiation():
    rig = group_rig(3, 4)
    rig.wait_until(EMERGENCY_S + 0.1)
    rig.antenna.powered = False
    rig.mesh.on_antenna_power(False, rig.now_s)
    rig.wait(12.0)
    assert rig.engine.goals == []
    assert "NEGOTIATION_ENDED" not in rig.kinds()


def test_becoming_connected_ends_a_negotiation():
    rig = group_rig(3, 4)
    rig.wait_until(EMERGENCY_S + 0.1)
    rig.hear("00 03 04 01 01 01 00 03", bid(3, 1.0), bid(4, 1.0))
    rig.wait(12.0)
    assert rig.engine.goals == []
    assert "NEGOTIATION_ENDED" not in rig.kinds()


def test_old_bids_do_not_count():
    """Node 4 bid more once, and is not there any more."""
    rig = group_rig(3)
    rig.mesh.on_msg(packet(bid(4, 99.0)), rig.now_s)
    rig.antenna.dead = {2, 4}
    rig.wait_until(EMERGENCY_S + 0.1)
    rig.hear(bid(3, 1.0))
    assert rig.engine.goals == [NEIGHBOUR_PLACE]


def test_the_list_is_cleared_after_a_negotiation():
    rig = group_rig(3, 4)
    rig.wait_until(EMERGENCY_S + 0.1)
    rig.hear(bid(3, 99.0), bid(4, 1.0))
    assert rig.kinds().count("NEGOTIATION_ENDED") == 1
    rig.wait_until(EMERGENCY_S + 10.05)  # the timer runs again
    rig.hear(bid(4, 1.0))
    assert rig.kinds().count("NEGOTIATION_STARTED") == 2
    assert rig.kinds().count("NEGOTIATION_ENDED") == 1  # what 3 bids now is not known


def test_a_late_bid_does_not_start_the_same_negotiation_again():
    rig = group_rig(3, 4)
    rig.wait_until(EMERGENCY_S + 0.1)
    rig.hear(bid(3, 99.0), bid(4, 1.0))
    rig.forget()
    rig.hear(bid(4, 2.0))
    assert rig.sent(BID) == []
    assert rig.engine.goals == []


def test_an_emergency_flight_forgets_the_routes_when_it_starts():
    rig = group_rig(3)
    rig.wait_until(EMERGENCY_S + 0.1)
    rig.hear(bid(3, 1.0))
    assert rig.routing.empty()
    assert rig.mesh.get_neighbours() == {}
    assert "FLIGHT_DECIDED" in rig.kinds()


def test_a_node_in_flight_does_not_negotiate():
    rig = Rig()
    rig.connect_to_gateway()
    rig.hear(GATEWAY_AT_0_4, "00 00 06 01 01 00 00 fa 43")
    rig.forget()
    for second in range(1, 60):
        fly(rig, Location(2.0 * second, 0.0, 0.0))
        rig.hear(bid(3, 9.0))
    assert rig.sent(BID) == []
    assert len(rig.engine.goals) == 1
