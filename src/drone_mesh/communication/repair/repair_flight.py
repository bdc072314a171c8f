"""RepairFlight: a flight for a repair, which ends beside other drones and not on them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Callable

from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.control.places import PlaceRequests
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.repair.interfaces import Step
from drone_mesh.communication.repair.options import RepairOptions
from drone_mesh.communication.repair.spots import (
    NEAR,
    ROUNDING_M,
    Landing,
    TakenPlaces,
    above_ground,
    at_whole_metres,
    free_spot,
)
from drone_mesh.communication.timing import LANDED_WITHIN_M
from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.drone.location import Location

ASK_AGAIN_S = 0.3  # an answer takes some milliseconds
ASKS_ON_GROUND = 2  # a lossy medium loses a question now and then
MOST_ASIDES = 5  # of one flight
LEG = 2.0 / 3.0  # of the range: at half that height it hears nodes below


@dataclass(eq=False)
class RepairFlight:
    """One flight of one drone, from take-off until it is clear of other drones.

    Once a second it asks all nodes in range for their places. If one of them is at the goal, the
    drone diverts to a spot beside the goal and lands earlier if it is connected on the way. On the
    ground it asks again.
    """

    _node_id: int
    _pilot: Pilot
    _requests: PlaceRequests
    _neighbours: Neighbours
    _introduce: Callable[[], None]  # broadcasts a PRESENT
    _step: Step
    goal: Location  # at or near the place of the step
    _options: RepairOptions
    _taken: TakenPlaces
    _landing: Landing
    lands: bool = False  # the last flight of a drone whose mesh is lost, in one go

    def __post_init__(self) -> None:
        self.group = self._neighbours.ids()  # the neighbours that it leaves behind
        self.stops_when_connected = False
        self.asks_left = 0  # on the ground
        self._wanted = at_whole_metres(self._step.place)  # or beside it
        self._leg_m = LEG * self._options.range_m
        self._diversions = 0
        self._leg_from: Location | None = None
        self._leg_end = self.goal
        self._way: FlightPath | None = None  # to there
        self._asides = 0  # because another drone was in the way
        self.paused = False  # it hovers where another one let it wait
        stands = self._pilot.place()
        self._highest_m = max(self.goal.height, stands.height if stands else 0.0)

    @property
    def on_ground(self) -> bool:
        """Whether it has landed and checks that it is clear of others."""
        return self.asks_left > 0

    @property
    def leads_back(self) -> bool:
        """Whether its goal is the place where this drone stood before."""
        return self._step.owner == self._node_id

    def each_second(self) -> None:
        self._requests.ask_all()
        if self.stops_when_connected:
            self._introduce()

    def last_ask_s(self) -> float:
        """When to ask once more on this leg: just before it could no longer turn aside.

        A drone that comes down comes into reach of nodes on the ground, in less than a second.
        """
        above_m = NEAR * self._options.clearance_m
        return math.inf if self._way is None else self._way.above_goal_s(above_m)

    def stop_when_connected(self) -> None:
        """Stop at the first connection, unless this flight leads back."""
        if not self.lands:
            self.stops_when_connected = not self.leads_back

    def stop_here(self, next_hop: int) -> None:
        """Land at the nearest free spot, in reach of `next_hop` if possible.

        A drone that was about to land for good stays as high as it was before.
        """
        here = self._pilot.location()
        if here is not None and not self.on_ground:
            height_m = self._highest_m if self.lands else self.goal.height
            self.lands = False
            below = Location(here.latitude, here.longitude, height_m)
            if below.distance_m(self.goal) >= self._options.clearance_m:
                relay = self._neighbours.place_of(next_hop)
                self._wanted = below
                self._landing = Landing(here, [] if relay is None else [relay.place])
                self._go_to(below if self._taken.is_free(below) else self._spot())

    def on_place(self, node: int, place: Location) -> None:
        """Another node reports its place; keep clear of it."""
        if (
            node == self._step.owner
            and place.distance_m(self._step.place) < self._options.clearance_m
        ):
            self.stop_when_connected()
        if above_ground(place).distance_m(self.goal) < self._options.clearance_m:
            self.stop_when_connected()
        self.on_taken(place)

    def on_taken(self, place: Location) -> None:
        """Another drone is at `place`, or may be there in silence; keep clear of it."""
        if self._is_taken_by(place, self.goal):
            self._diversions += 1
            self._go_to(self._spot())
        elif not self.on_ground and self._is_taken_by(place, self._leg_end):
            self._diversions += 1
            self.fly_on()
        elif not self.on_ground and self._way and self._asides < MOST_ASIDES:
            taken, way = self._taken, self._way
            if not (taken.is_clear(way, [above_ground(place)]) or taken.is_clear(way)):
                self.fly_on()

    def _is_taken_by(self, place: Location, spot: Location) -> bool:
        # Homes may be just a clearance apart
        near_m = self._options.clearance_m - (ROUNDING_M if self.lands else 0.0)
        near = above_ground(place).distance_m(spot) < near_m
        return near and not self._taken.is_free(spot)

    def arrived(self) -> bool:
        """Ask for the places of others after landing. Returns False if another leg follows."""
        here, start = self._pilot.location(), self._leg_from
        if self.lands and (self.paused or self._leg_end == self.goal):
            self._requests.ask_all()  # which tells that it no longer flies
            return not self.paused
        left = here and start and here.distance_m(start) >= LANDED_WITHIN_M
        if here and left and here.distance_m(self.goal) > LANDED_WITHIN_M:  # not the last leg
            self.fly_on()
            return False
        self.ask_on_ground()
        return True

    def ask_on_ground(self) -> None:
        """It is on the ground: begin to ask who else is there."""
        self.asks_left = ASKS_ON_GROUND
        self._requests.ask_all(may_fly_on=True)

    def ask_again(self) -> bool:
        """Ask once more who is near. Returns False after the last time: the flight is over."""
        self.asks_left -= 1
        if self.on_ground:
            self._requests.ask_all(may_fly_on=True)
        return self.on_ground

    def pause(self) -> None:
        """Stay here until `fly_on`: others fly round it."""
        here = self._pilot.location()
        if here is not None and not self.paused:
            self.paused, self._leg_end = True, at_whole_metres(here)
            self._pilot.step_back_to(self._leg_end)
            self._requests.ask_all()

    def _go_to(self, goal: Location) -> None:
        self.goal = goal
        self.asks_left = 0
        self.fly_on()

    def fly_on(self) -> None:
        """Take off, or continue towards the goal.

        A flight that may end where the drone is connected consists of legs. The drone climbs by
        half the length of a leg; from higher up it would hear no node on the ground. Each leg ends
        clear of others, like the flight, none just before the goal, and none up in the air. The
        others are told where it ends at once: this drone may fall silent within a second. If
        another drone is in the way, a leg leads aside first.
        """
        here, self.paused = self._pilot.location(), False
        self._leg_from, self._leg_end, self._way = here, above_ground(self.goal), None
        if here is not None:
            longest_m = self._leg_m + LANDED_WITHIN_M
            in_legs = self.stops_when_connected and not self.lands
            if in_legs and here.distance_m(self.goal) > longest_m:
                end = here.towards(self.goal, self._leg_m)
                end = at_whole_metres(end._replace(height=min(end.height, self._highest_m)))
                free = self._taken.is_free(end)
                self._leg_end = end if free else self._beside(end, Landing(self.goal))
            self._way = self._taken.way(here, self._leg_end)
            if self._asides < MOST_ASIDES and not self._taken.is_clear(self._way):
                self._asides += 1
                self._leg_end = self._taken.aside(here, self._leg_end)
                self._way = self._taken.way(here, self._leg_end)
        self._pilot.step_back_to(self._leg_end, self.lands and self._leg_end == self.goal)
        self._requests.ask_all()

    def _spot(self) -> Location:
        return self._beside(self._wanted, self._landing)

    def _beside(self, place: Location, landing: Landing) -> Location:
        """A free spot; two drones that divert at the same time skip different numbers of spots."""
        skip = self._node_id % 5 if self._diversions > 1 else 0
        taken = self._taken
        return free_spot(place, landing, self._options, taken.all(), skip, taken.allows)
