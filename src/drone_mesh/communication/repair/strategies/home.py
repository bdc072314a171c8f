"""Home: each drone without a gateway flies straight to the gateway, until it is connected.

The simplest rule there is: fast, needs no agreement, and gives up the layout. "Centering" of the
literature, with the gateway as the centre (Mou et al., IEEE JSAC 40(1), 2022, compare it).
"""

from __future__ import annotations

from drone_mesh.communication.repair.interfaces import IRepairStrategy


class Home(IRepairStrategy):
    """Flies towards the gateway's place, once."""

    def on_emergency(self) -> None:
        """Fly, if there is a step that has not failed yet."""
        mesh = self.mesh
        self.reason = mesh.why_not_fly()
        home = [step for step in mesh.steps if step.home]
        if not home:
            self.reason = self.reason or "does not know where the gateway is"
        elif mesh.was_at(home[0]):
            self.reason = self.reason or "flew to the gateway's place without success"
        if not self.reason:
            mesh.fly(home[0])
