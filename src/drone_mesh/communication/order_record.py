"""OrderRecord: one order as known to its gateway (docs/protocol.md, "Orders")."""

from __future__ import annotations

import enum
from typing import NamedTuple

from drone_mesh.drone.location import Location


class OrderState(enum.Enum):
    """The progress of an order; `in_words` is how logs, events, services and pages tell it."""

    is_open: bool  # whether the gateway still follows the order

    def __new__(cls, words: str, is_open: bool = False) -> OrderState:
        member = object.__new__(cls)
        member._value_ = words
        member.is_open = is_open
        return member

    SENT = "sent", True  # the next hop has it
    ACCEPTED = "accepted", True  # by the drone, which flies there
    ARRIVED = "arrived"
    REPLACED = "replaced"  # the drone has a later order
    REFUSED = "refused"  # by the drone
    NO_ROUTE = "no route"  # it did not reach the drone
    LOST_CONTACT = "lost contact"  # the drone may still fly there; if it reports, the state changes
    GIVEN_UP = "given up"  # the flight ended elsewhere

    def in_words(self, reason: str = "") -> str:
        """The state and its reason, such as: replaced by order 8; refused: battery at 9 %."""
        if not reason:
            return str(self.value)
        continues = self in (OrderState.REPLACED, OrderState.LOST_CONTACT)
        return f"{self.value}{'' if continues else ':'} {reason}"


class OrderRecord(NamedTuple):
    """One order as known to its gateway."""

    number: int  # 1..65535, unique among the orders that the gateway remembers
    drone: int
    goal: Location
    state: OrderState
    reason: str  # of the state, as in `OrderState.in_words`; empty: none
    ordered_s: float  # when, in seconds of the core's clock
    changed_s: float  # time of the last change of state
