"""A fleet: ids, roles and start positions (docs/wire.md, "Identity", and docs/ros.md, "Fleet")."""

from __future__ import annotations

import math
from typing import Collection, Final, Iterable, NamedTuple

from drone_mesh.drone.roles import Role
from drone_mesh.errors import ConfigurationError

MAX_DRONES: Final = 254  # ids 0..253
DEFAULT_ROUTERS = 17  # as in the field case
DEFAULT_GRIDSIZE = 6  # routers in a row
DEFAULT_SPACING_M = 1.0
GATEWAY_COLUMN_M = -1.0  # x of all gateways; spaced 1 m apart along y


class StartPlace(NamedTuple):
    """Id, role and start position of one drone."""

    node_id: int
    role: Role
    longitude: float  # x, metres
    latitude: float  # y, metres


def ids_in_words(ids: Iterable[int], shortest_run: int = 2) -> str:
    """For example: 0..3, 5. Shorter runs are named one by one."""
    runs: list[list[int]] = []
    for node_id in sorted(ids):
        if runs and node_id == runs[-1][1] + 1:
            runs[-1][1] = node_id
        else:
            runs.append([node_id, node_id])
    return ", ".join(
        f"{a}..{b}" if b - a + 1 >= shortest_run else ", ".join(map(str, range(a, b + 1)))
        for a, b in runs
    )


def drones_in_words(ids: Collection[int]) -> str:
    """For example: drone 3; drones 3, 5..9."""
    return f"drone{'' if len(ids) == 1 else 's'} {ids_in_words(ids)}"


def plan_fleet(
    gateways: int, routers: int, gridsize: int, spacing: float
) -> tuple[StartPlace, ...]:
    """Ids, roles and start positions of a fleet, by id: gateways first, from 0.

    `gridsize` is the number of routers in a row along x, `spacing` their distance in metres.
    Raises ConfigurationError, which names the parameter, for an invalid fleet.
    """
    if gateways < 0:
        raise ConfigurationError(f"invalid gateways {gateways}: must be 0 or more")
    if routers < 0:
        raise ConfigurationError(f"invalid routers {routers}: must be 0 or more")
    if gateways + routers > MAX_DRONES:
        raise ConfigurationError(
            f"gateways + routers: {gateways} + {routers} = {gateways + routers} drones, "
            f"but node ids allow at most {MAX_DRONES}"
        )
    if gridsize < 1:
        raise ConfigurationError(f"invalid gridsize {gridsize}: must be 1 or more")
    if not (math.isfinite(spacing) and spacing > 0):
        raise ConfigurationError(f"invalid spacing {spacing}: must be above 0 m")
    gateway_places = [
        StartPlace(i, Role.GATEWAY, GATEWAY_COLUMN_M, float(i)) for i in range(gateways)
    ]
    router_places = [
        StartPlace(gateways + k, Role.ROUTER, spacing * (k % gridsize), spacing * (k // gridsize))
        for k in range(routers)
    ]
    return tuple(gateway_places + router_places)
