"""The motion of a run: tracks for its drones, flown by pilots or ordered through the mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Mapping, Sequence

from drone_mesh.inprocess import Network
from drone_mesh.lab.formations import Order
from drone_mesh.lab.places import StartPoint, side_of
from drone_mesh.lab.scenario import Scenario
from drone_mesh.lab.streams import Streams
from drone_mesh.mobility import Area, Track, tracks_of
from drone_mesh.mobility.trace_files import read_trace

LEAST_BETWEEN_ORDERS_S = 5.0  # of one drone; a model may turn more often
LOOK_S = 1.0  # period at which the goals of told drones are compared


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
