"""OrderRecord: one order as known to its gateway (docs/protocol.md, "Orders")."""

from __future__ import annotations

import enum
from typing import NamedTuple

from drone_mesh.drone.location import Location


class OrderState(enum.Enum):
    """The progress of an order; `in_words` is how logs, events, services and pages tell it."""

    SENT = "sent"  # the next hop has it
    ACCEPTED = "accepted"  # by the drone, which flies there
    ARRIVED = "arrived"
    REPLACED = "replaced"  # the drone has a later order
    REFUSED = "refused"  # by the drone
    NO_ROUTE = "no route"  # it did not reach the drone
    LOST_CONTACT = "lost contact"  # the drone may still fly there; if it reports, the state changes
    GIVEN_UP = "given up"  # the flight ended elsewhere

    @property
    def is_open(self) -> bool:
        """Whether the gateway still follows the order."""
        return self in (OrderState.SENT, OrderState.ACCEPTED)

    def in_words(self, reason: str = "") -> str:
        """The state and its reason, such as: replaced by order 8; refused: battery at 9 %."""
        if not reason:
            return self.value
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
