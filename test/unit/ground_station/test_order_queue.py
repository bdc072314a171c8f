"""Orders that wait for a drone manager: late ones are not carried out, and an end drops them."""

from __future__ import annotations

import threading

import pytest

from drone_mesh.drone.location import Location
from drone_mesh.ground_station import order_queue
from drone_mesh.ground_station.order_queue import OrderQueue

GOAL = Location(1.0, 2.0, 0.0)
WITHIN_S = 30.0


class SlowManager:
    """Takes each order when it is allowed to."""

    def __init__(self) -> None:
        self.asked: list[int] = []
        self.has_one, self.goes_on = threading.Event(), threading.Event()

    def order(self, node: int, goal: Location) -> str:
        self.asked.append(node)
        self.has_one.set()
        assert self.goes_on.wait(WITHIN_S)
        return "" if node < 9 else "no route"


def test_orders_are_carried_out_one_after_the_other_and_answered() -> None:
    manager, answers = SlowManager(), []
    manager.goes_on.set()
    orders = OrderQueue(manager.order)
    answered = threading.Event()
    orders.give(3, GOAL, answers.append)
    orders.give(9, GOAL, lambda why: (answers.append(why), answered.set()))
    assert answered.wait(WITHIN_S)
    orders.stop()
    assert (manager.asked, answers) == ([3, 9], ["", "no route"])


def test_an_order_that_waited_too_long_is_not_carried_out(monkeypatch: pytest.MonkeyPatch) -> None:
    manager, answers, answered = SlowManager(), [], threading.Event()
    orders = OrderQueue(manager.order)
    orders.give(3, GOAL, answers.append)
    assert manager.has_one.wait(WITHIN_S)
    orders.give(4, GOAL, lambda why: (answers.append(why), answered.set()))
    monkeypatch.setattr(order_queue, "LATE_S", 0.0)
    manager.goes_on.set()
    assert answered.wait(WITHIN_S)
    orders.stop()
    assert (manager.asked, answers) == ([3], ["", "the drone manager is too busy"])


def test_the_end_waits_for_one_order_and_drops_the_others() -> None:
    manager, answers = SlowManager(), []
    orders = OrderQueue(manager.order)
    for node in (3, 4, 5):
        orders.give(node, GOAL, answers.append)
    assert manager.has_one.wait(WITHIN_S)
    ends = threading.Thread(target=orders.stop)
    ends.start()
    assert orders._ended.wait(WITHIN_S)
    manager.goes_on.set()
    ends.join(WITHIN_S)
    assert not ends.is_alive()
    assert (manager.asked, answers) == ([3], [""])
