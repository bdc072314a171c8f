"""Records which drones flew when, and how far; wind and batteries act here."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from typing import Callable, Iterable, Iterator

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.repair.options import CLEARANCE_M
from drone_mesh.drone.flight_path import CLIMB_ENDS_AT, DESCENT_STARTS_AT, FlightPath
from drone_mesh.drone.location import Location
from drone_mesh.inprocess import Network
from drone_mesh.lab.network_sample import gateways_of, physical_graph

_FLIGHTS = (MeshEventKind.FLIGHT_DECIDED, MeshEventKind.FLIGHT_ORDERED)
TOUCH_M = 1e-3  # rounding; a way comes no nearer than where it begins
EVENTS_BACK = 20  # when a flight starts, its event is among this many latest ones


@dataclass
class Leg:
    """One straight part of a flight, until it ends or another goal replaces it."""

    node: int
    path: FlightPath
    is_start: bool  # the drone was at rest before
    had_path: bool  # a repair flight although a path to a gateway existed
    replaced_s: float | None = None
    warned_of: set[int] = field(
        default_factory=set
    )  # drones on its way that it could have known of

    @property
    def end_s(self) -> float:
        """When it ended or will end."""
        planned_s = self.path.start_s + self.path.duration_s
        return planned_s if self.replaced_s is None else min(planned_s, self.replaced_s)

    def metres_until(self, now_s: float) -> float:
        """Distance flown over ground."""
        return self.path.ground_flown_m(min(now_s, self.end_s))


class Flights:
    """Observes the goals of all drones of a network."""

    def __init__(self, network: Network) -> None:
        self.legs: list[Leg] = []
        self._network = network
        self._current: dict[int, Leg] = {}
        self._ordered: dict[int, bool] = {}  # whether a drone's latest flight is by order
        self._events_read = 0
        self._may_fly_m: dict[int, float] = {}
        self._on_empty: Callable[[int], None] = lambda node: None
        for node_id, node in network.nodes.items():
            node.drone.observe(functools.partial(self._fly, node_id))

    @property
    def in_the_air(self) -> list[int]:
        nodes = self._network.nodes
        return [node for node in self._current if nodes[node].drone.path is not None]

    def _flown_m(self, node: int, but: Leg | None = None) -> float:
        """Metres over ground until now, on all legs but this one."""
        now_s = self._network.clock.now_s
        legs = [leg for leg in self.legs if leg.node == node and leg is not but]
        return sum(leg.metres_until(now_s) for leg in legs)

    def limit(self, nodes: list[int], metres: float, on_empty: Callable[[int], None]) -> None:
        """From now on these drones can fly this far; then call `on_empty(node)`."""
        self._on_empty = on_empty
        for node in nodes:
            self._may_fly_m[node] = self._flown_m(node) + metres
            if node in self._current:
                self._plan_end_of_battery(self._current[node])

    def _fly(self, node: int, before: FlightPath | None, path: FlightPath) -> None:
        last = self._current.get(node)
        if last is not None and before is not None:
            last.replaced_s = path.start_s
        is_false = before is None and self._decided_by_itself(node) and self._has_path(node)
        leg = Leg(node, path, before is None, is_false)
        self._current[node] = leg
        self.legs.append(leg)
        self._note_known(leg)
        self._plan_end_of_battery(leg)

    def look(self) -> None:
        """Note what those on a repair flight could know by now of the drones on their way."""
        events = self._network.events
        for event in events[self._events_read :]:
            if event.kind in _FLIGHTS:
                self._ordered[event.node] = event.kind is MeshEventKind.FLIGHT_ORDERED
        self._events_read = len(events)
        for node in self.in_the_air:
            if not self._ordered.get(node):
                self._note_known(self._current[node])

    def _note_known(self, leg: Leg) -> None:
        """Note to whom the rest of its way comes nearer than the clearance, and could be known.

        A way that leads away from one beside whom the drone landed unawares comes no nearer.
        """
        now_s = self._network.clock.now_s
        here = Location.from_vector(leg.path.position_at(now_s))
        on_way = {
            node: place
            for node, place in self._resting_places()
            if node not in leg.warned_of
            and node != leg.node
            and leg.path.passes_m(place.to_vector(), now_s)
            < min(CLEARANCE_M, here.distance_m(place) - TOUCH_M)
        }
        if on_way:
            path = leg.path
            leg.warned_of |= could_know(
                self._network,
                leg.node,
                on_way,
                lambda _node, told: path.passes_m(told.to_vector(), now_s) < CLEARANCE_M,
            )

    def _resting_places(self) -> Iterator[tuple[int, Location]]:
        """Where each drone is, or will be at the end of its flight."""
        for node_id, node in self._network.nodes.items():
            path = node.drone.path
            yield node_id, Location.from_vector(path.goal) if path else node.drone.get_location()

    def _plan_end_of_battery(self, leg: Leg) -> None:
        if leg.node not in self._may_fly_m:
            return
        left_m = self._may_fly_m[leg.node] - self._flown_m(leg.node, but=leg)
        way_m = leg.path.ground_m
        if left_m < way_m:
            clock = self._network.clock
            across = DESCENT_STARTS_AT - CLIMB_ENDS_AT  # share of the flight's time
            share = CLIMB_ENDS_AT + across * max(0.0, left_m) / way_m
            at_s = leg.path.start_s + leg.path.duration_s * share
            clock.call_at(max(clock.now_s, at_s), self._battery_is_empty, leg)

    def _battery_is_empty(self, leg: Leg) -> None:
        if leg is self._current.get(leg.node) and leg.replaced_s is None:
            self._on_empty(leg.node)

    def _has_path(self, node: int) -> bool:
        graph = physical_graph(self._network)
        return node in graph.hops_from(gateways_of(self._network))

    def _decided_by_itself(self, node: int) -> bool:
        """Whether this flight is a repair and not an order, from the node's latest events."""
        for event in reversed(self._network.events[-EVENTS_BACK:]):
            if event.node == node and event.kind is MeshEventKind.FLIGHT_DECIDED:
                return event.now_s == self._network.clock.now_s
        return False


def could_know(
    network: Network, asker: int, nodes: Iterable[int], would_help: Callable[[int, Location], bool]
) -> set[int]:
    """Of which of these drones `asker` could know a place that would help it.

    From its own table, or from a live node to which links lead now: that is the drone itself, or
    has a place of it in its table for which `would_help(drone, place)`.
    """
    in_reach = {asker, *physical_graph(network).hops_from([asker])}
    return {
        node
        for node in nodes
        if node in in_reach
        or any(would_help(node, told) for one in in_reach for told in _told(network, one, node))
    }


def _told(network: Network, knower: int, node: int) -> Iterator[Location]:
    """The places of `node` in the tables of `knower`."""
    component = network.nodes[knower].component
    control, gateway = component.control, component.places.gateway
    for known, heard in control.neighbours.taken():
        if known == node:
            yield heard.place
    if gateway is not None and control.gateway == node:
        yield gateway
