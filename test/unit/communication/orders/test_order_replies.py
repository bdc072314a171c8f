"""A numbered order is accepted, refused, carried out or given up, and its gateway knows which."""

from __future__ import annotations

import pytest
from rig import Rig, packet

from drone_mesh.communication.interfaces import OrderState
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused

TO_Y_1 = "00 00 80 3f 00 00 00 00 00 00"  # latitude 1, longitude 0, height 0
TO_Y_2 = "00 00 00 40 00 00 00 00 00 00"
TO_Y_20 = "00 00 a0 41 00 00 00 00 00 00"  # too far to keep the routes


def replies(rig):
    """Number, outcome and the part's text of each reply that was sent."""
    return [(p[5] | p[6] << 8, p[7], p[9:19].rstrip(b"\0").decode()) for p in rig.sent(kind=64)]


@pytest.fixture
def rig():
    """Router 1; gateway 0 is its neighbour."""
    rig = Rig()
    rig.connect_to_gateway()
    return rig


def fly_to(rig, place):
    """The drone gets there, lands, and hears its gateway again."""
    rig.engine.place = place
    rig.wait(2.1)
    rig.hear("00 00 04 01 01 01 00 00")
    rig.wait(1.1)


# At the drone ----------------------------------------------------------------------------------


def test_an_order_without_a_number_is_flown_and_not_replied_to(rig):
    rig.hear(f"00 00 06 01 01 {TO_Y_1}")
    fly_to(rig, Location(1.0, 0.0, 0.0))
    assert rig.engine.goals == [Location(1.0, 0.0, 0.0)]
    assert replies(rig) == []


def test_an_accepted_order_is_replied_to_in_these_bytes(rig):
    rig.hear(f"00 00 06 01 01 {TO_Y_1} 34 12")
    assert rig.sent(kind=64) == [packet("01 01 40 00 00 34 12 01 00")]


def test_the_arrival_is_reported_at_the_landing_of_a_short_flight(rig):
    rig.hear(f"00 00 06 01 01 {TO_Y_1} 07 00")
    rig.forget()
    rig.engine.place = Location(1.0, 0.0, 0.0)
    rig.wait(1.1)
    assert replies(rig) == [(7, 3, "")]


def test_the_arrival_after_a_long_flight_is_reported_as_soon_as_there_is_a_route_again(rig):
    rig.hear(f"00 00 06 01 01 {TO_Y_20} 07 00")
    rig.forget()
    rig.engine.place = Location(20.0, 0.0, 0.0)
    rig.wait(3.0)
    assert "LANDED" in rig.kinds()
    assert replies(rig) == []
    rig.connect_to_gateway()
    rig.wait(1.1)
    assert replies(rig) == [(7, 3, "")]
    rig.wait(5.0)
    assert replies(rig) == []


@pytest.mark.parametrize(("waited_s", "told"), [(100.0, [(7, 3, "")]), (140.0, [])])
def test_the_arrival_waits_two_minutes_for_a_route(rig, waited_s, told):
    rig.hear(f"00 00 06 01 01 {TO_Y_20} 07 00")
    rig.forget()
    rig.engine.place = Location(20.0, 0.0, 0.0)
    rig.wait(waited_s)
    assert replies(rig) == []
    rig.connect_to_gateway()
    rig.wait(1.1)
    assert replies(rig) == told


def test_a_drone_has_arrived_if_it_stands_a_metre_from_the_goal(rig):
    rig.hear(f"00 00 06 01 01 {TO_Y_1} 07 00")
    rig.forget()
    fly_to(rig, Location(1.0, 1.2, 0.0))
    assert replies(rig) == [(7, 3, "")]


BACK = Location(-1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("stands", "engine_says", "why"),
    [
        (BACK, {}, "the flight ended; 3.0 m from the goal"),
        (Location(0.0, 0.0, 0.0), {}, "the drone did not set out; 2.0 m from the goal"),
        (
            BACK,
            {"ended": "LOITER was chosen", "grounded": "in LOITER"},
            "LOITER was chosen; 3.0 m from the goal",
        ),
        (None, {"ended": "no 3D fix"}, "no 3D fix; its place is not known"),
    ],
)
def test_a_flight_that_ends_elsewhere_is_given_up_with_reason_and_distance(
    rig, stands, engine_says, why
):
    rig.hear(f"00 00 06 01 01 {TO_Y_2} 07 00")
    rig.forget()
    vars(rig.engine).update(engine_says, place=stands)
    for _ in range(21):
        rig.wait(1.0)
        rig.hear("00 00 04 01 01 01 00 00")
    said = replies(rig)
    assert {(number, outcome) for number, outcome, _ in said} == {(7, 4)}
    assert "".join(text for _, _, text in said) == why


def test_a_refusal_carries_its_reason_in_as_many_packets_as_it_needs(rig):
    rig.engine.grounded = "it stands on the ground"
    rig.hear(f"00 00 06 01 01 {TO_Y_1} 07 00")
    sent = rig.sent(kind=64)
    assert [p[8] for p in sent] == [0x40, 0x41, 0x42, 0x43, 0x44]
    assert b"".join(p[9:19] for p in sent).rstrip(b"\0") == (
        b"drone 1 cannot fly: it stands on the ground"
    )
    assert rig.engine.goals == []
    assert all(p[19:] == bytes(13) for p in sent)  # 14 bytes of a body at most


def test_an_order_to_a_place_out_of_bounds_is_refused_with_the_reason(rig):
    rig.hear("00 00 06 01 01 00 00 80 3f 00 00 00 00 f5 01 07 00")  # 501 m high
    said = replies(rig)
    assert {(number, outcome) for number, outcome, _ in said} == {(7, 2)}
    assert "".join(text for _, _, text in said).startswith("height 501 m is outside")


def test_an_order_that_the_engine_refuses_starts_no_flight(rig):

    def refuse(*_goal):
        raise GoalRefused("farther than --max-distance")

    rig.engine.set_goal = refuse
    rig.hear(f"00 00 06 01 01 {TO_Y_1} 07 00")
    said = replies(rig)
    assert "".join(text for _, _, text in said) == "farther than --max-distance"
    assert said[0][1] == 2
    assert "FLIGHT_ORDERED" not in rig.kinds()
    assert rig.mesh.get_connected_to_gateway()


def test_the_same_order_again_is_replied_to_again_and_not_flown_again(rig):
    order = f"00 00 06 01 01 {TO_Y_1} 07 00"
    rig.hear(order)
    fly_to(rig, Location(1.0, 0.0, 0.0))
    rig.engine.place = Location(0.0, 0.0, 0.0)  # it was carried away
    rig.forget()
    rig.hear(order)
    assert rig.engine.goals == [Location(1.0, 0.0, 0.0)]
    assert replies(rig) == [(7, 3, "")]


def test_the_number_of_a_restarted_gateway_with_another_goal_is_a_new_order(rig):
    rig.hear(f"00 00 06 01 01 {TO_Y_1} 07 00", f"00 00 06 01 01 {TO_Y_2} 07 00")
    assert rig.engine.goals == [Location(1.0, 0.0, 0.0), Location(2.0, 0.0, 0.0)]


def test_an_order_that_another_one_replaces_says_by_which(rig):
    rig.hear(f"00 00 06 01 01 {TO_Y_1} 07 00", f"00 00 06 01 01 {TO_Y_2} 08 00")
    said = replies(rig)
    assert [(number, outcome) for number, outcome, _ in said] == [(7, 1), (7, 6), (8, 1)]
    assert "".join(text for _, _, text in said) == "by order 8"


def test_an_order_of_another_gateway_or_without_a_number_is_named_as_such(rig):
    rig.know_neighbour(9)
    rig.hear(f"00 00 06 01 01 {TO_Y_1} 07 00", f"09 09 06 01 01 {TO_Y_2} 02 00")
    assert "".join(text for _, outcome, text in replies(rig) if outcome == 6) == (
        "by order 2 of gateway 9"
    )
    rig.forget()
    rig.hear(f"00 00 06 01 01 {TO_Y_1}")
    assert "".join(text for _, outcome, text in replies(rig) if outcome == 6) == (
        "by an order without a number"
    )


def test_a_refused_order_does_not_end_the_flight_that_is_under_way(rig):
    rig.hear(f"00 00 06 01 01 {TO_Y_1} 07 00")
    rig.engine.grounded = "battery at 10 %"
    rig.hear(f"00 00 06 01 01 {TO_Y_2} 08 00")
    rig.engine.grounded = ""
    rig.forget()
    fly_to(rig, Location(1.0, 0.0, 0.0))
    assert replies(rig) == [(7, 3, "")]


def test_two_gateways_that_order_the_same_flight_both_get_its_end(rig):
    rig.know_neighbour(9)
    rig.hear(f"00 00 06 01 01 {TO_Y_1} 07 00", f"09 09 06 01 01 {TO_Y_1} 02 00")
    assert rig.engine.goals == [Location(1.0, 0.0, 0.0)]
    rig.forget()
    rig.engine.place = Location(1.0, 0.0, 0.0)
    rig.wait(1.1)
    assert [(p[4], p[5], p[7]) for p in rig.sent(kind=64)] == [(0, 7, 3), (9, 2, 3)]


@pytest.mark.parametrize(("number", "outcome"), [("07 00", 1), ("08 00", 5), ("00 00", 5)])
def test_a_query_is_answered_with_the_state_of_that_order(rig, number, outcome):
    rig.hear(f"00 00 06 01 01 {TO_Y_1} 07 00")
    rig.forget()
    rig.hear(f"00 00 41 01 01 {number}")
    assert rig.sent(kind=64) == [packet(f"01 01 40 00 00 {number} {outcome:02x}")]
    assert len(rig.engine.goals) == 1


@pytest.mark.parametrize(("number", "outcome"), [(1, 5), (2, 6), (9, 1)])
def test_a_drone_remembers_its_last_eight_orders(rig, number, outcome):
    for other in range(1, 10):
        rig.hear(f"00 00 06 01 01 {(TO_Y_1, TO_Y_2)[other % 2]} {other:02x} 00")
    rig.forget()
    rig.hear(f"00 00 41 01 01 {number:02x} 00")
    assert {p[7] for p in rig.sent(kind=64)} == {outcome}


# At the gateway --------------------------------------------------------------------------------


def gateway_rig():
    """Gateway 0; drone 5 is its neighbour and has order 1, to latitude 1."""
    rig = Rig(node_id=0, gateway=True)
    rig.know_neighbour(5)
    assert rig.mesh.send_goal_request_to_drone(5, 1.0, 0.0, 0, rig.now_s)
    return rig


def state(rig):
    """State and reason of the last order."""
    order = rig.mesh.get_orders()[-1]
    return order.state, order.reason


def told(rig):
    """The events about orders."""
    return [
        (event.kind.value, event.peer, event.order, event.place, event.detail)
        for event in rig.events
        if event.kind.name.startswith("ORDER")
    ]


def test_a_gateway_follows_an_order_from_the_request_to_the_arrival():
    rig = gateway_rig()
    assert state(rig) == (OrderState.SENT, "")
    rig.hear("05 05 40 00 00 01 00 01")
    assert state(rig) == (OrderState.ACCEPTED, "")
    rig.hear("05 05 40 00 00 01 00 03")
    assert state(rig) == (OrderState.ARRIVED, "")
    assert told(rig) == [
        ("order sent", 5, 1, (1.0, 0.0, 0), ""),
        ("order accepted", 5, 1, (1.0, 0.0, 0), ""),
        ("order arrived", 5, 1, (1.0, 0.0, 0), ""),
    ]
    rig.forget()
    rig.wait(100.0)
    assert rig.tried(6) == []
    assert rig.tried(65) == []


def test_a_refusal_is_put_together_from_its_parts_in_any_order():
    rig = gateway_rig()
    parts = [b"battery at", b" 9 %"]
    for part in (1, 0):
        assert state(rig)[0] is OrderState.SENT
        rig.hear(f"05 05 40 00 00 01 00 02 {0x10 + part:02x} {parts[part].hex()}")
    assert state(rig) == (OrderState.REFUSED, "battery at 9 %")


def test_an_order_without_a_reply_is_repeated_and_then_contact_is_lost():
    rig = gateway_rig()
    first = rig.sent(6)
    times = []
    for _ in range(400):
        rig.wait(0.1)
        repeated = rig.sent(6)
        assert all(one == first[0] for one in repeated)
        times += [round(rig.now_s)] * len(repeated)
    assert times == [2, 6, 14]
    assert state(rig) == (OrderState.LOST_CONTACT, "at 0 s: it did not reply")
    assert "an order for drone 5 has an unknown outcome" in rig.mesh.complaints.counts


def test_while_there_is_no_route_a_try_waits_four_times_as_its_drone_may_be_in_flight():
    rig = gateway_rig()
    rig.wait(10.0)
    rig.routing.cant_communicate_with_node(5)
    rig.forget()
    rig.wait(8.0 * 3)
    assert (rig.sent(6), state(rig)[0]) == ([], OrderState.SENT)
    rig.know_neighbour(5)
    rig.wait(8.0)
    assert len(rig.sent(6)) == 1
    rig.wait(11.0)
    assert state(rig)[0] is OrderState.SENT
    rig.wait(2.0)
    assert state(rig)[0] is OrderState.LOST_CONTACT


def test_a_late_reply_of_a_drone_counts_although_contact_was_lost():
    rig = gateway_rig()
    rig.wait(60.0)
    assert state(rig)[0] is OrderState.LOST_CONTACT
    rig.hear("05 05 40 00 00 01 00 03")
    assert state(rig) == (OrderState.ARRIVED, "")


def test_contact_with_a_drone_that_falls_silent_is_lost_after_five_minutes_of_queries():
    rig = gateway_rig()
    rig.hear("05 05 40 00 00 01 00 01")
    rig.forget()
    rig.wait(299.0)
    assert rig.sent(65) == [packet("00 00 41 05 05 01 00")] * 19
    assert state(rig)[0] is OrderState.ACCEPTED
    rig.wait(20.0)
    assert state(rig) == (OrderState.LOST_CONTACT, "at 0 s: it fell silent on its way")


def test_a_drone_that_was_restarted_does_not_know_its_order():
    rig = gateway_rig()
    rig.hear("05 05 40 00 00 01 00 01", "05 05 40 00 00 01 00 05")
    assert state(rig) == (OrderState.GIVEN_UP, "the drone no longer knows this order")


def test_a_relay_that_cannot_pass_an_order_on_ends_it_at_once():
    rig = Rig(node_id=0, gateway=True)
    rig.hear("05 02 00 00 00")
    assert rig.mesh.send_goal_request_to_drone(5, 1.0, 0.0, 0, rig.now_s)
    rig.hear("02 02 05 00 00 05")
    assert state(rig) == (OrderState.NO_ROUTE, "")
    assert rig.kinds()[-1] == "NO_ROUTE"
    rig.forget()
    rig.wait(30.0)
    assert rig.tried(6) == []


def test_a_second_order_for_a_drone_ends_the_repeats_of_the_first():
    rig = gateway_rig()
    assert rig.mesh.send_goal_request_to_drone(5, 2.0, 0.0, 0, rig.now_s)
    rig.forget()
    rig.wait(30.0)
    assert {p[15] for p in rig.sent(6)} == {2}
    first, _second = rig.mesh.get_orders()
    assert (first.state, first.reason) == (OrderState.REPLACED, "by order 2")


def test_a_hundred_old_orders_are_remembered_besides_the_latest_of_each_drone():
    rig = gateway_rig()
    for height in range(120):
        assert rig.mesh.send_goal_request_to_drone(5, 1.0, 0.0, height, rig.now_s)
    assert [order.number for order in rig.mesh.get_orders()] == list(range(21, 122))


def states(rig):
    return [order.state.in_words(order.reason) for order in rig.mesh.get_orders()]


def test_the_first_order_is_followed_until_the_drone_has_the_second():
    rig = gateway_rig()
    rig.hear("05 05 40 00 00 01 00 01")
    assert rig.mesh.send_goal_request_to_drone(5, 2.0, 0.0, 0, rig.now_s)
    assert states(rig) == ["accepted", "sent"]
    rig.hear("05 05 40 00 00 02 00 01")
    assert states(rig) == ["replaced by order 2", "accepted"]
    rig.hear("05 05 40 00 00 01 00 03")  # a late reply
    assert states(rig) == ["replaced by order 2", "accepted"]


def test_an_order_that_cannot_be_sent_leaves_the_one_before_as_it_was(caplog):
    rig = gateway_rig()
    rig.hear("05 05 40 00 00 01 00 01")
    rig.antenna.dead = {5}
    assert not rig.mesh.send_goal_request_to_drone(5, 2.0, 0.0, 0, rig.now_s)
    assert states(rig) == ["accepted", "no route"]
    assert "drone 5 failed: order 2 to x 0.00 m, y 2.00 m, z 0 m: no route" in caplog.text
    rig.antenna.dead = set()
    rig.hear("05 05 40 00 00 01 00 03")
    assert states(rig) == ["arrived", "no route"]


@pytest.mark.parametrize(
    "reply",
    [
        "06 06 40 00 00 01 00 03",  # of another drone
        "05 05 40 00 00 02 00 03",  # another number
        "05 05 40 00 00 01 00 09",  # no such outcome
        "05 05 40 00 00 01 00 02 01",  # part 1 of 1
        "05 05 40 00 00 01 00 02 f0",  # one of 16 parts
    ],
)
def test_a_reply_that_does_not_fit_changes_nothing(reply):
    rig = gateway_rig()
    rig.know_neighbour(6)
    rig.hear(reply)
    assert state(rig) == (OrderState.SENT, "")


def test_the_gateways_own_drone_is_followed_too():
    rig = Rig(node_id=0, gateway=True)
    assert rig.mesh.send_goal_request_to_drone(0, 1.0, 0.0, 0, rig.now_s)
    assert state(rig) == (OrderState.ACCEPTED, "")
    rig.engine.place = Location(1.0, 0.0, 0.0)
    rig.wait(1.1)
    assert state(rig) == (OrderState.ARRIVED, "")


def test_the_refusal_of_the_gateways_own_drone_is_an_order_that_was_refused():
    rig = Rig(node_id=0, gateway=True)
    rig.engine.grounded = "it stands on the ground"
    with pytest.raises(GoalRefused, match="drone 0 cannot fly: it stands on the ground"):
        rig.mesh.send_goal_request_to_drone(0, 1.0, 0.0, 0, rig.now_s)
    assert state(rig) == (OrderState.REFUSED, "drone 0 cannot fly: it stands on the ground")


def test_a_gateway_that_starts_later_counts_from_another_number():
    rig = Rig(node_id=0, gateway=True)
    rig.wait(10.0)
    rig.know_neighbour(5)
    assert rig.mesh.send_goal_request_to_drone(5, 1.0, 0.0, 0, rig.now_s)
    assert rig.mesh.get_orders()[-1].number == 161
