"""OrderAnswers: waits for the gateways' answers to orders."""

from __future__ import annotations

import threading
import time
from typing import Callable, Collection, NamedTuple

import rospy

from drone_mesh.msg import FlightOrderAnswer
from drone_mesh.ros.graph import names


class Outcomes(NamedTuple):
    """What the gateways did with the orders of a batch; lists of ids."""

    sent: list[int]
    no_route: list[int]
    refused: dict[int, FlightOrderAnswer]  # by drone: one of the answers


class _Waiter:
    """The answers to one batch of orders. `condition` guards `answers`."""

    def __init__(self, drones: Collection[int]) -> None:
        self.condition = threading.Condition()
        self.answers: dict[int, list[FlightOrderAnswer]] = {drone: [] for drone in drones}

    def take(self, answer: FlightOrderAnswer) -> None:
        with self.condition:
            if answer.drone in self.answers:
                self.answers[answer.drone].append(answer)
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
    ) -> Outcomes:
        """Call `order`, then wait for the answers.

        A drone counts as sent as soon as one gateway has sent the order, and as refused or without
        a route when all `gateways` have answered otherwise. A drone without a full set of answers
        after `timeout_s` (wall) counts as sent, because a gateway need not answer.
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
        outcomes = Outcomes([], [], {})
        for drone in drones:
            answers = waiter.answers[drone]
            refusals = [answer for answer in answers if answer.outcome in _REFUSALS]
            if _is_sent(answers) or len(answers) < max(1, gateways):
                outcomes.sent.append(drone)
            elif refusals:
                outcomes.refused[drone] = refusals[0]
            else:
                outcomes.no_route.append(drone)
        return outcomes

    @staticmethod
    def _wait(waiter: _Waiter, gateways: int, deadline_s: float) -> None:
        def is_complete() -> bool:
            return all(
                _is_sent(answers) or len(answers) >= gateways for answers in waiter.answers.values()
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


_REFUSALS = (FlightOrderAnswer.REFUSED, FlightOrderAnswer.PLACE_TAKEN)


def _is_sent(answers: list[FlightOrderAnswer]) -> bool:
    return any(answer.outcome == FlightOrderAnswer.SENT for answer in answers)
