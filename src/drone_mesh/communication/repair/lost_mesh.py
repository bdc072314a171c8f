"""LastFlight: a drone whose mesh is lost flies home, or lands (docs/repair.md, "Lost mesh")."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.repair.interfaces import RepairActions
from drone_mesh.communication.repair.options import LostMesh, RepairOptions
from drone_mesh.communication.repair.repair_flight import RepairFlight
from drone_mesh.communication.repair.spots import ROUNDING_M, Landing, TakenPlaces, above_ground
from drone_mesh.drone.battery import MARGIN_PERCENT, BatteryUse
from drone_mesh.drone.flight_path import ground_apart_m
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location

TURN_S = 30.0  # chosen here: so long it waits for others, if its battery just reaches home
AT_PLACE_M = 1.5  # an autopilot lands within 1 m
ANSWERS_S = 1.0  # as before a negotiation: to hear where the others are, and who flies
ROUNDING_S = 1e-6  # sums of periods are not exact


class Ending(NamedTuple):
    """The end of a drone's work."""

    place: Location  # where it lands
    words: str  # what it does, and why
    waits_until_s: float  # for others that are in its way, and for a gateway


@dataclass(eq=False)
class LastFlight:
    """Decides whether it is due, where it ends, and who flies first; ConnectionRepair flies it."""

    _mesh: RepairActions
    _options: RepairOptions
    _engine: IDroneEngine
    _pilot: Pilot
    _neighbours: Neighbours
    _taken: TakenPlaces

    def __post_init__(self) -> None:
        self._use = BatteryUse()
        self.begin_anew()

    def begin_anew(self) -> None:
        """A gateway answers, or the drone flies by order: what was before does not count."""
        self.due: Ending | None = None  # it is about to fly for this, or flies
        self._since_s = self._low_since_s = math.inf
        self._landed: Ending | None = None  # it stands there

    def why_not_repair(self) -> str:
        """Why it flies for no repair; empty: it may."""
        ending = self.due or self._landed
        if ending is None:
            return "lost_mesh is hold" if self._options.lost_mesh is LostMesh.HOLD else ""
        why = ending.words.partition(": ")[2]
        return ending.words if self.due else f"has landed for good: {why}"

    def becomes_due(self, now_s: float, flies: bool = False) -> bool:
        """Whether it is to end its work: asked at each check without a gateway, at rest.

        `flies` for a repair: only its battery ends that.
        """
        self._since_s = min(self._since_s, now_s)
        here = self._pilot.place()
        if here is not None:
            self.due = due = self._ending(now_s, here, flies)
            if due and math.dist(here[:2], due.place[:2]) <= AT_PLACE_M:
                self.landed()  # nothing takes off only to land
        return self.due is not None

    def hurry(self, flight: RepairFlight) -> None:
        """On the way, as at the start: its battery that just reaches home ends all waiting."""
        here, due, now_s = self._pilot.place(), self.due, self._mesh.now_s
        ending = here and due and self._ending(now_s, here, flies=True)
        if due and ending:
            self.due = due._replace(waits_until_s=min(due.waits_until_s, ending.waits_until_s))
            flight.stops_when_connected = False

    def landed(self) -> None:
        """Its last flight is over: no other one follows, if it stands on the ground."""
        here = self._pilot.place()
        if here and self._engine.on_ground(here):
            self._landed, self.due = self.due, None

    def _ending(self, now_s: float, here: Location, flies: bool) -> Ending | None:
        percent = self._engine.battery_percent()
        if percent is not None:
            self._use.note(percent, now_s)
        mode, after_s = self._options.lost_mesh, self._options.lost_mesh_after_s
        landed, below = self._landed, here._replace(height=0.0)
        home = above_ground(self._pilot.home or here)
        lost_s = now_s - self._since_s + ROUNDING_S
        is_lost = lost_s >= self._mesh.connection_lost_after_s
        if percent is not None and is_lost and not (landed and landed.place == home):
            left = percent - self._engine.least_percent
            way_s, per_s = self._engine.seconds_between(here, home), self._use.per_s
            if left - MARGIN_PERCENT <= (way_s + TURN_S) * per_s:
                self._low_since_s = min(self._low_since_s, now_s)
            if self._low_since_s < math.inf:  # for good: on the way home it needs less
                until_s, battery = self._low_since_s + TURN_S, f"its battery, {percent:.0f} %,"
                if left > way_s * per_s:
                    return Ending(home, f"flies home: {battery} just reaches home", until_s)
                return Ending(below, f"lands: {battery} does not reach home", until_s)
        if landed or flies or lost_s < after_s:
            return None
        why = f"no gateway for {after_s:g} s"
        if mode is LostMesh.LAND:
            return Ending(below, f"lands: {why}", math.inf)
        return Ending(home, f"flies home: {why}", math.inf) if mode is LostMesh.RETURN else None

    # The flight ------------------------------------------------------------------------------

    def may_set_out(self, ending: Ending) -> tuple[Location | None, str]:
        """Where it lands if it sets out now, clear of others, or None and what it waits for."""
        mesh, here, place = self._mesh, self._pilot.location(), ending.place
        near_m = mesh.clearance_m - ROUNDING_M
        if any(place.distance_m(other) < near_m for other in self._taken.all()):
            place = self._taken.at_or_beside(place, Landing(here or place))
        why_not = self._engine.why_not_repair() or mesh.why_not_there(place)
        if here is None:
            why_not = why_not or "its own place is not known"
        elif not self._engine.plan(here.to_vector(), place.to_vector(), mesh.now_s):
            why_not = why_not or "the fence leaves no way"
        if here is None or why_not:
            return None, f"{ending.words}: {why_not}"
        first = self._flies_first(here, place, NO_ROUTE, ending)
        return (place, "") if first == NO_ROUTE else (None, f"{first} flies first")

    def must_wait(self, flight: RepairFlight) -> bool:
        """Whether a drone with a lower id flies, too, and is in the way of this flight."""
        here = self._pilot.place()
        if self.due is None or here is None or not flight.lands:
            return False
        self.hurry(flight)
        return self._flies_first(here, flight.goal, self._mesh.node_id, self.due) != NO_ROUTE

    def _flies_first(self, start: Location, goal: Location, below: int, ending: Ending) -> int:
        """A drone in flight, its id under `below`, that is in the way; NO_ROUTE: none.

        Ways are compared over ground, as not every drone flies as high as in the simulation. One
        whose start is unknown may come from here; one that a fence turns may fly anywhere.
        """
        mesh, fence, own = self._mesh, self._engine.fences(), (start.to_vector(), goal.to_vector())
        if mesh.now_s >= ending.waits_until_s:
            return NO_ROUTE
        for node, left, to in self._neighbours.under_way(mesh.now_s):
            if node < below:
                ways = own if left is None else (*own, left.to_vector(), to.to_vector())
                turned = fence.why_not_straight(ways[:2]) or fence.why_not_straight(ways[2:])
                apart_m = 0.0 if left is None else ground_apart_m(*(p[:2] for p in ways))
                if turned or apart_m < mesh.clearance_m - ROUNDING_M:
                    return node
        return NO_ROUTE
