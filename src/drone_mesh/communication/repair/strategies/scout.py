"""Scout: like Thesis, but quicker: a drone that hears no node looks around, and comes back.

A drone whose neighbours all fell silent together cannot know whether they died or its medium is
down; Thesis waits five times as long in that case. A scout waits no longer than usual, flies to the
place of its lost next hop and stays there if it hears a node. Otherwise, or as soon as it hears one
of its lost neighbours, it flies back. In a group, later rounds follow sooner after the first
flight. Both rules are our own.
"""

from __future__ import annotations

from drone_mesh.communication.repair.election import TOOK_OFF, TOOK_OFF_HOME
from drone_mesh.communication.repair.interfaces import SILENCE_PATIENCE, IRepairActions, Step
from drone_mesh.communication.repair.strategies.thesis import Thesis
from drone_mesh.communication.router_states import RouterEvent
from drone_mesh.drone.location import Location

LISTENS_S = 1.0  # our choice: an answer takes some milliseconds
LATER_ROUNDS = 1.0 / 3.0  # of the patience, our choice: a step back takes about 5 s


class Scout(Thesis):
    """Looks around before it waits."""

    _stood_at: Location | None = None  # during a look around: its start
    _looked = False  # since the connection was lost
    _drone_flew = False  # one of the group, since the connection was lost

    def start(self, mesh: IRepairActions) -> None:
        """Called once, before any other call."""
        super().start(mesh)
        self._lost: set[int] = set()  # neighbours that were not heard again

    def patience(self, silent: bool) -> float:
        """In silence, look around early once, then wait like Thesis. Later rounds come sooner."""
        if silent:
            return SILENCE_PATIENCE if self._looked else 1.0
        return LATER_ROUNDS if self._drone_flew else 1.0

    def on_gateway_found(self) -> None:
        """Start over: the next loss is a new one."""
        super().on_gateway_found()
        self._stood_at, self._looked, self._drone_flew = None, False, False

    def on_bid(self, node: int, score: float, from_: int, about: Location | None) -> None:
        """Also note that a drone of the group flies."""
        self._drone_flew = self._drone_flew or score in (TOOK_OFF, TOOK_OFF_HOME)
        super().on_bid(node, score, from_, about)

    def on_emergency(self) -> None:
        """If alone in silence, look around."""
        mesh, here = self.mesh, self.mesh.own_place()
        if not mesh.silent or here is None:
            super().on_emergency()
            return
        mesh.happened(RouterEvent.NO_NEIGHBOURS)
        step, self.reason = self._next_step(alone=True)
        if step is not None:
            mesh.fly(step)
            self._stood_at, self._looked = here, True

    def on_stopped(self) -> None:
        """The drone flies, perhaps by an order: forget the look around."""
        super().on_stopped()
        self._stood_at = None

    def on_neighbour_lost(self, node: int) -> None:
        """Remember it: it may have died, or the medium is down."""
        super().on_neighbour_lost(node)
        self._lost.add(node)

    def on_neighbour_found(self, node: int) -> None:
        """A lost neighbour is alive, so the medium was down: fly back to the start."""
        if node in self._lost:
            self._lost.discard(node)
            self._back()

    def on_landed(self) -> None:
        """If this is where it looks around, listen."""
        if self._stood_at is not None:
            self.mesh.wait_until(self.mesh.now_s + self.mesh.medium.stretched(LISTENS_S))

    def on_time(self) -> None:
        """If no node is here, fly back."""
        if self._stood_at is None:
            super().on_time()
        elif self.mesh.silent:
            self._back()

    def _back(self) -> None:
        stood_at, self._stood_at = self._stood_at, None
        if stood_at is not None and not self.mesh.connected:
            self.mesh.fly(Step(stood_at, self.mesh.node_id))
