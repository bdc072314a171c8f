"""OrderRecord: one order as known to its gateway (docs/protocol.md, "Orders")."""

from __future__ import annotations

import enum
from typing import NamedTuple

from drone_mesh.drone.location import Location


class OrderState(enum.Enum):
    """The progress of an order. The value is the text that views display."""

    ASKED = "asked"  # the next hop has it
    UNDER_WAY = "under way"  # the drone has accepted it
    NO_ROUTE = "no route"  # it did not reach the drone
    REFUSED = "refused"  # by the drone
    ARRIVED = "arrived"
    GIVEN_UP = "given up"

    @property
    def is_open(self) -> bool:
        """Whether the order may still change."""
        return self in (OrderState.ASKED, OrderState.UNDER_WAY)


class OrderRecord(NamedTuple):
    """One order as known to its gateway."""

    number: int  # 1..65535, unique among the orders that the gateway remembers
    drone: int
    goal: Location
    state: OrderState
    reason: str  # why it was refused or given up; otherwise empty
    ordered_s: float  # when, in seconds of the core's clock
    changed_s: float  # time of the last change of state
