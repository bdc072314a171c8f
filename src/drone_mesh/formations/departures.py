"""Departures: which drones of a formation may set out now (docs/ros.md, "Formations").

Two flights whose paths come near each other are never in the air together, and only so many drones
fly at once that the mesh holds: far ones first, relays last.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Collection, Iterable, Iterator, Mapping, NamedTuple, Sequence

import numpy as np

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.options import CLEARANCE_M
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.fleet import ids_in_words
from drone_mesh.drone.flight_path import SPEED_M_S, FlightPath, PlanFlight
from drone_mesh.drone.goal import ROUNDING_M
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.formations.airspace import APART_M, Airspace
from drone_mesh.state.model import MeshStatus, NodeStatus, position_is_known, waypoints

AT_PLACE_M = 0.5  # heights are rounded to whole metres, and physics moves drones
CONNECTED_SHARE = 0.8  # of the drones stay connected while others fly
MEMBERS_IN_FLIGHT = "beacon"  # the technique that keeps flying drones connected
ASIDE_M = (1.5, 3.0, 4.5, 6.0)  # how far a drone goes to let another one pass
_ASIDE_WAYS = 8


class Reach:
    """The links that positions allow; obstacles are not considered."""

    def __init__(
        self, places: Mapping[int, Sequence[float]], gateways: Iterable[int], range_m: float
    ) -> None:
        """`places` of all nodes that are on, in metres."""
        self._gateways = set(gateways)
        self._ids = [int(node) for node in places]
        self._bits = {node: 1 << row for row, node in enumerate(self._ids)}
        points: np.ndarray = np.array(list(places.values()), dtype=float).reshape(-1, 3)
        away = points[:, None] - points[None]
        near = np.packbits((away * away).sum(axis=-1) < range_m**2, axis=-1, bitorder="little")
        self._near = [int.from_bytes(row.tobytes(), "little") for row in near]  # a bit a node

    def over(self, relays: Collection[int]) -> set[int]:
        """The drones, without gateways, that have a path to a gateway over these drones."""
        return self.hops(relays).keys() - self._gateways

    def hops(self, relays: Collection[int]) -> dict[int, int]:
        """The hops of each of them and of the gateways."""
        reached: dict[int, int] = {}
        left = self._set_of(relays)
        frontier, count = self._set_of(self._gateways), 0
        while frontier:
            left &= ~frontier
            near = 0
            while frontier:
                lowest = frontier & -frontier
                frontier ^= lowest
                row = lowest.bit_length() - 1
                reached[self._ids[row]] = count
                near |= self._near[row]
            frontier, count = near & left, count + 1
        return reached

    def _set_of(self, nodes: Iterable[int]) -> int:
        bits = 0
        for node in nodes:
            bits |= self._bits.get(node, 0)
        return bits


class FlightRules(NamedTuple):
    """How the drones of this fleet fly."""

    plan_flight: PlanFlight = FlightPath
    sway_m: float = 0.0  # airspace.SWAY_M for dynamic drones
    clearance_m: float = CLEARANCE_M  # between drones at rest
    fence: Fence = Fence()  # which `plan_flight` keeps


@dataclass
class Choice:
    """The decision about the drones of a formation: what each may do now."""

    set_out: dict[int, Location] = field(default_factory=dict)  # and where to
    blocked: dict[int, str] = field(default_factory=dict)  # by a drone that will not leave: why


class Departures:
    """Decides for one state of the mesh."""

    def __init__(
        self,
        mesh: MeshStatus,
        goals: Mapping[int, Location],
        under_order: Mapping[int, Location],
        rules: FlightRules = FlightRules(),  # noqa: B008 (immutable)
        first: Collection[int] = (),
    ) -> None:
        """`goals` of all drones of all formations, those at rest included.

        `under_order`: drones that were sent to these places and may set out at any moment.
        `first`: the drones of the latest formation. The others leave them room.
        """
        self._goals = goals
        self._first = first
        self._rules = rules
        self._range_m = mesh.max_distance
        self._flying_are_members = mesh.routing == MEMBERS_IN_FLIGHT
        self._nodes = {node.id: node for node in mesh.nodes if position_is_known(node)}
        self._airspace = Airspace(rules.sway_m, rules.clearance_m)
        self._resting: set[int] = set()
        self._ends: dict[int, Location] = {}  # of all drones that fly or are about to
        for node in self._nodes.values():
            if len(node.path):
                ahead = waypoints(list(node.path))
                way = [list(node.position), *ahead]
                if rules.sway_m:  # it may be behind its path, and climbs before it goes across
                    high_m = max(corner[2] for corner in way)
                    way = [way[0], *([*corner[:2], high_m] for corner in way), way[-1]]
                self._airspace.add_flying(way)
                self._ends[node.id] = Location.from_vector(ahead[-1])
            else:
                self._airspace.add_resting(node.id, node.position)
                self._resting.add(node.id)
        self._gateways = {n for n, node in self._nodes.items() if node.role == Role.GATEWAY}
        on = {n: node.position for n, node in self._nodes.items() if node.on}
        self._reach = Reach(on, self._gateways & on.keys(), mesh.max_distance)
        self._behind = _behind(self._nodes.values())
        self._rerouting: set[int] = set()  # their routes lead over a drone that is leaving
        self._keep_away: set[int] = set()  # drones at rest that others wait for
        self._hinder: set[int] = set()  # drones at rest in the way of others, who wait anyway
        self._members: dict[int | None, set[int]] = {}  # until the next drone leaves
        members = self._members_without(None)
        self._at_home = {n for n in self._resting & goals.keys() if self._is_at(n, goals[n])}
        self._connected = {n for n, node in self._nodes.items() if node.connected}
        can_go = members | self._connected
        self._to_go = (can_go & self._resting & goals.keys()) - self._at_home
        self._fleet = len(members | (self._ends.keys() & on.keys()))
        for drone in self._resting & under_order.keys():
            self._leave(drone, self._path(drone, under_order[drone]))

    def choose(self, candidates: Iterable[int]) -> Choice:
        """Choose the drones that may set out now, of those that can be ordered, and their goals."""
        choice = Choice()
        left = sorted(set(candidates) & self._to_go & self._resting, key=self._rank)
        first: set[int] = set()
        more = set(left) & set(self._first)
        waits = False
        while more:
            first |= more
            waits = self._some_wait([drone for drone in left if drone in first], choice)
            more = self._hinder & set(left) - first
            self._keep_away |= more
        if not waits:
            self._some_wait([drone for drone in left if drone not in first], choice)
        if not self._ends:
            self._resolve([drone for drone in left if drone not in choice.blocked], choice)
        return choice

    def _some_wait(self, left: list[int], choice: Choice) -> bool:
        """Let the drones set out that may; returns whether others must wait for their turn."""
        last: tuple[int, int] | None = None
        waiting: dict[int, Location] = {}
        while last != (len(choice.set_out), len(self._keep_away)):
            last = len(choice.set_out), len(self._keep_away)
            anchors, waiting = self._anchors(), {}
            for drone in [drone for drone in left if drone not in choice.set_out]:
                if self._is_near(self._goals[drone], anchors):
                    to = self._goals[drone]
                elif drone in self._keep_away:  # it makes room, and stays in reach if it can
                    to = self._aside(drone) or self._goals[drone]
                else:
                    continue
                goes = self._try(drone, to, choice) or drone in choice.blocked
                if not goes and self._may_go_later(drone, to):
                    waiting[drone] = to
        if not any(self._routes_hold_without(drone) for drone in waiting):
            for drone, to in waiting.items():
                if self._mesh_is_whole_without(drone):
                    self._try(drone, to, choice, whatever_it_cuts=True)
        if not waiting:  # nobody will make a path for the others
            hops = self._hops_at_the_end()
            for drone in sorted(left, key=lambda drone: hops.get(drone, NO_ROUTE)):
                if drone not in choice.set_out:
                    self._try(drone, self._goals[drone], choice)
        return any(drone not in choice.set_out for drone in waiting)

    def is_in_reach(self, drone: int) -> bool:
        """Whether the drone's goal is connected by drones that stay or arrive."""
        return self._is_near(self._goals[drone], self._anchors())

    def taken_by(self, drone: int) -> str:
        """The drones that keep the goal occupied, in words; empty if it is or may become free."""
        goal, within_m = self._goals[drone], self._rules.clearance_m - ROUNDING_M
        others = self._resting - self._to_go - {drone}
        near = [n for n in sorted(others) if self._is_at(n, goal, within_m)]
        return _in_the_way(near) if near else ""

    def _rank(self, drone: int) -> tuple[bool, int, int, int]:
        """Those of the latest formation first; of these, far ones first, relays last."""
        hops, later = self._nodes[drone].hops, drone not in self._first
        return later, len(self._behind[drone]), 0 if hops == NO_ROUTE else -hops, -drone

    def _try(
        self, drone: int, to: Location, choice: Choice, whatever_it_cuts: bool = False
    ) -> bool:
        """Let one drone set out if nothing forbids it; returns whether it does."""
        if not (whatever_it_cuts or self._mesh_holds_without(drone)):
            return False
        path = self._path(drone, to)
        if path is not None:
            in_the_way = self._airspace.in_the_way(drone, path)
            stay = [other for other in in_the_way if other not in self._to_go]
            if stay:
                choice.blocked[drone] = _in_the_way(stay)
            else:
                self._keep_away.update(in_the_way)
            if in_the_way or self._airspace.meets_flight(path):
                return False
        choice.set_out[drone] = to
        self._leave(drone, path)
        return True

    def _may_go_later(self, drone: int, to: Location) -> bool:
        """Whether the drone can set out later, when others have landed or routes have changed."""
        path = self._path(drone, to)
        in_the_way = [] if path is None else self._airspace.in_the_way(drone, path)
        if in_the_way:
            self._hinder.update(in_the_way)
            return False
        stay = self._stay_without(drone)
        return stay is not None and self._are_enough(len(stay) + len(self._ends))

    # The mesh --------------------------------------------------------------------------------

    def _stay_without(self, drone: int) -> set[int] | None:
        """The drones at rest that keep a path; None if one loses it that is still to be ordered."""
        before = self._members_without(None)
        after = self._members_without(drone)
        return None if (before - after - {drone}) & self._to_go else after

    def _members_without(self, drone: int | None) -> set[int]:
        """The drones at rest that have a path over the others of them."""
        if drone not in self._members:
            self._members[drone] = self._reach.over(self._resting - {drone})
        return self._members[drone]

    def _are_enough(self, connected: int) -> bool:
        return connected + self._flying_are_members >= CONNECTED_SHARE * self._fleet

    def _mesh_holds_without(self, drone: int) -> bool:
        """Whether enough drones stay connected, and all that are still to be ordered."""
        stay = self._stay_without(drone)
        if stay is None:
            return False
        connected = len(stay - self._rerouting - self._behind[drone])
        return self._are_enough(connected + len(self._ends) * self._flying_are_members)

    def _routes_hold_without(self, drone: int) -> bool:
        """Whether only few routes lead over it, once the drones that fly now have landed."""
        return self._are_enough(self._fleet - 1 - len(self._behind[drone]))

    def _mesh_is_whole_without(self, drone: int) -> bool:
        """Whether enough of those that are connected now keep a path, over other routes."""
        stay = self._stay_without(drone)
        if stay is None:
            return False
        connected = len(stay & self._connected)
        return self._are_enough(connected + len(self._ends) * self._flying_are_members)

    def _anchors(self) -> np.ndarray:
        """Places from which a drone will have a path to a gateway, (n, 3)."""
        stays = self._resting - self._to_go
        places = {n: self._nodes[n].position for n in stays if self._nodes[n].on}
        places.update({n: end.to_vector() for n, end in self._ends.items() if self._nodes[n].on})
        reach = Reach(places, self._gateways & places.keys(), self._range_m)
        anchors: np.ndarray = np.array([places[n] for n in reach.hops(places)])
        return anchors.reshape(-1, 3)

    def _hops_at_the_end(self) -> Mapping[int, int]:
        """Hops of the drones that will have a path to a gateway when all are at their places."""
        places = {n: self._nodes[n].position for n in self._resting if self._nodes[n].on}
        places.update({n: end.to_vector() for n, end in self._ends.items() if self._nodes[n].on})
        places.update({n: self._goals[n].to_vector() for n in self._to_go})
        return Reach(places, self._gateways & places.keys(), self._range_m).hops(places)

    def _is_near(self, goal: Location, anchors: np.ndarray) -> bool:
        away = anchors - np.asarray(goal.to_vector())
        return bool(((away * away).sum(axis=-1) < self._range_m**2).any())

    def _leave(self, drone: int, path: FlightPath | None) -> None:
        self._resting.discard(drone)
        self._members.clear()
        self._rerouting |= self._behind[drone]
        self._to_go.discard(drone)
        if path is None:  # the drone will refuse
            return
        self._airspace.set_out(drone, path)
        self._ends[drone] = Location.from_vector(path.goal)

    # When nothing flies and nobody may set out -----------------------------------------------

    def _resolve(self, left: list[int], choice: Choice) -> None:
        """Let one drone set out although the mesh suffers, or go aside for another one."""
        for drone in left:
            if self._try(drone, self._goals[drone], choice, whatever_it_cuts=True):
                return
        for drone in left:
            path = self._path(drone, self._goals[drone])
            others = [] if path is None else self._airspace.in_the_way(drone, path)
            for other in others:
                aside = self._aside(other) if other in left else None
                if aside is not None:
                    choice.set_out[other] = aside
                    return
            choice.blocked[drone] = _in_the_way(others)

    def _aside(self, drone: int) -> Location | None:
        """A free place near this drone, from which nobody is kept away."""
        here = Location.from_vector(self._nodes[drone].position)
        room_m = APART_M + self._rules.sway_m
        taken = [Location.from_vector(self._nodes[n].position) for n in self._resting]
        taken += [goal for n, goal in self._goals.items() if n in self._to_go]
        for place in _around(here):
            if min(place.distance_m(other) for other in taken) < room_m:
                continue
            path = self._path(drone, place)
            if path is not None and not self._airspace.in_the_way(drone, path):
                return place
        return None

    def _path(self, drone: int, goal: Location) -> FlightPath | None:
        x, y, z = self._nodes[drone].position
        return self._rules.plan_flight((x, y, z), goal.to_vector(), 0.0, SPEED_M_S)

    def _is_at(self, drone: int, goal: Location, within_m: float = AT_PLACE_M) -> bool:
        return Location.from_vector(self._nodes[drone].position).distance_m(goal) < within_m


def _in_the_way(drones: list[int]) -> str:
    noun, verb = ("drone", "is") if len(drones) == 1 else ("drones", "are")
    return f"{noun} {ids_in_words(drones)} {verb} in the way"


def _behind(nodes: Collection[NodeStatus]) -> dict[int, set[int]]:
    """By drone: those whose route to their gateway leads over it."""
    behind: dict[int, set[int]] = {node.id: set() for node in nodes}
    for node in nodes:
        for relay in bytes(node.route)[1:-1]:
            if relay in behind:
                behind[relay].add(node.id)
    return behind


def _around(here: Location) -> Iterator[Location]:
    """Places around this one, at its height, nearest first."""
    for distance_m in ASIDE_M:
        for way in range(_ASIDE_WAYS):
            angle = 2.0 * math.pi * way / _ASIDE_WAYS
            yield here._replace(
                longitude=here.longitude + distance_m * math.cos(angle),
                latitude=here.latitude + distance_m * math.sin(angle),
            )
