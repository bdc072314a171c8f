"""OrderRecord: one order as its gateway knows it (docs/protocol.md, "Orders")."""

from __future__ import annotations

import enum
from typing import NamedTuple

from drone_mesh.drone.interfaces import Location


class OrderState(enum.Enum):
    """How far an order has come. The value is the word that people see."""

    ASKED = "asked"  # the next hop has it
    UNDER_WAY = "under way"  # the drone has accepted it
    NO_ROUTE = "no route"  # it did not reach the drone
    REFUSED = "refused"  # by the drone
    ARRIVED = "arrived"
    GIVEN_UP = "given up"


class OrderRecord(NamedTuple):
    """One order, as its gateway knows it."""

    number: int  # 1..65535, unique among the orders that the gateway remembers
    drone: int
    goal: Location
    state: OrderState
    reason: str  # of a refusal, or why it was given up; else empty
    ordered_s: float  # when, in seconds of the core's clock
    changed_s: float  # since when it has been in this state
