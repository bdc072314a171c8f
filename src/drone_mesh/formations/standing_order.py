"""One standing order: where each of its drones is to be, and how far it has come."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from typing import Mapping, Sequence

from drone_mesh.drone.fleet import ids_in_words
from drone_mesh.drone.location import Location

FIRST_PAUSE_S = 5.0  # simulated: an order over 100 nodes takes less than a second
LONGEST_PAUSE_S = 40.0  # each try costs a packet per hop


class PartState(enum.Enum):
    """How far one drone of a standing order has come."""

    WAITING = "without a route"
    LATER = "waiting to set out"
    FLYING = "flying"
    ARRIVED = "at its place"
    REFUSED = "refused"
    ABSENT = "not in this fleet"
    REPLACED = "replaced by a later order"

    @property
    def is_open(self) -> bool:
        """Whether the drone may still reach its place because of this order."""
        return self not in (PartState.ARRIVED, PartState.ABSENT, PartState.REPLACED)


@dataclass
class Part:
    """The goal of one drone."""

    goal: Location
    at_once: bool = False
    state: PartState = PartState.WAITING
    reason: str = ""  # of a refusal
    pause_s: float = FIRST_PAUSE_S
    due_s: float = -math.inf  # when to order it next
    arrived: bool = False  # it has been at its place
    settled: bool = False  # it was connected there: a repair may take it elsewhere
    sent_to: Location | None = None  # by an order that it may still follow
    sent_s: float = -math.inf

    @property
    def is_followed(self) -> bool:
        """Whether it may still have to be ordered."""
        return not self.settled if self.state is PartState.ARRIVED else self.state.is_open

    def is_ordered(self, place: Location | None) -> bool:
        """Whether this order sends its drone to this place."""
        own = (self.goal.as_ordered(), (self.sent_to or self.goal).as_ordered())
        return place is not None and place.as_ordered() in own

    def replace(self) -> None:
        """The drone has been ordered elsewhere."""
        if self.state is PartState.ARRIVED:
            self.settled = True
        else:
            self.state = PartState.REPLACED

    def send(self, to: Location, now_s: float) -> None:
        """Note that the drone is being ordered to its goal."""
        self.sent_to, self.sent_s = to, now_s
        self.due_s = now_s + self.pause_s
        self.pause_s = min(2.0 * self.pause_s, LONGEST_PAUSE_S)

    def stay(self, state: PartState, reason: str = "") -> None:
        """Note that the drone will not follow its latest order."""
        self.state, self.reason, self.sent_to = state, reason, None


@dataclass(frozen=True)
class StandingProgress:
    """How far one standing order has come: ids, ascending, by state."""

    number: int
    name: str
    drones: Mapping[PartState, Sequence[int]]
    reasons: Mapping[int, str] = field(default_factory=dict)  # of the refused drones
    relieves: int | None = None  # the drone whose place its drone takes

    @property
    def is_over(self) -> bool:
        """Whether nothing is left to order; a relief is over when it was ended."""
        is_open = any(self.drones[state] for state in PartState if state.is_open)
        return self.relieves is None and not is_open

    def in_words(self) -> str:
        """One line, such as: 12 of 17 at their places, 3 flying, 2 without a route: 4, 9."""
        total = sum(len(drones) for drones in self.drones.values())
        noun = "place" if total == 1 else "places"
        words = [f"{len(self.drones[PartState.ARRIVED])} of {total} at their {noun}"]
        flying = self.drones[PartState.FLYING]
        if flying:
            words.append(f"{len(flying)} flying")
        others = (PartState.LATER, PartState.WAITING, PartState.ABSENT, PartState.REPLACED)
        for state in others:
            if self.drones[state]:
                ids = ids_in_words(self.drones[state])
                words.append(f"{len(self.drones[state])} {state.value}: {ids}")
        for drone in self.drones[PartState.REFUSED]:
            words.append(f"{drone} refused: {self.reasons[drone]}")
        return ", ".join(words)


@dataclass
class StandingOrder:
    """One layout or formation that was ordered."""

    number: int
    name: str
    parts: Mapping[int, Part]  # by drone
    given_s: float
    at_once: bool
    relieves: int | None = None

    def is_moving(self) -> bool:
        """Whether a drone has still to arrive: it may then connect others."""
        on_the_way = (PartState.LATER, PartState.FLYING)
        return any(part.state in on_the_way and not part.arrived for part in self.parts.values())

    def progress(self) -> StandingProgress:
        """A snapshot."""
        by_state = {
            state: tuple(sorted(d for d, part in self.parts.items() if part.state is state))
            for state in PartState
        }
        reasons = {drone: self.parts[drone].reason for drone in by_state[PartState.REFUSED]}
        return StandingProgress(self.number, self.name, by_state, reasons, self.relieves)
