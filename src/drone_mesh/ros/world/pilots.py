"""Who flies the drones of a new simulation: missions from a file, or a model of motion."""

from __future__ import annotations

import logging
import math
from typing import Mapping, Sequence

from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.drone.roles import Role
from drone_mesh.errors import ConfigurationError, GoalRefused
from drone_mesh.formations.missions import Mission
from drone_mesh.mobility import Area, Mobility, tracks_of
from drone_mesh.mobility.pilot import TrackPilot
from drone_mesh.world.factory import VirtualDrone

MEAN_DEGREE = 10.0  # neighbours on average, if drones were uniform in the area
HEIGHT_M = 2.0  # of the models' flights

_log = logging.getLogger(__name__)


def start_pilots(
    configuration: FactoryConfiguration,
    missions: Mapping[int, Mission],
    drones: Sequence[VirtualDrone],
) -> None:
    """Give each drone that moves its pilot; `missions` name drones of the fleet only.

    The models move the routers in a square around the fleet, all at one height. Raises
    ConfigurationError for a mission outside the fence.
    """
    if configuration.flight == "dynamic" and configuration.mobility != "none":
        _log.warning(
            "mobility:=%s flies all drones at one height, and with flight:=dynamic those that meet "
            "crash; missions can keep them apart",
            configuration.mobility,
        )
    by_id = {drone.node_id: drone for drone in drones}
    speed_m_s = configuration.speed
    mobility = Mobility(
        configuration.mobility, (speed_m_s, speed_m_s), height_m=HEIGHT_M, steady=False
    )
    places = {node: drone.engine.get_location().to_vector() for node, drone in by_id.items()}
    gateways = {node for node, drone in by_id.items() if drone.role is Role.GATEWAY}
    if places:
        area = area_around(list(places.values()), configuration.max_distance)
        for node, track in tracks_of(mobility, places, gateways, area, configuration.seed).items():
            by_id[node].engine.fly_with(TrackPilot(track, speed_m_s))
    for node, mission in missions.items():
        engine = by_id[node].engine
        try:
            engine.fly_with(mission.pilot(engine.fence, places[node]))
        except GoalRefused as error:
            raise ConfigurationError(f"missions: drone {node}: {error}") from None


def area_around(places: Sequence[Sequence[float]], range_m: float) -> Area:
    """A square around the middle of these places, for a mean degree of MEAN_DEGREE at most."""
    xs, ys = [place[0] for place in places], [place[1] for place in places]
    fleet_m = max(max(xs) - min(xs), max(ys) - min(ys))
    side_m = max(fleet_m, math.sqrt(len(places) * math.pi * range_m**2 / (MEAN_DEGREE + 1.0)))
    x, y = (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2
    return Area(x - side_m / 2, y - side_m / 2, side_m, side_m)
