"""The bounds of the numbers of a motion and of the area in which it takes place."""

from __future__ import annotations

import math

from drone_mesh.errors import ConfigurationError
from drone_mesh.mobility.area import Area
from drone_mesh.mobility.settings import Mobility


def check(mobility: Mobility) -> None:
    """Raise ConfigurationError for numbers that no model can use."""
    low, high = mobility.speed_m_s
    for name, is_right, rule in (
        ("speed_m_s", 0 < low <= high, "two speeds above 0, the lower first"),
        ("share", 0 <= mobility.share <= 1, "0..1"),
        ("alpha", 0 <= mobility.alpha <= 1, "0..1"),
        ("pause_s", mobility.pause_s >= 0, "0 or more"),
        ("update_s", mobility.update_s > 0, "above 0"),
        ("radius_m", mobility.radius_m > 0, "above 0"),
        ("groups", mobility.groups >= 1, "1 or more"),
        ("lanes", mobility.lanes >= 1, "1 or more"),
        ("waypoints", len(set(mobility.waypoints)) != 1, "two different places or more"),
    ):
        if not is_right:
            raise ConfigurationError(
                f"invalid mobility {name} {getattr(mobility, name)}: must be {rule}"
            )


def check_area(mobility: Mobility, area: Area) -> None:
    """Raise ConfigurationError if the drones of this motion cannot move in this area."""
    problem = None
    if not all(map(math.isfinite, area)) or min(area.width_m, area.depth_m) < 0:
        problem = "must have finite numbers, its width and depth 0 or more"
    elif mobility.kind == "gauss_markov" and not area.width_m * area.depth_m:
        problem = "gauss_markov needs a width and a depth above 0"  # or it reflects for ever
    elif mobility.moves_over_area and not area.diagonal_m:
        problem = f"{mobility.kind} needs a width or a depth above 0"
    if problem is not None:
        x, y, width_m, depth_m = area
        raise ConfigurationError(
            f"invalid area {width_m:g} x {depth_m:g} m at ({x:g}, {y:g}): {problem}"
        )
