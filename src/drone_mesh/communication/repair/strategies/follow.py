"""Follow: a leader takes the place of its lost next hop, and its tree moves up behind it.

After LeDiR: Abbasi, Younis, Baroudi, "Recovering From a Node Failure in Wireless Sensor-Actor
Networks With Minimal Topology Changes", IEEE TVT 62(1), 2013, with the routes to the gateway as the
tree. A drone whose next hop moves out of reach flies until it is in reach again.
"""

from __future__ import annotations

from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.repair.actions import Step
from drone_mesh.communication.repair.spots import WITHIN_REACH
from drone_mesh.communication.repair.strategies.nearest import Nearest
from drone_mesh.drone.location import Location


class Follow(Nearest):
    """The leader is the nearest; each drone announces where it will stand before it leaves."""

    def on_place(self, node: int, place: Location) -> None:
        """If the next hop moves away, follow it as far as needed."""
        mesh, here = self.mesh, self.mesh.own_place()
        may_follow = not (mesh.connected or mesh.why_not_fly() or mesh.state is RepairState.FLYING)
        if node != mesh.lost_next_hop or here is None or not may_follow:
            super().on_place(node, place)
        elif here.distance_m(place) > WITHIN_REACH * mesh.range_m:
            self._fly(Step(place.towards(here, WITHIN_REACH * mesh.range_m), node))
        else:
            super().on_place(node, place)

    def _fly(self, step: Step) -> None:
        self.mesh.announce_place(self.mesh.goal_of(step))
        super()._fly(step)
