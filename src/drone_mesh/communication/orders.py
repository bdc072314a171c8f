"""OrderIntake: which orders to fly a node takes (docs/protocol.md, "Flight")."""

from __future__ import annotations

from typing import Callable

from drone_mesh.communication.complaints import Complaints
from drone_mesh.communication.messages import GoToLocationMessage
from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.communication.parts import NodeParts
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import Location
from drone_mesh.errors import GoalRefused


class OrderIntake:
    """Checks the orders for one drone and starts its flights."""

    def __init__(
        self, parts: NodeParts, complaints: Complaints, took_off: Callable[[], None]
    ) -> None:
        """`took_off` is called when an order has started a flight."""
        self._parts = parts
        self._complaints = complaints
        self._took_off = took_off

    def on_order(self, order: GoToLocationMessage) -> None:
        """An order from the air: taken, or refused with a line in the log."""
        try:
            check_goal(*order.location)
            self.check_can_fly()
        except GoalRefused as error:
            self._complaints.add("order refused", str(error), self._parts.now_s)
            return
        self.take(order.creator, order.location)

    def check_can_fly(self) -> None:
        """Raises GoalRefused if the drone would not fly to a goal now."""
        why_not = self._parts.pilot.why_not_fly()
        if why_not:
            raise GoalRefused(f"drone {self._parts.node_id} cannot fly: {why_not}")

    def take(self, creator: int, goal: Location) -> None:
        """Fly to `goal`, unless the drone does so already: two gateways order the same flight."""
        if self._parts.pilot.goal == goal:
            return
        self._parts.report(MeshEventKind.FLIGHT_ORDERED, creator, f"to {goal.in_words()}")
        self._parts.pilot.fly_to(goal)
        self._took_off()
