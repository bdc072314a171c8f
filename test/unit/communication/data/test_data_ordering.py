from drone_mesh.communication.data.ordering import HOLD_S, PortOrder
from drone_mesh.communication.data.packets import Head, Whole


def message(order, behind=0, reliable=True):
    return Whole(Head(0, 0, 0, 1, reliable, behind, order, 0), bytes((order % 256,)))


def taken(order, *wholes, now_s=0.0):
    return [[whole.head.order for whole in order.add(whole, now_s)] for whole in wholes]


def test_a_message_waits_for_an_earlier_one():
    order = PortOrder()
    assert taken(order, message(8, behind=1), message(9, 2), message(7)) == [[], [], [7, 8, 9]]


def test_a_message_is_delivered_once():
    order = PortOrder()
    assert taken(order, message(7), message(7), message(8), message(7)) == [[7], [], [8], []]


def test_a_message_that_the_sender_gave_up_is_not_waited_for():
    order = PortOrder()
    assert taken(order, message(7), message(9, behind=1)) == [[7], []]
    assert taken(order, message(10, behind=1)) == [[9, 10]]


def test_a_message_that_seemed_given_up_and_comes_all_the_same_is_delivered_once():
    order = PortOrder()
    assert taken(order, message(7), message(10), message(8), message(11)) == [[7], [10], [8], [11]]
    assert taken(order, message(8), message(9), message(9)) == [[], [9], []]


def test_a_message_before_the_first_that_arrived_is_delivered_once():
    order = PortOrder()
    assert taken(order, message(1), message(0), message(0), message(2)) == [[1], [0], [], [2]]


def test_a_place_that_comes_again_after_the_wrap_is_delivered_once():
    order = PortOrder()
    for place in range(1 << 16):
        order.add(message(place), 0.0)
    assert taken(order, message(65521), message(65535), message(0), message(0)) == [[], [], [0], []]


def test_the_order_continues_across_the_wrap():
    order = PortOrder()
    assert taken(order, message(65535), message(1, 1), message(0)) == [[65535], [], [0, 1]]


def test_a_message_that_waited_too_long_is_delivered_without_the_earlier_one():
    order = PortOrder()
    taken(order, message(7), message(9, behind=1))
    assert order.overdue(HOLD_S - 1) == []
    assert [whole.head.order for whole in order.overdue(HOLD_S)] == [9]
    assert taken(order, message(8), message(8), message(10)) == [[8], [], [10]]


def test_without_acknowledgement_a_late_message_is_dropped():
    order = PortOrder()
    late = [message(n, reliable=False) for n in (3, 5, 4, 5, 6)]
    assert taken(order, *late) == [[3], [5], [], [], [6]]
