"""OrderAnswers: waits for the gateways' answers to orders."""

from __future__ import annotations

import threading
from typing import Callable, Collection, NamedTuple

import rospy

from drone_mesh.msg import FlightOrderAnswer
from drone_mesh.ros.graph import names


class Outcomes(NamedTuple):
    """The outcome of a batch of orders at the gateways; lists of ids."""

    sent: list[int]
    no_route: list[int]
    refused: dict[int, FlightOrderAnswer]  # by drone: one of the answers


class OrderAnswers:
    """Any thread. `_changed` guards the answers to the orders that are being waited for."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._awaited: list[dict[int, list[FlightOrderAnswer]]] = []  # by drone, for each caller
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
        awaited: dict[int, list[FlightOrderAnswer]] = {drone: [] for drone in drones}

        def is_complete() -> bool:
            answers = awaited.values()
            return rospy.is_shutdown() or all(_is_sent(a) or len(a) >= gateways for a in answers)

        with self._changed:
            self._awaited.append(awaited)
        try:
            order()
            with self._changed:
                self._changed.wait_for(is_complete, timeout_s)
        finally:
            with self._changed:  # by identity: another caller may wait for the same drones
                self._awaited = [other for other in self._awaited if other is not awaited]
        outcomes = Outcomes([], [], {})
        for drone, answers in awaited.items():
            refusals = [answer for answer in answers if answer.outcome in _REFUSALS]
            if _is_sent(answers) or len(answers) < max(1, gateways):
                outcomes.sent.append(drone)
            elif refusals:
                outcomes.refused[drone] = refusals[0]
            else:
                outcomes.no_route.append(drone)
        return outcomes

    def _answered(self, answer: FlightOrderAnswer) -> None:
        with self._changed:
            for awaited in self._awaited:
                if answer.drone in awaited:
                    awaited[answer.drone].append(answer)
            self._changed.notify_all()


_REFUSALS = (FlightOrderAnswer.REFUSED, FlightOrderAnswer.PLACE_TAKEN)


def _is_sent(answers: list[FlightOrderAnswer]) -> bool:
    return any(answer.outcome == FlightOrderAnswer.SENT for answer in answers)
