"""What moves the drones of a run: their tracks, and the layouts that it orders."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Callable, Collection, Mapping, Sequence

from drone_mesh.drone.location import Location
from drone_mesh.formations.layouts import Layouts
from drone_mesh.formations.preview import preview
from drone_mesh.formations.standing_order import PartState
from drone_mesh.formations.standing_orders import StandingOrders
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.node import event_records
from drone_mesh.lab.network_sample import gateways_of, physical_graph
from drone_mesh.lab.places import StartPoint, side_of
from drone_mesh.lab.scenario import Scenario, Streams
from drone_mesh.mobility import Area, Track, tracks_of
from drone_mesh.mobility.trace_files import read_trace
from drone_mesh.state.model import MeshStatus

LOOK_S = 1.0  # between two looks at the drones; /mesh/state comes at least as often at real time

Order = Callable[[int, float, float, int], None]
"""Orders a drone to x, y and a height, in metres."""


class Formations:
    """The drone manager of a run, and the progress of the last layout."""

    def __init__(self, network: Network, order: Order) -> None:
        self.given_s: float | None = None  # when the last layout was ordered; None: none was
        self.planned_s = 0.0  # that it takes, by its preview
        # Since when all that can be reached are at their places.
        self.reached_s: float | None = None
        self.missing: list[int] = []  # those that are not, and can be reached
        self._network, self._order = network, order
        self._orders = StandingOrders()
        self._goals: dict[int, Location] = {}
        self._out_of_reach: set[int] = set()  # left out by the plan
        self._at_once = False
        self._number = 0
        self._events_read = 0

    def fly(
        self, cases: Sequence[int], apart_s: float, at_once: bool, ring_m: float | None = None
    ) -> None:
        """Order these layouts one after the other, from now on, and then a ring of that radius."""
        clock, nodes, shipped = self._network.clock, self._network.nodes, Layouts.shipped()
        layouts = [(f"layout {case}", dict(shipped.orders(case))) for case in cases]
        if ring_m is not None:
            layouts.append(("ring", self._ring(ring_m)))
        for count, (name, layout) in enumerate(layouts):
            goals = {drone: goal for drone, goal in layout.items() if drone in nodes}
            clock.call_at(clock.now_s + count * apart_s, self._give, (name, goals, at_once))
        clock.call_at(clock.now_s, self._look, None)

    def _ring(self, radius_m: float) -> dict[int, Location]:
        """A place for each router, on a circle that the first gateway closes."""
        gateway, *_others = gateways = gateways_of(self._network)
        start = self._network.location(gateway)
        routers = sorted(self._network.nodes.keys() - set(gateways))
        goals = {}
        for count, router in enumerate(routers, 1):
            angle = 2 * math.pi * count / (len(routers) + 1)
            north_m, east_m = radius_m * math.sin(angle), radius_m * (1 - math.cos(angle))
            goals[router] = Location(start.latitude + north_m, start.longitude + east_m, 0.0)
        return goals

    def _give(self, what: tuple[str, dict[int, Location], bool]) -> None:
        name, self._goals, at_once = what
        status = self._network.status()
        self.given_s, self.reached_s = status.stamp_s, None
        self._at_once = at_once
        self._plan(status, self._reach())
        self._number = self._orders.give(name, self._goals, status.stamp_s, at_once)

    def _plan(self, status: MeshStatus, reach: Collection[int]) -> None:
        standing = self._orders.goals(status)
        plan = preview(status, self._goals, at_once=self._at_once, standing=standing)
        self._out_of_reach = plan.stays.keys() - reach
        self.planned_s = status.stamp_s - (self.given_s or 0.0) + plan.duration_s

    def _reach(self) -> Collection[int]:
        return physical_graph(self._network).hops_from(gateways_of(self._network))

    def _look(self, _: object) -> None:
        network = self._network
        for event in event_records(network.events[self._events_read :]):
            self._orders.on_event(event)
        self._events_read = len(network.events)
        for drone, to in self._orders.update(network.status()):
            self._order(drone, to.longitude, to.latitude, round(to.height))
        self._observe()
        network.clock.call_at(network.clock.now_s + LOOK_S, self._look, None)

    def _observe(self) -> None:
        """A drone can be reached while it flies, or has power and a path to a gateway.

        One that has been at its place and left it for a repair is not missing. The plan is made
        anew when a drone can be reached that had no path when it was made.
        """
        network = self._network
        reach = self._reach()
        if self._out_of_reach.intersection(reach):
            self._plan(network.status(), reach)
        (progress,) = [p for p in self._orders.all_progress() if p.number == self._number]
        done = {*progress.drones[PartState.ARRIVED], *progress.drones[PartState.REFUSED]}
        self.missing = [
            drone
            for drone in self._goals.keys() - done
            if drone in reach or network.nodes[drone].drone.path is not None
        ]
        if self.missing:
            self.reached_s = None
        elif self.reached_s is None:
            self.reached_s = network.clock.now_s


LEAST_BETWEEN_ORDERS_S = 5.0  # of one drone; a model may turn more often


def rows_of_file(path: Path) -> list[list[float]]:
    """A trace as numbers: id, t, x, y, z. Raises ConfigurationError."""
    return [[float(node), *knot] for node, knots in read_trace(path).items() for knot in knots]


def area_of(scenario: Scenario, places: Sequence[StartPoint]) -> Area:
    """The rectangle in which drones move: given, or that of the layout."""
    if scenario.mobility.area is not None:
        return Area(*scenario.mobility.area)
    if scenario.layout.kind == "uniform":
        side_m = side_of(scenario.layout, scenario.range_m)
        return Area(0.0, 0.0, side_m, side_m)
    xs, ys = [place.x for place in places], [place.y for place in places]
    return Area(min(xs), min(ys), max(xs) - min(xs), max(ys) - min(ys))


def tracks(scenario: Scenario, places: Sequence[StartPoint], streams: Streams) -> dict[int, Track]:
    """The tracks of the drones that move, from a stream of their own."""
    return tracks_of(
        scenario.mobility.mobility,
        {place.node_id: (place.x, place.y, 0.0) for place in places},
        {place.node_id for place in places if place.gateway},
        area_of(scenario, places),
        streams.number("motion"),
    )


class ToldPilots:
    """Orders every leg of the tracks through the mesh, at the speed of the leg.

    Flights follow the profile of ordered flights, so a drone falls behind its track by the climb.
    """

    def __init__(self, network: Network, flown: Mapping[int, Track], order: Order) -> None:
        self._network, self._tracks, self._order = network, flown, order
        self._ordered: dict[int, tuple[float, ...]] = {}
        self._next_s: dict[int, float] = {}
        network.clock.call_at(0.0, self._look, None)

    def _look(self, _: object) -> None:
        now_s = self._network.clock.now_s
        for node, track in self._tracks.items():
            goal = track.leg_at(now_s).end
            if goal != self._ordered.get(node) and now_s >= self._next_s.get(node, 0.0):
                self._ordered[node], self._next_s[node] = goal, now_s + LEAST_BETWEEN_ORDERS_S
                self._set_speed(node, track, now_s)
                x, y, height = goal
                self._order(node, x, y, round(height))
        self._network.clock.call_at(now_s + LOOK_S, self._look, None)

    def _set_speed(self, node: int, track: Track, now_s: float) -> None:
        velocity = track.velocity_at(now_s)
        speed_m_s = sum(part**2 for part in velocity) ** 0.5
        if speed_m_s:
            self._network.nodes[node].drone.speed_m_s = speed_m_s
