"""How a router gets, keeps and judges its connection to a gateway."""

from __future__ import annotations

from dataclasses import replace

import pytest
from rig import FROM_0, AlwaysHalf, Rig, packet

from drone_mesh.communication.interfaces import NO_SEALS, IMeshSeals
from drone_mesh.communication.routing.techniques.etx_tree import EtxTree
from drone_mesh.communication.timing import QUEUED, Medium, MeshTiming
from drone_mesh.drone.location import Location

LOCATION, HEARTBEAT, PRESENT, REQUEST, MISSING = 1, 4, 3, 2, 5
ANSWER = "00 00 04 01 01 01 00 00"  # of gateway 0, a neighbour
INTRODUCTION_1_HOP = "01 01 03 fe fe 01 01"
OWN_PLACE = packet("01 01 01 fe fe")  # (0, 0, 0), no goal, at 0 s


def connected_rig():
    rig = Rig()
    rig.connect_to_gateway()
    return rig


SHORTCUT = "03 03 03 01 fe 02 01"  # 3 introduces itself: two hops from its gateway


def distant_rig(*heard):
    """Connected through 2, five hops from gateway 0; it hears these packets."""
    rig = Rig()
    rig.connect_through(2, hops=4)
    rig.hear(*heard)
    return rig


class WithKey(IMeshSeals):
    has_key = True


GATEWAY_IS_NONE = "00 00 03 01 fe ff 00"  # its PRESENT, with 255 hops and no gateway


@pytest.mark.parametrize(
    ("seals", "connected", "asked"),
    [(NO_SEALS, False, []), (WithKey(), True, [packet("01 01 04 00 00 01 00 00")])],
    ids=["no key", "key"],
)
def test_with_a_key_a_gateway_is_asked_whether_it_is_none_now(seals, connected, asked):
    """Any captured node can broadcast in its name."""
    rig = Rig(seals=seals)
    rig.connect_to_gateway()
    rig.wait(1.0)
    rig.forget()
    rig.hear(GATEWAY_IS_NONE)
    assert rig.mesh.get_connected_to_gateway() is connected
    assert rig.sent(HEARTBEAT) == asked


# Becoming connected --------------------------------------------------------------------------


def test_a_router_starts_unconnected_with_255_for_what_it_does_not_know():
    mesh = Rig().mesh
    assert not mesh.get_connected_to_gateway()
    assert mesh.get_hops_from_gateway_away() == mesh.get_preferred_gateway() == 255
    assert mesh.get_last_good_known_location_id() == mesh.get_route_to_gateway() == 255
    assert mesh.get_router_tech_table_size() == mesh.get_total_message_sent() == 0


@pytest.mark.parametrize(("hops", "shown"), [(0, 1), (3, 4), (253, 254), (254, 255), (255, 255)])
def test_a_heartbeat_of_a_gateway_connects_with_one_hop_more_than_it_made(rig, hops, shown):
    rig.hear(f"09 02 04 01 01 01 09 {hops:02x}")
    assert rig.mesh.get_connected_to_gateway()
    assert rig.mesh.get_preferred_gateway() == 9
    assert rig.mesh.get_hops_from_gateway_away() == shown
    assert rig.mesh.get_route_to_gateway() == 2


def test_a_router_that_does_not_know_its_distance_waits_as_long_as_for_ten_hops():
    rig = Rig(medium=replace(Medium(), answer_s=1.0, answer_per_hop_s=0.2))
    rig.know_neighbour(0)
    rig.mesh.control.told_of_gateway(0)
    for wait_s, sent in ((2.9, 1), (0.2, 0), (0.0, 1)):
        rig.mesh.control.send_heartbeat(0)
        assert len(rig.sent(HEARTBEAT)) == sent
        rig.wait(wait_s)


@pytest.mark.parametrize(("patience", "waits_s"), [(0.0, 1.4), (0.5, 2.1), (20.0, 10.0)])
def test_on_a_busy_channel_a_connected_router_waits_longer_for_an_answer(patience, waits_s):
    rig = Rig(medium=replace(Medium(), answer_s=1.0, answer_per_hop_s=0.2))
    rig.antenna.periods = patience
    rig.connect_through(2)
    rig.mesh.control.send_heartbeat(0)
    rig.wait(waits_s - 0.1)
    assert rig.mesh.get_connected_to_gateway()
    rig.wait(0.2)
    assert not rig.mesh.get_connected_to_gateway()


def test_becoming_connected_introduces_the_node_at_once(rig):
    rig.hear(ANSWER)
    assert rig.broadcasts() == [packet(INTRODUCTION_1_HOP), OWN_PLACE]
    assert "CONNECTED" in rig.kinds()


@pytest.mark.parametrize(("moved_m", "tells"), [(0.0, False), (0.05, False), (0.2, True)])
def test_a_router_that_connects_again_tells_its_place_only_if_it_is_another(rig, moved_m, tells):
    """The spots of other drones allow for 0.09 m; farther off they might be too near."""
    rig.hear(ANSWER)
    rig.mesh.control.send_heartbeat(0)
    rig.wait(0.7)
    rig.engine.place = Location(moved_m, 0.0, 0.0)
    rig.forget()
    rig.hear(ANSWER)
    assert (len([sent for sent in rig.broadcasts() if sent[2] == LOCATION]) == 1) is tells


def test_a_router_that_connects_tells_all_in_range_where_it_stands(rig):
    """They may have to land beside it, if it dies before anybody asks it."""
    rig.engine.place = Location(1.0, 2.0, 3)
    rig.hear(ANSWER)
    assert rig.broadcasts()[1] == packet("01 01 01 fe fe 00 00 80 3f 00 00 00 40 03 00")


def test_staying_connected_is_no_reason_to_introduce_the_node():
    rig = connected_rig()
    rig.hear(ANSWER)
    assert rig.broadcasts() == []


@pytest.mark.parametrize(
    ("answer", "asked"),
    [
        (ANSWER, ["01 01 02 00 00"]),
        ("00 02 04 01 01 01 00 01", ["01 01 02 02 00", "01 01 02 02 02"]),
    ],
    ids=["next door", "behind 2"],
)
def test_becoming_connected_asks_the_gateway_and_the_next_hop_for_their_locations(
    rig, answer, asked
):
    rig.hear(answer)
    assert rig.sent() == [packet(request + FROM_0) for request in asked]


# The check -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("hop", "sent"),
    [
        (2, ["01 01 04 02 02 01", "01 01 04 02 00 01"]),  # the first: routing maintains its child
        (0, ["01 01 04 00 00 01"]),
    ],
)
def test_a_connected_router_checks_with_a_heartbeat_to_its_gateway(rig, hop, sent):
    rig.connect_through(hop)
    rig.wait_until(5.0)
    assert rig.sent(HEARTBEAT) == list(map(packet, sent))


def test_the_location_of_the_gateway_is_asked_for_until_it_is_known(rig):
    rig.connect_through(2)
    rig.wait_until(5.0)
    assert packet("01 01 02 02 00" + FROM_0) in rig.sent(REQUEST)
    rig.hear("00 02 04 01 01 01 00 01", "00 02 01 01 01 00 00 80 3f")
    rig.wait_until(15.0)
    assert rig.sent(REQUEST) == [packet("01 01 02 02 02" + FROM_0)]  # the next hop, in each round


@pytest.mark.parametrize("neighbour", [0, 2], ids=["gateway", "router"])
def test_the_location_of_the_next_hop_is_asked_for_in_each_round(rig, neighbour):
    rig.connect_through(neighbour, hops=0)
    for check_s in (5.0, 15.0, 25.0):
        rig.wait_until(check_s)
        assert packet(f"01 01 02 0{neighbour} 0{neighbour}" + FROM_0) in rig.sent(REQUEST)
        rig.hear(f"00 0{neighbour} 04 01 01 01 00 00", "00 02 01 01 01 00 00 80 3f")


def test_a_check_finds_an_antenna_that_is_off_and_does_nothing_but_disconnect():
    rig = connected_rig()
    rig.antenna.powered = False
    rig.wait_until(5.0)
    assert not rig.mesh.get_connected_to_gateway()
    assert (rig.tried(), rig.broadcasts()) == ([], [])


# Waiting for the answer ----------------------------------------------------------------------


def test_a_heartbeat_that_is_not_answered_ends_the_connection_until_a_late_answer():
    """Its flag is that before it left. One is under way at a time, for half a second."""
    rig = connected_rig()
    rig.know_neighbour(2)
    rig.mesh.control.send_heartbeat(2)  # says nothing of the connection
    rig.wait(0.6)
    rig.forget()
    assert rig.mesh.control.send_heartbeat(0)
    rig.wait(0.4)
    assert rig.mesh.control.send_heartbeat(0)
    assert rig.sent(HEARTBEAT) == [packet("01 01 04 00 00 01 00 00")]
    assert rig.mesh.get_connected_to_gateway()
    rig.wait(0.2)
    assert not rig.mesh.get_connected_to_gateway()
    assert rig.kinds()[-1] == "DISCONNECTED"
    assert rig.mesh.get_hops_from_gateway_away() == 1
    rig.mesh.control.send_heartbeat(0)
    assert len(rig.sent(HEARTBEAT)) == 1
    rig.wait(0.7)
    rig.hear(ANSWER)
    assert rig.mesh.get_connected_to_gateway()
    rig.mesh.control.send_heartbeat(0)
    rig.hear(ANSWER)
    rig.wait(2.0)
    assert rig.kinds()[-1] == "CONNECTED"


def test_an_answer_after_the_connection_was_lost_is_a_new_connection(rig):
    """Introduced, and the places asked for: the first question may have been lost with it."""
    rig.connect_through(2)
    rig.mesh.control.send_heartbeat(0)
    rig.wait(0.7)
    rig.forget()
    rig.hear("00 02 04 01 01 01 00 01")
    assert rig.broadcasts() == [packet("01 01 03 fe fe 02 01")]  # its place is known since then
    assert rig.sent(REQUEST) == [
        packet("01 01 02 02 00" + FROM_0),
        packet("01 01 02 02 02" + FROM_0),
    ]


def test_a_heartbeat_without_an_acknowledgement_ends_the_connection_at_once():
    rig = connected_rig()
    rig.antenna.dead = {0}
    assert not rig.mesh.control.send_heartbeat(0)
    assert not rig.mesh.get_connected_to_gateway()


def test_waiting_for_the_first_answer_is_not_being_connected(rig):
    rig.hear("02 02 04 01 01 01 00 00")
    assert rig.sent(HEARTBEAT) == [packet("01 01 04 02 00 00 00 00")]
    assert not rig.mesh.get_connected_to_gateway()
    rig.mesh.control.search_other_nodes_in_range()
    assert rig.broadcasts() == [packet("01 01 03 fe fe ff 00")]
    rig.hear("03 03 04 01 01 00 ff 00")  # knows none: there is nothing to tell it
    assert rig.sent() == []


def test_while_the_first_answer_is_waited_for_no_other_offer_is_taken(rig):
    rig.hear("02 02 04 01 01 01 00 00")
    rig.forget()
    rig.hear("03 03 03 01 fe 02 01", "03 03 04 01 01 01 09 00")
    assert rig.tried() == []
    assert rig.mesh.get_preferred_gateway() == 0
    rig.wait(0.6)
    rig.hear("03 03 04 01 01 01 09 00")
    assert rig.mesh.get_preferred_gateway() == 9


def test_a_check_while_the_first_answer_is_waited_for_does_not_drop_the_route(rig):
    rig.wait_until(4.8)
    rig.hear("02 02 04 01 01 01 00 00")
    rig.wait_until(5.1)
    assert rig.sent(5) == []
    assert rig.mesh.get_route_to_gateway() == 2
    rig.hear("00 02 04 01 01 01 00 01")
    assert rig.mesh.get_connected_to_gateway()


# Heartbeats of routers -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("connected", "heard", "sent", "gateway"),
    [
        (True, "05 02 04 01 01 00 ff 01", "01 01 04 02 05 01 00 00", 0),  # knows no gateway
        (True, "02 02 04 01 01 01 09 00", None, 0),  # connected as well, to another gateway
        (True, "02 02 04 01 01 01 00 00", None, 0),  # and to mine
        (False, "02 02 04 01 01 01 09 00", "01 01 04 02 09 00 09 00", 9),  # taken and tried
        (False, "02 02 04 01 01 00 ff 00", None, 255),  # two that are not connected
        (False, "03 03 04 01 01 00 09 00", None, 255),
        (False, "02 02 04 01 01 01 01 00", None, 255),  # gateways that cannot be
        (False, "02 02 04 01 01 01 fe 00", None, 255),
        (False, "02 02 04 01 01 01 ff 00", None, 255),
        (False, "01 02 04 01 01 01 01 00", None, 255),  # a router is not its own
        (True, "02 02 03 01 fe ff 00", "01 01 04 02 02 01 00 00", 0),  # introductions
        (True, "02 02 03 01 fe 03 01", None, 0),
        (False, "02 02 03 01 fe 03 01", "01 01 04 02 02 00 ff 00", 255),
        (False, "02 02 03 01 fe ff 00", None, 255),
    ],
)
def test_a_router_answers_one_that_lacks_what_it_has_and_asks_one_that_has_what_it_lacks(
    connected, heard, sent, gateway
):
    rig = connected_rig() if connected else Rig()
    rig.hear(heard)
    assert rig.tried() == ([packet(sent)] if sent else [])
    assert rig.mesh.get_preferred_gateway() == gateway
    assert rig.mesh.get_connected_to_gateway() is connected


def test_taking_a_gateway_drops_every_other_entry_for_it(rig):
    rig.know_neighbour(9)
    rig.hear("09 03 00 01 01")
    rig.routing.other_can_communicate_with_node(3, 9)
    rig.hear("02 02 04 01 01 01 09 00")
    assert rig.routing.get_direction_to_node(9) == 2
    assert rig.routing.other_cant_communicate_with_node(2, 9) == 1  # the last way
    assert rig.sent() == [packet("01 01 04 02 09 00 09 00")]


# Shortcuts -----------------------------------------------------------------------------------


def test_the_next_heartbeat_tries_a_neighbour_with_fewer_hops():
    rig = distant_rig(SHORTCUT)
    rig.mesh.control.send_heartbeat(0)
    assert rig.sent(HEARTBEAT) == [packet("01 01 04 03 00 01 00 00")]
    rig.hear("00 03 04 01 01 01 00 02")
    assert rig.mesh.get_hops_from_gateway_away() == 3
    assert rig.mesh.get_route_to_gateway() == 3


@pytest.mark.parametrize(
    ("heard", "next_hop"),
    [
        (["03 03 03 01 fe 03 01", "04 04 03 01 fe 01 01", "05 05 03 01 fe 02 01"], 4),  # the fewest
        (["03 03 03 01 fe 04 01"], 2),  # as many as now
        (["03 03 03 01 fe ff 01"], 2),
        ([SHORTCUT, "03 03 03 01 fe 06 01"], 2),  # its route has become longer
        (["05 03 03 01 fe 01 01"], 2),  # 3 is no neighbour with these hops: it relays
        (["01 03 03 01 fe 01 01"], 2),  # or returns our own introduction
    ],
)
def test_the_neighbour_with_the_fewest_hops_is_tried_if_that_shortens_the_route(heard, next_hop):
    rig = distant_rig(*heard)
    rig.mesh.control.send_heartbeat(0)
    assert rig.tried(HEARTBEAT) == [packet(f"01 01 04 0{next_hop} 00 01 00 00")]


def test_an_introduction_counts_for_one_heartbeat():
    rig = distant_rig(SHORTCUT)
    for next_hop in (3, 2):
        rig.forget()
        rig.mesh.control.send_heartbeat(0)
        assert rig.sent(HEARTBEAT) == [packet(f"01 01 04 0{next_hop} 00 01 00 00")]
        rig.wait(0.1)
        rig.hear("00 02 04 01 01 01 00 04")
        rig.wait(0.5)


def test_a_shortcut_without_an_answer_is_avoided_for_a_minute():
    rig = Rig(timing=MeshTiming(check_period_s=1000.0))
    rig.connect_through(2, hops=4)

    def next_hop_after(shortcut):
        rig.hear(shortcut)
        rig.forget()
        rig.mesh.control.send_heartbeat(0)
        return rig.sent(HEARTBEAT)[0][3]

    assert next_hop_after("03 03 03 01 fe 02 01") == 3
    rig.wait(0.6)
    assert rig.sent(HEARTBEAT) == [packet("01 01 04 02 00 01 00 00")]
    rig.hear("00 02 04 01 01 01 00 04")
    rig.wait(59.0)
    assert next_hop_after("03 03 03 01 fe 02 01") == 2
    rig.hear("00 02 04 01 01 01 00 04")
    rig.wait(2.0)
    assert next_hop_after("03 03 03 01 fe 02 01") == 3


def test_a_shortcut_that_does_not_take_the_heartbeat_is_no_loss():
    rig = distant_rig(SHORTCUT)
    rig.antenna.dead = {3}
    assert rig.mesh.control.send_heartbeat(0)
    assert rig.sent(HEARTBEAT) == [packet("01 01 04 02 00 01 00 00")]


def test_a_neighbour_nearer_to_another_gateway_is_a_shortcut_to_that_one_only():
    """Its few hops do not lead to the own gateway, whose heartbeat takes the usual route."""
    rig = distant_rig("03 03 04 01 01 01 09 00", "03 03 03 01 fe 02 01")
    rig.mesh.control.send_heartbeat(0)
    assert rig.sent(HEARTBEAT) == [
        packet("01 01 04 03 09 01 00 00"),
        packet("01 01 04 02 00 01 00 00"),
    ]
    rig.hear("09 03 04 01 01 01 09 02")
    assert rig.mesh.get_preferred_gateway() == 9
    assert rig.mesh.get_hops_from_gateway_away() == 3
    rig.hear("00 02 04 01 01 01 00 04")
    assert rig.mesh.get_preferred_gateway() == 9


def test_a_shortcut_from_before_the_loss_does_not_count():
    rig = distant_rig()
    rig.mesh.control.send_heartbeat(0)
    rig.hear("03 03 03 01 fe 02 01")
    rig.wait_until(5.0)
    rig.forget()
    rig.hear("02 02 04 01 01 01 00 00")
    assert rig.sent(HEARTBEAT) == [packet("01 01 04 02 00 00 00 00")]


# Several gateways ----------------------------------------------------------------------------


@pytest.mark.parametrize(("hops", "preferred"), [("01", 9), ("02", 0), ("fe", 0)])
def test_a_connected_router_changes_its_gateway_only_for_fewer_hops(rig, hops, preferred):
    rig.connect_through(2, hops=2)
    rig.hear(f"09 03 04 01 01 01 09 {hops}")
    assert rig.mesh.get_preferred_gateway() == preferred
    assert rig.mesh.get_hops_from_gateway_away() == (int(hops, 16) + 1 if preferred else 3)


def test_the_own_gateway_is_believed_whatever_it_says(rig):
    rig.connect_through(2, hops=2)
    rig.hear("00 03 04 01 01 01 00 07")
    assert rig.mesh.get_hops_from_gateway_away() == 8


def test_within_a_period_of_the_last_answer_a_lost_gateway_is_not_given_up_for_a_far_one(rig):
    rig.connect_through(2, hops=2)
    rig.mesh.control.send_heartbeat(0)
    rig.wait(1.0)
    assert not rig.mesh.get_connected_to_gateway()
    rig.hear("09 03 04 01 01 01 09 02")
    assert rig.mesh.get_preferred_gateway() == 0
    rig.wait(9.5)
    rig.hear("09 03 04 01 01 01 09 02")
    assert rig.mesh.get_preferred_gateway() == 9
    assert rig.mesh.get_connected_to_gateway()


def test_another_gateway_has_another_location(rig):
    rig.connect_through(2, hops=2)
    rig.hear("00 02 01 01 01 00 00 80 3f", "09 03 04 01 01 01 09 01")
    rig.forget()
    rig.wait_until(5.0)
    assert packet("01 01 02 03 09" + FROM_0) in rig.sent(REQUEST)


# Power ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("waits", [False, True])
def test_switching_off_disconnects_at_once(waits):
    rig = connected_rig()
    if waits:
        rig.mesh.control.send_heartbeat(0)
        rig.forget()
    rig.antenna.powered = False
    rig.mesh.on_antenna_power(False, rig.now_s)
    assert not rig.mesh.get_connected_to_gateway()
    assert rig.mesh.get_hops_from_gateway_away() == 255
    rig.wait(60.0)
    assert (rig.tried(), rig.broadcasts(), rig.engine.goals) == ([], [], [])


def test_the_time_without_a_gateway_does_not_count_while_the_antenna_is_off(rig):
    rig.connect_through(2)
    rig.mesh.control.send_heartbeat(0)  # never answered
    rig.hear("02 02 01 01 01 00 00 80 3f")
    rig.antenna.dead = {2}
    rig.wait_until(16.0)  # the timer runs since 5 s
    rig.antenna.powered = False
    rig.mesh.on_antenna_power(False, rig.now_s)
    rig.wait_until(30.0)
    rig.antenna.powered = True
    rig.mesh.on_antenna_power(True, rig.now_s)
    rig.wait_until(64.0)  # at 35 s it starts again
    assert rig.engine.goals == []
    rig.wait_until(66.0)
    assert len(rig.engine.goals) == 1


# The last route fails between two checks -------------------------------------------------------


def rig_that_loses_its_only_route():
    """Neighbour 2 led to gateway 0 and reports at 1 s that it does not reach it any longer."""
    rig = Rig()
    rig.connect_through(2)
    rig.wait_until(1.0)
    rig.hear("02 02 05 01 01 00")
    return rig


def test_a_router_that_loses_its_only_route_asks_all_neighbours_at_once_and_less_and_less_often():
    rig = rig_that_loses_its_only_route()
    assert not rig.mesh.get_connected_to_gateway()
    search = [packet("01 01 03 fe fe ff")]
    assert rig.broadcasts() == search
    for at_s in (1.25, 1.75, 2.75, 4.75):
        rig.wait_until(at_s - 0.01)
        assert rig.broadcasts() == []
        rig.wait_until(at_s)
        assert rig.broadcasts() == search


def test_a_router_that_never_had_a_gateway_searches_at_its_checks(rig):
    rig.wait_until(14.9)
    assert rig.broadcasts() == [packet("01 01 03 fe fe ff")]


def test_a_router_with_another_route_remains_connected(rig):
    rig.connect_through(3)
    rig.mesh.control.routes.other_can_communicate_with_node(2, 0)
    rig.hear("02 02 05 01 01 00")
    assert rig.mesh.get_connected_to_gateway()
    assert rig.broadcasts() == []


def test_a_loss_between_checks_makes_no_repair_hastier():
    """The check at 5 s would have found it; the protocol of a lost connection starts at 15 s."""
    rig = rig_that_loses_its_only_route()
    rig.wait_until(44.9)
    assert "EMERGENCY" not in rig.kinds()
    rig.wait_until(45.0)
    assert "EMERGENCY" in rig.kinds()


def test_a_neighbour_that_led_nowhere_is_given_up_for_the_next_one_that_offers_a_gateway():
    rig = rig_that_loses_its_only_route()
    rig.hear("03 03 04 01 01 01 00 01")
    assert rig.sent(HEARTBEAT)[-1] == packet("01 01 04 03 00 00 00 00")
    rig.hear("03 03 05 01 01 00", "04 04 04 01 01 01 00 01")
    assert rig.sent(HEARTBEAT)[-1] == packet("01 01 04 04 00 00 00 00")


# A shared channel ----------------------------------------------------------------------------


def shared_rig(**numbers):
    shared = Medium(policy=QUEUED, answer_s=1.0, heartbeats=3, missing_quiet_s=5.0)
    return Rig(medium=replace(shared, **numbers))


def test_a_router_that_gets_no_answer_asks_after_half_as_long_again_and_a_period_at_most():
    """A late answer has cost as much as one in time: asking sooner fills the channel."""
    rig = shared_rig()
    asked_s = []
    while len(asked_s) < 9:
        rig.hear("02 02 04 01 01 01 00 00")  # a neighbour names its gateway
        if any(packet[4] == 0 for packet in rig.sent(HEARTBEAT)):
            asked_s.append(rig.now_s)
        rig.forget()
        rig.wait(0.05)
    gaps_s = [later - before for before, later in zip(asked_s, asked_s[1:])]
    expected_s = [1.5, 2.25, 3.375, 5.0625, 7.59375, 10.0, 10.0, 10.0]
    assert gaps_s == [pytest.approx(gap_s, abs=0.15) for gap_s in expected_s]


def test_neighbours_that_are_gone_do_not_make_a_router_wait_longer_for_one_that_is_there():
    rig = shared_rig()
    rig.antenna.dead = {2, 3, 4}
    for gone in (2, 3, 4):
        rig.hear(f"0{gone} 0{gone} 04 01 01 01 00 00")  # names its gateway, and takes no packet
    rig.antenna.dead = set()
    rig.forget()
    rig.hear("05 05 04 01 01 01 00 00")
    assert [sent[3] for sent in rig.sent(HEARTBEAT)] == [5]
    rig.wait(1.6)  # its answer is lost
    rig.forget()
    rig.hear("05 05 04 01 01 01 00 00")
    assert [sent[3] for sent in rig.sent(HEARTBEAT)] == [5]


def test_a_packet_that_would_go_straight_back_concerns_only_the_neighbour_that_sent_it():
    """For all others the route through this node still works."""
    rig = shared_rig()
    rig.know_neighbour(3)
    rig.connect_through(2)
    rig.hear("09 02 04 01 00 01 00 00")
    assert rig.sent(MISSING) == [packet("01 01 05 02 02 00")]
    assert rig.broadcasts() == []


def test_a_router_whose_only_route_is_gone_asks_around_at_once():
    rig = shared_rig()
    rig.connect_through(2)
    rig.hear("02 02 05 01 01 00")
    assert not rig.mesh.get_connected_to_gateway()
    assert packet("01 01 03 fe fe 02 00") in rig.broadcasts()


@pytest.mark.parametrize(("missing", "tries"), [("02", True), ("04", False)])
@pytest.mark.parametrize(("patience", "is_proven"), [(0.0, False), (2.5, True)])
def test_a_router_tries_its_next_hop_at_once_if_a_neighbour_misses_it(
    missing, tries, patience, is_proven
):
    """It may have flown away, and its goal was not heard; unless the gateway has just answered."""
    rig = shared_rig()
    rig.antenna.periods = patience
    rig.connect_through(2)
    rig.know_neighbour(3)
    rig.know_neighbour(4)
    rig.wait(2.0)
    rig.hear(f"03 03 05 01 fe {missing}")
    through_2 = packet("01 01 04 02 00 01 00")
    assert rig.sent(HEARTBEAT) == [through_2] * (tries and not is_proven)


def test_on_a_busy_channel_an_answer_older_than_a_check_period_does_not_speak_for_the_next_hop():
    rig = shared_rig()
    rig.antenna.periods = 2.5
    rig.connect_through(2)
    rig.know_neighbour(3)
    rig.wait(11.0)
    rig.forget()
    rig.hear("03 03 05 01 fe 02")
    assert rig.sent(HEARTBEAT) == [packet("01 01 04 02 00 01 00")]


PRESENT_OF_3 = "03 03 03 01 fe 01 01"  # one hop from its gateway, as node 2 is


@pytest.mark.parametrize(("hops", "takes_over"), [("01", True), ("03", False)])
def test_a_packet_for_the_gateway_goes_through_another_neighbour_that_is_no_farther_from_it(
    hops, takes_over
):
    rig = shared_rig(silence_s=3.0)
    rig.connect_through(2)
    rig.hear(f"03 03 03 01 fe {hops} 01")
    rig.mesh.on_undelivered(packet("01 01 04 02 00 01 00"), 9, rig.now_s)
    assert rig.sent(HEARTBEAT) == [packet("01 01 04 03 00 01 00")] * takes_over


@pytest.mark.parametrize(("given_up_s", "lost"), [(2.9, False), (3.0, True)])
def test_a_neighbour_that_was_heard_lately_survives_one_packet_that_is_given_up(given_up_s, lost):
    rig = shared_rig(silence_s=3.0)
    rig.connect_through(2)
    rig.mesh.on_undelivered(packet("01 01 04 02 00 01 00"), 9, given_up_s)
    assert (2 not in rig.mesh.get_neighbours()) is lost


def test_a_router_whose_next_hop_lost_the_gateway_asks_through_another_neighbour():
    """Node 2 presented itself before, so its hops count no longer."""
    rig = shared_rig()
    rig.connect_through(2)
    rig.hear("02 02 03 01 fe 01 01", PRESENT_OF_3, "02 02 05 01 01 00")
    assert rig.mesh.get_connected_to_gateway()
    assert rig.sent(HEARTBEAT) == [packet("01 01 04 03 00 01 00")]


def test_after_the_loss_of_a_neighbour_the_next_check_comes_soon_and_then_once_a_period():
    """AlwaysHalf: 3 s later."""
    rig = shared_rig()
    rig.connect_through(2)
    rig.know_neighbour(7)
    rig.wait_until(6.0)
    rig.mesh.control.neighbour_leaves(7)
    rig.broadcasts()
    checks = []
    for second in range(7, 31):
        rig.wait_until(second)
        rig.hear("00 02 04 01 01 01 00 01")  # the gateway answers
        checks += [second] * any(sent[2] == PRESENT for sent in rig.broadcasts())
    assert checks == [9, 19, 29]


def test_a_neighbour_that_was_just_heard_is_not_probed():
    """At the checks after 5 and 15 s; node 3 is heard 4 s before the second one, node 4 is not."""
    rig = shared_rig(heard_periods=0.9)
    rig.know_neighbour(3, 4)
    rig.wait_until(11.0)
    rig.know_neighbour(3)
    rig.wait_until(15.0)
    assert rig.sent(HEARTBEAT) == [packet("01 01 04 04 04 00 ff")]


@pytest.mark.parametrize(("place_periods", "asked_s"), [(0.0, [5, 15, 25, 35]), (2.5, [5, 35])])
def test_a_router_asks_for_a_place_that_it_knows_only_from_time_to_time(place_periods, asked_s):
    rig = shared_rig(place_periods=place_periods)
    rig.connect_through(2)
    asked = []
    for check_s in (5, 15, 25, 35):
        rig.wait_until(check_s)
        if any(request[3:5] == b"\2\2" for request in rig.sent(REQUEST)):
            asked.append(check_s)
            rig.hear("02 02 01 01 01 00 00 80 3f")
        rig.hear("00 02 04 01 01 01 00 01")  # the gateway answers
    assert asked == asked_s


@pytest.mark.parametrize(("drawn", "asked_s"), [(0.0, 55), (0.5, 75), (0.9, 95)])
def test_routers_that_connected_together_do_not_ask_a_far_gateway_together(
    drawn, asked_s, monkeypatch
):
    rig = shared_rig(place_periods=2.5)
    rig.connect_through(2)
    rig.hear("00 02 01 01 01 00 00 80 3f")
    rig.sent()
    monkeypatch.setattr(AlwaysHalf, "random", lambda _self: drawn)
    for check_s in range(5, 125, 10):
        rig.wait_until(check_s)
        if any(request[4] == 0 for request in rig.sent(REQUEST)):
            break
        rig.hear("00 02 04 01 01 01 00 01")  # the gateway answers
    assert check_s == asked_s


def test_another_next_hop_is_asked_for_its_place_at_the_next_check():
    rig = shared_rig(place_periods=2.5)
    rig.connect_through(2)
    rig.hear("02 02 01 01 01 00 00 80 3f")
    rig.connect_through(3)
    rig.wait_until(5.0)
    assert packet("01 01 02 03 03 00 00 00 00 00 00 00 00 01") in rig.sent(REQUEST)


def test_a_queued_packet_teaches_the_routes_when_the_antenna_reports_its_outcome():
    routing = EtxTree()
    rig = Rig(routing=routing, medium=Medium(policy=QUEUED))
    rig.connect_through(2)
    rig.mesh.control.send_heartbeat(0)
    assert routing.etx(2) == 1.0
    rig.mesh.on_delivered(packet("01 01 00 02 00"), 4, rig.now_s)
    assert routing.etx(2) > 1.0


def test_a_router_that_takes_off_announces_its_goal():
    rig = shared_rig()
    rig.connect_through(2)
    rig.hear("00 02 06 01 01 00 00 80 3f")  # latitude 1
    goal = packet("01 01 01 fe fe 00 00 80 3f 00 00 00 00 00 00 00 00 00 80")
    for expected in ([goal], [goal], []):
        assert [sent for sent in rig.broadcasts() if sent[2] != PRESENT] == expected
        rig.wait(0.2)


@pytest.mark.parametrize(("latitude", "stays"), [("00 00 00 41", True), ("00 00 10 41", False)])
def test_a_neighbour_that_flies_out_of_reach_is_no_neighbour_from_its_take_off(latitude, stays):
    """8 m and 9 m away; the range is 9 m. It stood 7 m away, and has announced its goal to all."""
    rig = shared_rig()
    rig.connect_through(2)
    rig.hear("02 02 01 01 01 00 00 e0 40")
    rig.hear(f"02 02 01 01 fe {latitude} 00 00 00 00 00 00 00 00 00 80")
    assert (2 in rig.mesh.get_neighbours()) is stays
    assert rig.mesh.get_connected_to_gateway() is stays


def test_a_place_that_was_asked_for_does_not_end_a_link():
    """The range in the settings is only an estimate: a link may be longer."""
    rig = shared_rig()
    rig.connect_through(2)
    rig.hear("02 02 01 01 01 00 00 20 41")  # 10 m away
    assert rig.mesh.get_connected_to_gateway()


def test_a_router_that_flies_out_of_reach_of_its_next_hop_takes_another_route_at_once():
    rig = shared_rig()
    rig.connect_through(2)
    rig.hear("02 02 01 01 01 00 00 00 41")  # 8 m away
    rig.hear("00 02 06 01 01 00 00 80 bf")  # latitude -1
    assert 2 not in rig.mesh.get_neighbours()
