"""A gateway searches for a drone that it has an order for and no route to."""

from __future__ import annotations

import pytest
from rig import Rig, packet

from drone_mesh.communication.timing import QUEUED, UNDISTURBED, Medium

ORDER, HEARTBEAT, SEARCH = 6, 4, 0x44
SHARED = Medium(policy=QUEUED, answer_s=1.0)
FROM_5_THROUGH_2 = "05 02 04 01 01 01 01 01"  # a heartbeat for gateway 1
LOST_BEHIND_2 = "02 02 05 01 01 05"  # 2 cannot reach 5


def gateway_rig(medium=SHARED):
    """Gateway 1 with an order under way to drone 5, behind 2; at 2 s: the search is number 32."""
    rig = Rig(gateway=True, medium=medium)
    rig.wait(2.0)
    rig.hear(FROM_5_THROUGH_2)
    assert order(rig)
    rig.forget()
    return rig


def order(rig, drone=5):
    return rig.mesh.send_goal_request_to_drone(drone, float(drone), 0.0, 0, rig.now_s)


def searches(rig):
    return [p for p in rig.broadcasts() if p[2] == SEARCH]


def router_rig():
    """Router 1, a neighbour of gateway 0."""
    rig = Rig(medium=SHARED)
    rig.connect_to_gateway()
    return rig


@pytest.mark.parametrize("medium", [SHARED, UNDISTURBED])
def test_a_drone_that_a_relay_lost_is_searched_for_and_gets_its_order_when_it_answers(medium):
    rig = gateway_rig(medium)
    rig.hear(LOST_BEHIND_2)
    assert packet("01 01 44 fe fe 05 20 00") in rig.broadcasts()
    assert rig.sent(ORDER) == []
    rig.wait(0.5)
    rig.hear("05 03 04 01 01 01 01 02")
    assert [(p[3], p[4]) for p in rig.sent(ORDER)] == [(3, 5)]
    assert "NO_ROUTE" not in rig.kinds()


@pytest.fixture
def rig():
    return gateway_rig()


def test_another_report_of_the_loss_does_not_end_the_search(rig):
    rig.hear(LOST_BEHIND_2, LOST_BEHIND_2)
    assert "NO_ROUTE" not in rig.kinds()


def test_an_order_that_never_left_is_lost_if_three_searches_of_a_second_each_find_nothing(rig):
    rig.routing.cant_communicate_with_node(2)
    assert order(rig)
    rig.wait(2.9)
    assert len(searches(rig)) == 3
    assert "NO_ROUTE" not in rig.kinds()
    rig.wait(0.2)
    assert rig.kinds()[-1] == "NO_ROUTE"


TAKEN_OFF = "02 02 05 01 fe 05"  # 2 tells all its neighbours that it has lost 5


@pytest.mark.parametrize(
    ("told", "why"),
    [
        (TAKEN_OFF, "its drone flies and is not found"),
        (LOST_BEHIND_2, "2 has dropped it: the drone may have taken it, and its ACKs were lost"),
    ],
)
def test_an_order_that_left_is_not_without_a_route(rig, told, why):
    rig.hear(told)
    rig.wait(20.0)
    assert len(searches(rig)) == 3
    assert "NO_ROUTE" not in rig.kinds(), why
    rig.wait(20.9)  # three searches of 1 s, four waits for a route, and as long as with one
    assert "ORDER_LOST_CONTACT" not in rig.kinds()
    rig.wait(0.2)
    assert rig.kinds()[-1] == "ORDER_LOST_CONTACT"


def test_a_copy_that_a_relay_dropped_says_nothing_of_the_first_one(rig):
    rig.hear(TAKEN_OFF, FROM_5_THROUGH_2, LOST_BEHIND_2)
    rig.wait(10.0)
    assert "NO_ROUTE" not in rig.kinds()
    rig.hear("05 02 40 01 01 21 00 01")
    assert rig.kinds()[-1] == "ORDER_ACCEPTED"


@pytest.mark.parametrize("later_s", [3.2, 39.0])  # the third search ends after 3 s
def test_an_order_that_waits_for_a_route_is_repeated_as_soon_as_its_drone_is_heard(rig, later_s):
    rig.hear(TAKEN_OFF)
    rig.wait(later_s)
    assert rig.sent(ORDER) == []
    rig.hear("05 03 04 01 01 01 01 02")
    assert [(p[3], p[4]) for p in rig.sent(ORDER)] == [(3, 5)]
    rig.hear("05 03 04 01 01 01 01 02")
    assert rig.sent(ORDER) == []
    rig.hear("05 03 40 01 01 21 00 03")
    assert rig.kinds()[-1] == "ORDER_ARRIVED"


def test_an_order_that_was_accepted_while_it_waited_for_a_route_is_not_sent_again(rig):
    rig.hear(TAKEN_OFF)
    rig.wait(39.0)
    rig.hear("05 03 40 01 01 21 00 01")
    assert rig.kinds()[-1] == "ORDER_ACCEPTED"
    rig.hear("05 03 04 01 01 01 01 02")
    assert rig.sent(ORDER) == []


def test_reports_of_a_loss_do_not_put_off_the_repeats_of_an_order(rig):
    for _second in range(44):
        rig.hear(TAKEN_OFF)
        rig.wait(1.0)
    assert "ORDER_LOST_CONTACT" in rig.kinds()


def test_searches_do_not_count_as_orders_without_a_reply(rig):
    rig.hear(LOST_BEHIND_2)
    rig.wait(2.5)
    rig.hear(FROM_5_THROUGH_2)
    assert len(rig.sent(ORDER)) == 1
    rig.wait(29.0)
    assert len(rig.sent(ORDER)) == 3
    assert "ORDER_LOST_CONTACT" not in rig.kinds()
    rig.wait(2.0)
    assert "ORDER_LOST_CONTACT" in rig.kinds()


def test_a_drone_whose_path_breaks_again_is_searched_for_three_times(rig):
    rig.hear(LOST_BEHIND_2)
    for _again in range(2):
        rig.wait(0.5)
        rig.hear(FROM_5_THROUGH_2, LOST_BEHIND_2)
        assert "NO_ROUTE" not in rig.kinds()
    rig.wait(0.5)
    rig.hear(FROM_5_THROUGH_2, LOST_BEHIND_2)
    rig.wait(10.0)
    assert len(searches(rig)) == 3


def test_a_drone_without_a_route_that_was_there_lately_is_searched_for_before_the_order_leaves(rig):
    rig.hear(LOST_BEHIND_2)
    rig.wait(3.0)
    assert order(rig)
    assert rig.sent(ORDER) == []
    assert not order(rig, drone=9)  # never heard


def test_it_is_searched_for_within_an_hour_after_it_was_heard_but_not_for_ever(rig):
    rig.hear(LOST_BEHIND_2)
    rig.wait(3500.0)
    assert order(rig)
    rig.wait(101.0)
    assert not order(rig)


def test_searches_do_not_follow_each_other_at_once_and_the_second_drone_waits_for_its_own(rig):
    rig.hear("06 02 04 01 01 01 01 01", LOST_BEHIND_2, "02 02 05 01 01 06")
    assert order(rig, drone=6)
    assert [p[5] for p in searches(rig)] == [5]
    rig.wait(0.7)
    assert [p[5] for p in searches(rig)] == [6]


def test_a_search_is_passed_on_once_by_each_node():
    rig = router_rig()
    rig.hear("00 03 44 01 fe 05 20 00", "00 04 44 01 fe 05 20 00")
    assert rig.broadcasts() == [packet("00 01 44 fe fe 05 20 00")]


def test_a_search_that_comes_again_after_ten_seconds_is_another_one():
    rig = router_rig()
    for wait_s, passed_on in ((0.0, 1), (9.9, 0), (0.2, 1)):
        rig.wait(wait_s)
        rig.hear("00 03 44 01 fe 05 20 00")
        assert len(searches(rig)) == passed_on


def test_a_gateway_searches_three_times_a_second_at_most(rig):
    search = rig.mesh.control.search
    assert search(5)
    rig.wait(0.25)
    assert not search(6)
    rig.wait(0.1)
    assert search(6)


@pytest.mark.parametrize("other", ["05 21 00", "06 20 00"])
def test_another_number_or_another_node_is_another_search(other):
    rig = router_rig()
    rig.hear("00 03 44 01 fe 05 20 00", f"00 03 44 01 fe {other}")
    assert len(rig.broadcasts()) == 2


def test_the_node_that_is_searched_for_answers_even_if_a_heartbeat_is_under_way():
    rig = router_rig()
    rig.mesh.control.send_heartbeat(0)
    rig.forget()
    rig.hear("00 03 44 01 fe 01 20 00")
    assert rig.sent(HEARTBEAT) == [packet("01 01 04 00 00 01 00 00")]
    assert rig.broadcasts() == []


def test_a_gateway_does_not_pass_on_its_own_search(rig):
    rig.hear("01 02 44 01 fe 05 20 00")
    assert rig.broadcasts() == []
