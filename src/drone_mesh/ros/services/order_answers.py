"""OrderAnswers: waits for the gateways' answers to orders."""

from __future__ import annotations

import threading
import time
from typing import Callable, Collection

import rospy

from drone_mesh.msg import FlightOrderAnswer
from drone_mesh.ros.graph import names


class _Waiter:
    """The answers to one batch of orders. `condition` guards `outcomes`."""

    def __init__(self, drones: Collection[int]) -> None:
        self.condition = threading.Condition()
        self.outcomes: dict[int, list[int]] = {drone: [] for drone in drones}

    def take(self, answer: FlightOrderAnswer) -> None:
        with self.condition:
            if answer.drone in self.outcomes:
                self.outcomes[answer.drone].append(answer.outcome)
                self.condition.notify()


class OrderAnswers:
    """Any thread. `_lock` guards the set of waiting callers."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiters: set[_Waiter] = set()
        rospy.Subscriber(
            names.GATEWAY_ANSWERS_TOPIC, FlightOrderAnswer, self._answered, tcp_nodelay=True
        )

    def await_outcomes(
        self, drones: Collection[int], order: Callable[[], None], gateways: int, timeout_s: float
    ) -> tuple[list[int], list[int]]:
        """Call `order`, then wait for the answers; returns the ids (sent, without a route).

        A drone counts as sent as soon as one gateway has sent the order, and as without a route
        when all `gateways` report that. A drone without a full set of answers after `timeout_s`
        (wall) counts as sent, because a gateway need not answer.
        """
        waiter = _Waiter(drones)
        with self._lock:
            self._waiters.add(waiter)
        try:
            order()
            self._wait(waiter, gateways, time.monotonic() + timeout_s)
        finally:
            with self._lock:
                self._waiters.discard(waiter)
        lost = [drone for drone in drones if _is_lost(waiter.outcomes[drone], gateways)]
        return [drone for drone in drones if drone not in lost], lost

    @staticmethod
    def _wait(waiter: _Waiter, gateways: int, deadline_s: float) -> None:
        def is_complete() -> bool:
            return all(
                FlightOrderAnswer.SENT in outcomes or len(outcomes) >= gateways
                for outcomes in waiter.outcomes.values()
            )

        with waiter.condition:
            while not is_complete() and not rospy.is_shutdown():
                left_s = deadline_s - time.monotonic()
                if left_s <= 0.0:
                    return
                waiter.condition.wait(left_s)

    def _answered(self, answer: FlightOrderAnswer) -> None:
        with self._lock:
            waiters = list(self._waiters)
        for waiter in waiters:
            waiter.take(answer)


def _is_lost(outcomes: list[int], gateways: int) -> bool:
    return FlightOrderAnswer.SENT not in outcomes and len(outcomes) >= max(1, gateways)
