"""Reserves: how long each drone can stay in the air before it must set out for home."""

from __future__ import annotations

import math
from typing import Mapping

from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.drone.battery import LAND_AT_PERCENT, LEAST_USE_PERCENT, MARGIN_PERCENT
from drone_mesh.drone.flight_path import SPEED_M_S
from drone_mesh.drone.interfaces import ON_GROUND_M
from drone_mesh.drone.location import Location
from drone_mesh.state.model import REPAIR_STATES, NodeStatus


def place_of(node: NodeStatus) -> Location:
    """Where it is."""
    return Location.from_vector(node.position)


def is_in_air(node: NodeStatus) -> bool:
    """Whether it flies or hovers."""
    return len(node.path) > 0 or place_of(node).height > ON_GROUND_M


def repairs(node: NodeStatus) -> bool:
    """Whether it flies to repair a connection."""
    return REPAIR_STATES[node.repair_state] is RepairState.FLYING


def is_low(node: NodeStatus) -> bool:
    """Whether its battery lasts for nothing but the way home; False if its charge is unknown."""
    return node.battery <= LAND_AT_PERCENT + MARGIN_PERCENT


class Reserves:
    """The homes of the drones, and how fast each in the air empties its battery."""

    def __init__(self, hover_s: float, homes: Mapping[int, Location]) -> None:
        """`hover_s`: with a full battery, until the use of a drone is known."""
        self.homes = dict(homes)  # where they stand on their pads, or were first seen standing
        self._usual_per_s = 100.0 / hover_s
        self._began: dict[int, tuple[float, float]] = {}  # take-off: when (s), with how much (%)
        self._now_s = 0.0

    def look(self, node: NodeStatus, now_s: float) -> None:
        """Learn its home and its use."""
        self._now_s = now_s
        if len(node.home):
            self.homes[node.id] = Location.from_vector(node.home)
        if not is_in_air(node):
            self.homes.setdefault(node.id, place_of(node))
            self._began.pop(node.id, None)
        elif node.battery > self._began.get(node.id, (now_s, -math.inf))[1]:  # it may recover a bit
            self._began[node.id] = now_s, node.battery

    def left_s(self, node: NodeStatus) -> float:
        """Until it must set out for home; infinity: its charge is not known."""
        if math.isnan(node.battery):
            return math.inf
        begin_s, begin_percent = self._began.get(node.id, (self._now_s, node.battery))
        used, passed_s, per_s = begin_percent - node.battery, self._now_s - begin_s, 0.0
        if used >= LEAST_USE_PERCENT and passed_s > 0.0:
            per_s = used / passed_s
        left = node.battery - LAND_AT_PERCENT - MARGIN_PERCENT
        return left / (per_s or self._usual_per_s) - self.flight_s(node.id, place_of(node))

    def flight_s(self, drone: int, place: Location) -> float:
        """From the home of a drone to this place; 0.0 if its home is not known."""
        home = self.homes.get(drone)
        return 0.0 if home is None else home.distance_m(place) / SPEED_M_S
