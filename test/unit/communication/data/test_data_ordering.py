"""Messages of one port are delivered once, and in the order of sending."""

from __future__ import annotations

import pytest

from drone_mesh.communication.data.ordering import HOLD_S, PortOrder
from drone_mesh.communication.data.packets import Head, Whole


def message(order, behind=0, reliable=True):
    return Whole(Head(0, 0, 0, 1, reliable, behind, order, 0), bytes((order % 256,)))


def taken(order, *wholes, now_s=0.0):
    return [[whole.head.order for whole in order.add(whole, now_s)] for whole in wholes]


@pytest.mark.parametrize(
    ("wholes", "delivered"),
    [
        ([message(8, behind=1), message(9, 2), message(7)], [[], [], [7, 8, 9]]),
        ([message(7), message(7), message(8), message(7)], [[7], [], [8], []]),
        ([message(7), message(9, behind=1), message(10, behind=1)], [[7], [], [9, 10]]),
        ([message(n) for n in (7, 10, 8, 11, 8, 9, 9)], [[7], [10], [8], [11], [], [9], []]),
        ([message(n) for n in (1, 0, 0, 2)], [[1], [0], [], [2]]),
        ([message(65535), message(1, 1), message(0)], [[65535], [], [0, 1]]),
        ([message(n, reliable=False) for n in (3, 5, 4, 5, 6)], [[3], [5], [], [], [6]]),
    ],
    ids=[
        "one waits for an earlier one",
        "once",
        "the sender gave up 8",
        "8 and 9 seemed given up and come all the same",
        "before the first that arrived",
        "across the wrap",
        "late, without acknowledgements",
    ],
)
def test_messages_are_delivered_once_and_in_order(wholes, delivered):
    assert taken(PortOrder(), *wholes) == delivered


def test_a_place_that_comes_again_after_the_wrap_is_delivered_once():
    order = PortOrder()
    for place in range(1 << 16):
        order.add(message(place), 0.0)
    assert taken(order, message(65521), message(65535), message(0), message(0)) == [[], [], [0], []]


def test_a_message_that_waited_too_long_is_delivered_without_the_earlier_one():
    order = PortOrder()
    taken(order, message(7), message(9, behind=1))
    assert order.overdue(HOLD_S - 1) == []
    assert [whole.head.order for whole in order.overdue(HOLD_S)] == [9]
    assert taken(order, message(8), message(8), message(10)) == [[8], [], [10]]
