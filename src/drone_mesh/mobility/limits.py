"""The bounds of the numbers of a motion and of the area in which it takes place."""

from __future__ import annotations

import numbers
from typing import Iterator, Sequence, cast

from drone_mesh.arguments import MOST
from drone_mesh.drone.goal import MAX_HEIGHT_M
from drone_mesh.errors import ConfigurationError
from drone_mesh.mobility.area import Area
from drone_mesh.mobility.settings import Mobility


def check(mobility: Mobility) -> None:
    """Raise ConfigurationError for numbers that no model can use."""
    for name, is_right, rule in _rules(mobility):
        if not is_right:
            raise ConfigurationError(
                f"invalid mobility {name} {getattr(mobility, name)}: must be {rule}"
            )
    for node, knots in mobility.knots.items():
        if not knots or not all(_is_tuple(knot, 4) for knot in knots):
            problem = "must be t, x, y and z, finite numbers, once or more"
        elif not all(knot[0] >= before[0] for before, knot in zip(knots, knots[1:])):
            problem = "t must not fall"
        else:
            continue
        raise ConfigurationError(f"invalid mobility knots of drone {node}: {problem}")


def _rules(mobility: Mobility) -> Iterator[tuple[str, bool, str]]:
    """For each number: its name, whether it is valid, and what it has to be."""
    speeds = mobility.speed_m_s
    are_right = _is_tuple(speeds, 2) and 0 < speeds[0] <= speeds[1]
    yield "speed_m_s", are_right, "two speeds above 0, the lower first, such as (0.3, 0.3)"
    yield "share", _is_in(0, mobility.share, 1), "0..1"
    yield "alpha", _is_in(0, mobility.alpha, 1), "0..1"
    yield "pause_s", _is_in(0, mobility.pause_s), "0 or more"
    yield "update_s", _is_in(0, mobility.update_s) and mobility.update_s > 0, "above 0"
    yield "radius_m", _is_in(0, mobility.radius_m) and mobility.radius_m > 0, "above 0"
    for name in ("groups", "lanes"):
        count = getattr(mobility, name)
        yield name, isinstance(count, int) and count >= 1, "a whole number, 1 or more"
    height_m, ceiling_m, most_m = mobility.height_m, mobility.cruise_height_m, MAX_HEIGHT_M
    yield "height_m", _is_in(0, height_m, most_m), f"0..{most_m:g}"
    is_above = _is_in(height_m, ceiling_m, most_m)
    yield "cruise_height_m", is_above, f"from height_m, {height_m:g}, to {most_m:g}"
    corners = mobility.waypoints
    are_pairs = all(_is_tuple(corner, 2) for corner in corners)
    are_right = are_pairs and len(set(map(tuple, corners))) != 1
    yield "waypoints", are_right, "pairs x, y of finite numbers, two different places or more"


def _is_in(low: float, value: object, high: float = MOST) -> bool:
    """Whether `value` is a number in this range."""
    return isinstance(value, numbers.Real) and low <= cast(float, value) <= high


def _is_tuple(values: object, length: int) -> bool:
    """Whether these are so many finite numbers."""
    return (
        isinstance(values, Sequence)
        and len(values) == length
        and all(_is_in(-MOST, value) for value in values)
    )


def check_area(mobility: Mobility, area: Area) -> None:
    """Raise ConfigurationError if the drones of this motion cannot move in this area."""
    problem = None
    if not _is_tuple(area, 4) or min(area.width_m, area.depth_m) < 0:
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
