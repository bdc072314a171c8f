"""Posts: where drones hover for a mesh, who holds them, and the ways to them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Collection, Iterable, Mapping, Sequence

from drone_mesh.drone.flight_path import SPEED_M_S
from drone_mesh.drone.location import Location
from drone_mesh.formations.airspace import Airspace
from drone_mesh.formations.departures import AT_PLACE_M, FlightRules
from drone_mesh.formations.reserves import place_of
from drone_mesh.state.model import NodeStatus

BESIDE_M = 1.5  # between the two places of a post: the clearance, and what physics moves a drone
NEAR_M = 2.0  # of a free post: who comes to rest there holds it; a repair ends beside the place
_MOST_PLACES = 255  # of posts, in an Airspace
_WAYS = 8  # directions in which the place beside is searched
_RISES_M = (2.0, 4.0, 6.0, 8.0)  # above others in its way home; whole metres, as orders say


@dataclass
class Turn:
    """A drone that comes to take over a post."""

    new: int
    to: Location
    begin_s: float
    number: int  # of its standing order
    arrived: bool = False  # it has been there
    there_s: float | None = None  # since when it is connected there


@dataclass
class Post:
    """A place that is to be held, with one beside it for the drone that comes."""

    places: Sequence[Location]
    holder: int | None = None
    turn: Turn | None = None
    heard_s: float | None = None  # when its holder was connected, if it has ever been, or could not

    @classmethod
    def restored(cls, saved: Mapping[str, Any]) -> Post:
        """What `asdict` returned. Raises KeyError, TypeError or ValueError."""
        post, turn = cls(**saved), saved["turn"]
        post.places = tuple(Location(*place) for place in post.places)
        post.turn = turn and Turn(**{**turn, "to": Location(*turn["to"])})
        return post


def leads_to(node: NodeStatus, places: Iterable[Location], within_m: float = BESIDE_M / 2) -> bool:
    """Whether it flies to one of these places, or is about there."""
    return any(_end_of(node).distance_m(place) <= within_m for place in places)


def is_at(node: NodeStatus, *places: Location) -> bool:
    """Whether it is at rest at one of these places."""
    return not len(node.path) and leads_to(node, places, AT_PLACE_M)


def is_cut_off(node: NodeStatus, heard: Collection[int]) -> bool:
    """Whether none of the others hears it, or it hears nobody; `heard`: whom anybody hears."""
    return len(heard) > 0 and (node.id not in heard or not len(node.neighbours))


def _end_of(node: NodeStatus) -> Location:
    return Location.from_vector(node.path[-3:]) if len(node.path) else place_of(node)


class Ways:
    """The ways between homes and posts, at one moment."""

    def __init__(
        self, posts: Sequence[Post], nodes: Collection[NodeStatus], rules: FlightRules
    ) -> None:
        """`nodes`: all whose places are known."""
        self._nodes, self._rules = nodes, rules
        self._taken = [place for node in nodes for place in (place_of(node), _end_of(node))]
        self._places = [place for post in posts for place in post.places][:_MOST_PLACES]
        self._posts = Airspace(rules.sway_m, rules.clearance_m)
        for count, place in enumerate(self._places):
            self._posts.add_resting(count, place.to_vector())

    def to(self, home: Location, post: Post) -> Location | None:
        """The place of the post that is free, and to which the way from this home is clear.

        It leads past all posts: the drone flies home on the same way.
        """
        for place in post.places:
            if all(place.distance_m(other) > BESIDE_M / 2 for other in self._taken):
                met = self._met(self._posts, home, place)
                if met is not None and all(self._places[count] == place for count in met):
                    return place.as_ordered()
        return None

    def home(self, node: NodeStatus, home: Location, range_m: float) -> Location:
        """Where it flies next to come home: there, or first up, if those at rest are in the way.

        Up there it has to hear the next order.
        """
        resting, here = Airspace(self._rules.sway_m, self._rules.clearance_m), place_of(node)
        others = [other for other in self._nodes if other.id != node.id]
        for other in others:
            if not len(other.path):
                resting.add_resting(other.id, other.position)
        if self._met(resting, here, home):
            connected = [place_of(other) for other in others if other.on and other.connected]
            for above in (here._replace(height=here.height + rise_m) for rise_m in _RISES_M):
                is_in_reach = any(above.distance_m(other) < range_m for other in connected)
                ways = self._met(resting, here, above), self._met(resting, above, home)
                if is_in_reach and ways == ([], []):
                    return above.as_ordered()
        return home

    def places_at(self, node: NodeStatus, home: Location | None, range_m: float) -> list[Location]:
        """Where it hovers, and a place beside that it can reach and that keeps the most links.

        That place is not on its way home, nor near anybody or another post.
        """
        here = place_of(node)
        others = [place_of(other) for other in self._nodes if other.id != node.id and other.on]
        near = [other for other in others if other.distance_m(here) < range_m]
        taken = [*others, *(place for place in self._places if place != here)]
        best, most = [], (-1, -math.inf)
        for way in range(_WAYS):
            angle = 2.0 * math.pi * way / _WAYS
            north_m, east_m = BESIDE_M * math.sin(angle), BESIDE_M * math.cos(angle)
            place = Location(here.latitude + north_m, here.longitude + east_m, here.height)
            beside = Airspace(self._rules.sway_m, self._rules.clearance_m)
            if any(place.distance_m(other) < BESIDE_M for other in taken) or (
                self._met(beside, here, place) is None
            ):
                continue
            beside.add_resting(0, place.to_vector())
            if home is not None and self._met(beside, here, home):
                continue
            away_m = [place.distance_m(other) for other in near]
            kept = sum(metres < range_m for metres in away_m), -max(away_m, default=0.0)
            if kept > most:
                best, most = [place], kept
        return [here, *best]

    def _met(self, airspace: Airspace, start: Location, goal: Location) -> Sequence[int] | None:
        """Those in the airspace to which a flight would come too near; None: there is no way."""
        path = self._rules.plan_flight(start.to_vector(), goal.to_vector(), 0.0, SPEED_M_S)
        return None if path is None else airspace.in_the_way(_MOST_PLACES, path)
