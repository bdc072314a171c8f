"""Limits of height, distance and speed, and what the program may do without the pilot."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drone_mesh.drone.flight_path import SPEED_M_S
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError, GoalRefused

MAX_SPEED_M_S = 20.0  # more than drones of this kind can fly


@dataclass(frozen=True)
class FlightLimits:
    """Metres, seconds, percent. Heights are in the common frame unless stated otherwise."""

    max_height_m: float = 50.0  # above home
    max_distance_m: float = 500.0  # from home, horizontally
    speed_m_s: float = SPEED_M_S
    min_battery_percent: float = 30.0
    cruise_height_m: float = 10.0  # of the lowest layer
    layer_m: float = 2.0  # between layers; 0: all drones cross at the same height
    hover_m: float | None = None  # height at the end of a repair; None: unchanged

    def __post_init__(self) -> None:
        """Raise ConfigurationError, which names the option, for values out of range."""
        bounds = (
            ("--max-height", self.max_height_m, 1.0, 500.0),
            ("--max-distance", self.max_distance_m, 1.0, 5000.0),
            ("--speed", self.speed_m_s, 0.1, MAX_SPEED_M_S),
            ("--min-battery", self.min_battery_percent, 0.0, 100.0),
            ("--cruise-height", self.cruise_height_m, 1.0, self.max_height_m),
            ("--layers", self.layer_m, 0.0, self.max_height_m),
            ("--hover", 1.0 if self.hover_m is None else self.hover_m, 1.0, self.max_height_m),
        )
        for name, value, lowest, highest in bounds:
            if not lowest <= value <= highest:  # false for NaN too
                raise ConfigurationError(f"{name} {value:g} is outside {lowest:g}..{highest:g}")

    def layer_height_m(self, node_id: int) -> float:
        """The height at which this node flies across: its own layer, if there are enough layers."""
        if self.layer_m == 0.0:
            return self.cruise_height_m
        room_m = self.max_height_m - self.cruise_height_m
        layers = 1 + int(room_m / self.layer_m)
        return self.cruise_height_m + self.layer_m * (node_id % layers)

    def ceiling_m(self, home: Location) -> float:
        return home.height + self.max_height_m

    def check(self, goal: Location, home: Location) -> None:
        """Raise GoalRefused for a goal outside the limits around `home`."""
        check_goal(*goal)
        distance_m = math.hypot(goal.latitude - home.latitude, goal.longitude - home.longitude)
        if distance_m > self.max_distance_m:
            raise GoalRefused(
                f"{distance_m:.0f} m from home is more than --max-distance {self.max_distance_m:g}"
            )
        if goal.height > self.ceiling_m(home):
            raise GoalRefused(
                f"{goal.height - home.height:.0f} m above home is more than --max-height "
                f"{self.max_height_m:g}"
            )


@dataclass(frozen=True)
class Permissions:
    """Actions of the pilot that the program may take."""

    may_arm: bool = False
    may_take_off: bool = False
    may_change_mode: bool = False  # from holding a position to following this program
    orders_may_take_back_s: float | None = None
    """How long after somebody else chose to hold the position an order may end that; None: never.

    A repair never may.
    """

    def __post_init__(self) -> None:
        """Raise ConfigurationError for values out of range."""
        pause_s = self.orders_may_take_back_s
        if pause_s is None:
            return
        if not 0.0 <= pause_s < math.inf:
            raise ConfigurationError(f"--orders-may-take-back {pause_s:g} is not a time in seconds")
        if not self.may_change_mode:
            raise ConfigurationError("--orders-may-take-back needs --may-change-mode")
