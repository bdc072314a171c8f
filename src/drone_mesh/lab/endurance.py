"""Batteries, pads and reliefs of a run, and what became of the posts (docs/endurance.md)."""

from __future__ import annotations

import contextlib
import itertools
import math
from dataclasses import dataclass, field, replace
from typing import Sequence

import numpy as np

from drone_mesh.drone.battery import (
    FLAT,
    LAND_AT_PERCENT,
    MARGIN_PERCENT,
    READY_PERCENT,
    Battery,
    Crews,
    PowerModel,
)
from drone_mesh.drone.fleet import MAX_DRONES
from drone_mesh.drone.flight_path import SPEED_M_S
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError, GoalRefused
from drone_mesh.formations.posts import BESIDE_M
from drone_mesh.formations.relief import CARRIES_S, Relief, ReliefRules
from drone_mesh.formations.relief_policies import relief_policy
from drone_mesh.formations.standing_orders import StandingOrders
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.node import event_records
from drone_mesh.lab.formations import LOOK_S
from drone_mesh.lab.network_sample import NetworkSample, gateways_of
from drone_mesh.lab.places import StartPoint
from drone_mesh.lab.scenario import Endurance
from drone_mesh.lab.timeline import Timeline

HOLDS_M = BESIDE_M + 0.5  # from its place, a drone still holds a post
STAND_M = 1.5  # between two places on a pad
CLEAR_OF_POSTS_M = 2.5  # over ground, from a place on a pad: drones rise and land past them
_HOME_M = 0.5


def with_spares(part: Endurance, places: Sequence[StartPoint]) -> list[StartPoint]:
    """The drones of a layout and the spares, each on its pad. Raises ConfigurationError."""
    routers = sum(not place.gateway for place in places)
    spares = round(part.spares * routers)
    if len(places) + spares > MAX_DRONES:
        raise ConfigurationError(f"endurance: {len(places) + spares} drones are too many")
    first = 1 + max(place.node_id for place in places)
    stands = _stands(part, places, spares)
    return [*places, *(StartPoint(first + n, *stands[n], False) for n in range(spares))]


def _stands(
    part: Endurance, places: Sequence[StartPoint], number: int
) -> list[tuple[float, float]]:
    """So many places on the pads in turn, each beside the others and under no post."""
    gateway = next(place for place in places if place.gateway)
    span = range(-MAX_DRONES, MAX_DRONES + 1)
    grid = sorted(itertools.product(span[192:-192], repeat=2), key=lambda p: (math.hypot(*p), p))
    found: list[tuple[float, float]] = []
    near = [(place.x, place.y) for place in places]
    turns = [iter(grid) for _ in part.pads]
    while len(found) < number:
        pad = len(found) % len(part.pads)
        for column, row in turns[pad]:
            x = gateway.x + part.pads[pad][0] + STAND_M * column
            y = gateway.y + part.pads[pad][1] + STAND_M * row
            away_m = min(math.dist((x, y), other) for other in near)
            beside_m = min((math.dist((x, y), other) for other in found), default=STAND_M)
            if away_m >= CLEAR_OF_POSTS_M and beside_m >= STAND_M - 1e-6:
                found.append((x, y))
                break
        else:
            raise ConfigurationError(f"endurance: no room for {number} drones on the pads")
    return found


@dataclass
class EnduranceFigures:
    """What became of batteries and posts."""

    posts: int
    spares: int
    least_spares: int  # by `fewest_spares`
    energy_wh: float = 0.0
    swaps: int = 0
    reliefs: int = 0
    least_percent: float = 100.0  # of a drone in the air
    fell: list[int] = field(default_factory=list)  # their batteries ran empty in the air
    astray: list[int] = field(default_factory=list)  # at the end, on the ground but not at home
    watched_s: float = 0.0
    held_post_s: float = 0.0  # seconds times posts held by a served drone
    longest_gap_s: float = 0.0  # that one post was not
    lived_s: float | None = None  # until less than half of the posts were, for good


def fewest_spares(part: Endurance, posts: int, flight_s: float) -> int:
    """Fewer can hold the posts under no schedule, even one that knows everything.

    Of each battery a drone serves what is left of it after both flights; it is away for the flights
    and the swap (Arribas, Cholvi and Mancuso, arXiv 2205.12656). The pads swap no faster than they
    can: with too few of them no number of spares is enough (MAX_DRONES).
    """
    use_s = 60.0 * part.hover_min * (1.0 - (LAND_AT_PERCENT + MARGIN_PERCENT) / 100.0)
    serves_s = use_s - 2.0 * flight_s - CARRIES_S
    if serves_s <= 0 or posts * part.swap_s > serves_s * part.at_once * len(part.pads):
        return MAX_DRONES
    return math.ceil(posts * ((use_s + part.swap_s) / serves_s - 1.0))


class EnduranceRun:
    """The batteries of a network's drones, its pads, and the gateway that sends reliefs."""

    def __init__(
        self,
        part: Endurance,
        layout: Sequence[StartPoint],
        network: Network,
        timeline: Timeline,
    ) -> None:
        """The drones of the layout hover from the start on; the spares stand on their pads."""
        self._network, self._timeline = network, timeline
        model = PowerModel(hover_s=60.0 * part.hover_min)
        drones = {n: node.drone for n, node in network.nodes.items()}
        for place in layout:
            drone = drones[place.node_id]
            drone.put(drone.get_location()._replace(height=part.height_m))
        self._routers = sorted(drones.keys() - gateways_of(network))
        self._batteries = {n: Battery(model) for n in self._routers}
        for n, battery in self._batteries.items():
            drones[n].battery = battery
        posts = [place.node_id for place in layout if not place.gateway]
        spares = [n for n in self._routers if n not in posts]
        stands = _stands(part, layout, len(self._routers))
        ordered = [*spares, *posts]  # the spares stand there
        self._homes = {n: Location(y, x, 0.0) for n, (x, y) in zip(ordered, stands)}
        for n, home in self._homes.items():
            drones[n].home_place = home
        self._pads = {drone: count % len(part.pads) for count, drone in enumerate(ordered)}
        self._posts: np.ndarray = np.array([drones[n].get_location().to_vector() for n in posts])
        self._since_s: np.ndarray = np.full(len(posts), math.nan)  # when each post was left
        flights_m = [self._homes[n].distance_m(drones[n].get_location()) for n in posts]
        flight_s = sum(flights_m) / len(posts) / SPEED_M_S
        least = fewest_spares(part, len(posts), flight_s)
        self.figures = EnduranceFigures(len(posts), len(spares), least)
        rules = ReliefRules(part.swap_s, part.at_once * len(part.pads), model.hover_s)
        self._relief = Relief(relief_policy(part.relief), rules, self._homes)
        self._crews = Crews(part.swap_s, part.at_once)
        self._orders, self._events_read, self._sampled_s = StandingOrders(), 0, math.nan
        network.clock.call_at(LOOK_S, self._look, None)

    def _look(self, _: object) -> None:
        network, now_s = self._network, self._network.clock.now_s
        for n in self._routers:
            if not (self._use_battery(n) and self._is_home(n)):
                self._crews.leave(n, self._pads[n])
            elif self._crews.serve(n, self._pads[n], now_s):
                self._batteries[n].swap()
        for event in event_records(network.events[self._events_read :]):
            self._orders.on_event(event)
        self._events_read = len(network.events)
        status = network.status()
        self._relief.update(status, self._orders)
        for n, to in self._orders.update(status):
            self._timeline.send_order(n, to.longitude, to.latitude, round(to.height))
        self._orders.forget_complete()
        network.clock.call_at(now_s + LOOK_S, self._look, None)

    def _is_home(self, n: int) -> bool:
        return self._network.location(n).distance_m(self._homes[n]) <= _HOME_M

    def _use_battery(self, n: int) -> bool:
        """Use up what the last LOOK_S took; returns whether the drone needs another battery."""
        drone, battery = self._network.nodes[n].drone, self._batteries[n]
        in_air = drone.path is not None or drone.get_location().height > 0.0
        before = battery.percent
        speed_m_s = 0.0 if drone.path is None else drone.speed_m_s
        battery.use(LOOK_S, speed_m_s if in_air else None)
        if in_air:
            self.figures.least_percent = min(self.figures.least_percent, battery.percent)
            if battery.percent == FLAT:
                with self._timeline.disruption("battery empty", [n]):
                    self._network.power(n, False)
                    drone.fall()
                    self._network.air.moved([n])
                self.figures.fell.append(n)
            elif before > LAND_AT_PERCENT >= battery.percent:
                self._come_down(n)
        return battery.percent < READY_PERCENT and not in_air

    def _come_down(self, n: int) -> None:
        """By itself, as an autopilot does: home, or to the ground below if there is no way."""
        drone = self._network.nodes[n].drone
        try:
            drone.fly_to(self._homes[n])
        except GoalRefused:
            with contextlib.suppress(GoalRefused):
                drone.fly_to(drone.get_location()._replace(height=0.0))

    def look(self, sample: NetworkSample) -> None:
        """Note which posts are held by a served drone."""
        figures, passed_s = self.figures, sample.now_s - self._sampled_s
        places = [self._network.location(n).to_vector() for n in sample.served]
        points: np.ndarray = np.array(places, dtype=float).reshape(-1, 3)
        away_m = np.linalg.norm(self._posts[:, None] - points[None], axis=2)
        held = (away_m <= HOLDS_M).any(axis=1)
        if math.isnan(self._sampled_s):
            if held.all():
                self._sampled_s = sample.now_s
            return
        self._sampled_s = sample.now_s
        figures.watched_s += passed_s
        figures.held_post_s += passed_s * float(held.sum())
        self._since_s = np.where(held, math.nan, np.fmin(self._since_s, sample.now_s - passed_s))
        gaps_s = sample.now_s - self._since_s
        if not held.all():
            figures.longest_gap_s = max(figures.longest_gap_s, float(np.nanmax(gaps_s)))
        if held.mean() >= 0.5:
            figures.lived_s = None
        elif figures.lived_s is None:
            figures.lived_s = sample.now_s

    def finished(self) -> EnduranceFigures:
        """The figures so far."""
        nodes = self._network.nodes
        down = [n for n in self._routers if nodes[n].drone.path is None]
        grounded = [n for n in down if self._network.location(n).height <= 0.0]
        return replace(
            self.figures,
            energy_wh=sum(battery.used_j for battery in self._batteries.values()) / 3600.0,
            swaps=self._crews.swaps,
            reliefs=self._relief.reliefs,
            astray=[n for n in grounded if not self._is_home(n)],
        )
