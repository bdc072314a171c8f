"""Flights before they are flown: how long a formation takes, and who would lose the mesh.

On an ideal mesh: a drone is connected if places and range allow a path.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import AbstractSet, Mapping, Sequence

from drone_mesh.air.obstacles import no_path
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.fleet import drones_in_words, ids_in_words
from drone_mesh.drone.flight_path import SPEED_M_S, FlightPath
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.formations.departures import (
    AT_PLACE_M,
    MEMBERS_IN_FLIGHT,
    Departures,
    FlightRules,
    Reach,
)
from drone_mesh.state.model import MeshStatus, NodeStatus, position_is_known
from drone_mesh.state.observation import path_ahead

STEP_S = 2.0  # how often the plan looks who may set out; also its time for an order


@dataclass
class FormationPreview:
    """The outcome of a formation for a fleet; ids ascending."""

    duration_s: float = 0.0  # until the last drone of the formation has landed
    out_of_reach: list[int] = field(default_factory=list)  # without a path at the end
    cut_off: list[int] = field(default_factory=list)  # at rest and without a path on the way
    stays: dict[int, str] = field(default_factory=dict)  # who does not set out: why
    least_connected: float = 1.0  # smallest share of the drones with a path, flying ones without

    def in_words(self) -> str:
        """For example: 3 drones would be out of reach: 14..16; 40 s."""
        words = []
        for drones, what in (
            (self.out_of_reach, "out of reach"),
            (self.cut_off, "cut off on the way"),
        ):
            if drones:
                noun = "drone" if len(drones) == 1 else "drones"
                words.append(f"{len(drones)} {noun} would be {what}: {ids_in_words(drones)}")
        words += [f"drone {drone} would stay: {why}" for drone, why in self.stays.items()]
        words.append(
            f"{self.duration_s:.0f} s, at least {100 * self.least_connected:.0f} % connected"
        )
        return "; ".join(words)


def preview(
    mesh: MeshStatus,
    goals: Mapping[int, Location],
    rules: FlightRules = FlightRules(),  # noqa: B008 (immutable)
    at_once: bool = False,
    standing: Mapping[int, Location] | None = None,
) -> FormationPreview:
    """What happens if this formation is flown from the present state of the mesh.

    `standing`: goals of formations that were ordered before. Their other drones fly too.
    """
    others = {} if at_once or standing is None else standing
    return _Rehearsal(mesh, {**others, **goals}, goals.keys(), rules).run(at_once)


@dataclass(frozen=True)
class LostRoutes:
    """Who has no path to a gateway after some flights; ids ascending."""

    there: Sequence[int] = ()  # of those that fly: at their goals
    cut_off: Sequence[int] = ()  # of the others, which would have one without these flights

    def __bool__(self) -> bool:
        return bool(self.there or self.cut_off)

    def in_words(self) -> str:
        """For example: drone 3 would have no route there; drones 4..6 would lose their routes."""
        words = []
        if self.there:
            words.append(f"{drones_in_words(self.there)} would have no route there")
        if self.cut_off:
            routes = "its route" if len(self.cut_off) == 1 else "their routes"
            words.append(f"{drones_in_words(self.cut_off)} would lose {routes}")
        return "; ".join(words)


def lost_routes(mesh: MeshStatus, goals: Mapping[int, Location]) -> LostRoutes:
    """Who has no path once these drones, and those in flight, are where they fly to.

    Nobody, if the range of the radios is not known, as of a real mesh.
    """
    if mesh.max_distance <= 0.0:
        return LostRoutes()
    on = [node for node in mesh.nodes if node.on and position_is_known(node)]
    gateways = [node.id for node in on if node.role == Role.GATEWAY]
    before: dict[int, Sequence[float]] = {
        node.id: node.path[-3:] if len(node.path) else node.position for node in on
    }
    after = {n: goals[n].to_vector() if n in goals else place for n, place in before.items()}
    without = after.keys() - Reach(after, gateways, mesh.max_distance).hops(after).keys()
    if not without:
        return LostRoutes()
    had = Reach(before, gateways, mesh.max_distance).hops(before).keys()
    return LostRoutes(sorted(without & goals.keys()), sorted((without - goals.keys()) & had))


class _Rehearsal:
    def __init__(
        self,
        mesh: MeshStatus,
        goals: Mapping[int, Location],
        formation: AbstractSet[int],
        rules: FlightRules,
    ) -> None:
        self._formation = formation
        self._rules = rules
        self._range_m = mesh.max_distance
        self._routing = mesh.routing
        self._nodes = {n.id: replace(n) for n in mesh.nodes if position_is_known(n)}
        self._goals = {n: goal for n, goal in goals.items() if n in self._nodes}
        self._flights: dict[int, FlightPath] = {}
        self._refused: dict[int, str] = {}  # who has no way to its goal: why
        self._ordered: set[int] = set()  # of those that set out together
        self._now_s = 0.0
        self._found = FormationPreview()
        for node in self._nodes.values():
            if len(node.path):
                self._fly(node, Location.from_vector(node.path[-3:]))

    def run(self, at_once: bool) -> FormationPreview:
        sent = self._due() if at_once else self._choose()
        while sent or self._flights:
            for drone, goal in sent.items():
                self._fly(self._nodes[drone], goal)
            self._note_who_is_cut_off()
            self._now_s += STEP_S
            self._move()
            sent = self._due() if at_once else self._choose()
        self._found.out_of_reach = sorted(self._routers() - self._connected().keys())
        self._found.cut_off = sorted(set(self._found.cut_off) - set(self._found.out_of_reach))
        self._found.stays = {n: why for n, why in self._found.stays.items() if n in self._formation}
        for drone in self._formation & self._nodes.keys():
            here = Location.from_vector(self._nodes[drone].position)
            if here.distance_m(self._goals[drone]) > AT_PLACE_M:
                self._found.stays.setdefault(drone, "it has no route")
        return self._found

    def _due(self) -> Mapping[int, Location]:
        """The drones that rest away from their goals and can be ordered."""
        connected = self._connected()
        due = {
            drone: goal
            for drone, goal in self._goals.items()
            if drone in connected and drone not in self._flights and drone not in self._ordered
        }
        self._ordered.update(due)
        return due

    def _choose(self) -> Mapping[int, Location]:
        hops = self._connected()
        for drone, node in self._nodes.items():
            node.hops, node.connected = hops.get(drone, NO_ROUTE), drone in hops
        departures = Departures(self._status(), self._goals, {}, self._rules, self._formation)
        free = (hops.keys() & self._goals.keys()) - self._refused.keys()
        choice = departures.choose(free)
        self._found.stays = {**choice.blocked, **self._refused}
        return choice.set_out

    def _status(self) -> MeshStatus:
        nodes = list(self._nodes.values())
        return MeshStatus(self._now_s, nodes, self._range_m, routing=self._routing)

    def _fly(self, node: NodeStatus, goal: Location) -> None:
        x, y, z = node.position
        path = self._rules.plan_flight((x, y, z), goal.to_vector(), self._now_s, SPEED_M_S)
        if path is None:
            fence = self._rules.fence
            self._refused[node.id] = fence.why_not(goal.to_vector()) or no_path(fence)
            self._found.stays[node.id] = self._refused[node.id]
            return
        self._flights[node.id] = path
        node.path = path_ahead(path, self._now_s)

    def _move(self) -> None:
        for drone, path in list(self._flights.items()):
            node = self._nodes[drone]
            node.position = path.position_at(self._now_s)
            node.path = path_ahead(path, self._now_s)
            if path.share_flown(self._now_s) >= 1.0:
                node.path = ()
                del self._flights[drone]
                if drone in self._formation:
                    landed_s = path.start_s + path.duration_s
                    self._found.duration_s = max(self._found.duration_s, landed_s)

    def _routers(self) -> set[int]:
        return {n for n, node in self._nodes.items() if node.on and node.role != Role.GATEWAY}

    def _connected(self) -> dict[int, int]:
        on = {n: node.position for n, node in self._nodes.items() if node.on}
        gateways = {n for n in on if self._nodes[n].role == Role.GATEWAY}
        flying = set() if self._routing == MEMBERS_IN_FLIGHT else self._flights.keys()
        relays = on.keys() - flying
        return Reach(on, gateways, self._range_m).hops(relays)

    def _note_who_is_cut_off(self) -> None:
        routers, connected = self._routers(), self._connected()
        lost = routers - connected.keys() - self._flights.keys()
        self._found.cut_off = list(lost.union(self._found.cut_off))
        if routers:
            share = len(routers & connected.keys()) / len(routers)
            self._found.least_connected = min(self._found.least_connected, share)
