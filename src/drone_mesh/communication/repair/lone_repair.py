"""LoneRepair: a drone that hears no node flies one step, and back if it hears none there either.

docs/repair.md, "Lost connection". A drone whose neighbours all fell silent together cannot know
whether they died or its medium is down. A radio that measures power in its channel knows more: it
is being jammed, and a flight would not help.
"""

from __future__ import annotations

import abc
import math
from typing import Iterable, Iterator

from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.interfaces import (
    JAMMED,
    SILENCE_PATIENCE,
    IRepairStrategy,
    RepairActions,
    Step,
)
from drone_mesh.drone.location import Location

LISTENS_S = 1.0  # an answer takes some milliseconds
SETTLES_S = 5.0  # by then the others are back, too, if the medium was down
SAMPLES = 8  # of the power in the channel, before each decision to fly
SAMPLE_S = 0.15  # longer than an antenna needs for a new sample, 0.1 s
JAMMED_SHARE = 0.5  # a jammer may pulse; frames of strangers take less of the time


class LoneRepair(IRepairStrategy):
    """What an electing strategy does when the drone is alone."""

    samples_wanted = SAMPLES
    _stood_at: Location | None = None  # during a look around: its start
    _looked = False  # since the connection was lost
    _was_everywhere = False  # alone, it has no further step
    _was_beside_another = False  # of those that it knows, since it began again
    _left_group = False  # for that look: it comes back unless a gateway answers
    _in_silence = False  # several neighbours fell silent together before it
    _landed_s = -math.inf  # from its latest look around
    _jammed_s = -math.inf  # when its channel was last found to be jammed
    _dead = NO_ROUTE  # a neighbour that the mesh still lists, and that is known to be silent

    def start(self, mesh: RepairActions) -> None:
        """Called once, before any other call."""
        super().start(mesh)
        self._lost: set[int] = set()  # neighbours that were not heard again
        self._samples: list[bool] | None = None  # of the power in the channel, while it measures
        self.group: set[int] = set()  # whom it heard or reached, since it has no gateway
        self._visited: set[int] = set()  # the others beside whose places it has looked

    def patience(self, silent: bool) -> float:
        """In silence, the first look around comes after the usual time, and further ones rarely."""
        patience = SILENCE_PATIENCE if silent and self._looked else 1.0
        is_lone = self._was_everywhere and not self.mesh.neighbours()
        return SILENCE_PATIENCE * patience if is_lone else patience

    def on_gateway_found(self) -> None:
        """Start over: the next loss is a new one."""
        self._stood_at, self._looked, self._samples = None, False, None
        self._was_everywhere = self._was_beside_another = False
        self._visited.clear()
        self.group.clear()
        self._jammed_s = -math.inf
        self.listens = False

    def on_stopped(self) -> None:
        """Forget the look around: the drone flies for another reason, or its antenna is off."""
        self._stood_at, self._samples = None, None
        self.listens = False

    def on_neighbour_lost(self, node: int) -> None:
        """Remember the lost neighbour: if it is heard again, the medium was down."""
        self._lost.add(node)

    def on_neighbour_found(self, node: int) -> None:
        """A lost neighbour is alive, so the medium was down: fly back to the start."""
        if not self.mesh.connected and self.mesh.view(node).hops == NO_ROUTE:
            self.group.add(node)
        if node in self._lost:
            self._lost.discard(node)
            if self._in_silence:
                self._back()

    def on_landed(self) -> None:
        """Listen at the place of a look around; do not connect while the medium may be down.

        A drone that lost a single neighbour may connect at once: that one has probably died.
        """
        if self._stood_at is not None:
            self.listens, self._landed_s = self._in_silence, self.mesh.now_s
            listens_s = LISTENS_S + (SETTLES_S if self._left_group else 0.0)
            self.mesh.wait_until(self.mesh.now_s + self.mesh.medium.stretched(listens_s))

    def on_emergency_alone(self) -> None:
        """Measure the power in the channel; then fly, unless it is being jammed."""
        if self._samples is None:
            self._samples = []
            self._measure()

    def on_time_alone(self) -> bool:
        """The timer has expired. Returns whether it was that of a drone alone."""
        if self.mesh.state is not RepairState.LOST:
            self._samples = None  # an election has begun meanwhile
        if self._hears_others() and self._stood_at is None:
            self._samples = None
            return False
        if self._samples is not None:
            self._measure()
        elif self._stood_at is not None:
            mesh = self.mesh
            settled_s = self._landed_s + mesh.medium.stretched(LISTENS_S + SETTLES_S)
            if self.is_away and mesh.now_s < settled_s:
                mesh.wait_until(settled_s)
            elif self.is_away or not mesh.neighbours():
                self._back()
            elif self.listens:
                self.listens = mesh.now_s < settled_s
                if self.listens:
                    mesh.wait_until(settled_s)
                else:
                    mesh.present()
            else:
                return False  # it stays: the timer may be that of an election
        else:
            return False
        return True

    @abc.abstractmethod
    def fly_alone(self) -> None:
        """Take the next step, after the channel was found not to be jammed."""

    def beside_another(self) -> Step | None:
        """To the place of another node that it knows, the one heard last first; one in a turn."""
        mesh, self._was_beside_another = self.mesh, not self._was_beside_another
        if not self._was_beside_another or mesh.why_not_fly():
            return None
        for step in mesh.places_of_others():
            if step.owner not in self._visited and not mesh.was_at(step):
                self._visited.add(step.owner)
                return step
        self._visited.clear()
        self._was_beside_another = False
        return None

    @property
    def is_away(self) -> bool:
        """Whether it looks around away from its group, and takes no part in elections."""
        return self._left_group and self._stood_at is not None

    def beside_strangers(self, looked: Iterable[Location]) -> Iterator[Step]:
        """To nodes that are not of its group, and to where others of that looked: each place once.

        The link of another one may have failed; this one's may work.
        """
        mesh = self.mesh
        places = [Step(place) for goal in looked for place in mesh.within_fence(goal)]
        for step in [*mesh.places_of_others(), *places]:
            is_new = step.owner not in self.group and not mesh.was_at(step)
            if is_new and mesh.may_lead_to_gateway(step.place):
                yield step._replace(look=True)

    def _hears_others(self) -> bool:
        return bool(self.mesh.neighbours().keys() - {self._dead})

    def _measure(self) -> None:
        mesh, samples = self.mesh, self._samples
        assert samples is not None
        power = mesh.hears_power() if len(samples) < self.samples_wanted else None
        if power is not None:
            samples.append(power)
            mesh.wait_until(mesh.now_s + SAMPLE_S)
            return
        self._samples = None
        if self._hears_others():
            return
        if samples and sum(samples) >= JAMMED_SHARE * len(samples):
            if self._jammed_s == -math.inf:
                mesh.report(MeshEventKind.EMERGENCY, detail=f"{JAMMED}: it stays")
            self._jammed_s = mesh.now_s
            self.reason = JAMMED
        elif mesh.now_s - self._jammed_s < mesh.connection_lost_after_s:
            self.reason = "its channel was jammed a moment ago"  # the others need time, too
        else:
            self.fly_alone()

    def _look(self, step: Step, here: Location) -> None:
        """Fly a step, and remember the way back."""
        self._in_silence, self._left_group = self.mesh.silent, step.look
        self.mesh.fly(step)
        self._stood_at, self._looked = here, True

    def _back(self) -> None:
        stood_at, self._stood_at = self._stood_at, None
        self.listens = False
        if stood_at is not None and not self.mesh.connected:
            self.mesh.fly(Step(stood_at, self.mesh.node_id))
