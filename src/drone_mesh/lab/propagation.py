"""The effect of obstacles and fading on the links and flights of one run."""

from __future__ import annotations

import functools
import math
import random
from typing import Callable, Protocol, cast

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.drone.flight_path import FlightPath, Vector
from drone_mesh.drone.location import Location
from drone_mesh.inprocess import Network
from drone_mesh.lab import scenario as given
from drone_mesh.lab.faults import Jam
from drone_mesh.lab.impairments import Impairments
from drone_mesh.nrf24.emulator.space import Noise, Space
from drone_mesh.nrf24.registers import NS_PER_S
from drone_mesh.nrf24.settings import RadioSettings

MARGIN_STEP_DB = 0.1  # of the fading table


def obstacles_of(part: given.ObstacleSettings) -> Obstacles:
    """The boxes of a scenario. A material is one of CUT_DB; `cut_db` is the loss of brick."""
    boxes = [box.to_box(part.cut_db) for box in part.boxes]
    return Obstacles(boxes, part.radio == "block", part.metre_db, part.exponent, part.ceiling_m)


def success(margin_db: float, fading: str, k_db: float) -> float:
    """Probability that one packet arrives over a link with this margin.

    Rayleigh: the power is exponentially distributed about its mean. Rician: its line-of-sight part
    is K times the rest; the power is then a scaled noncentral chi-squared variable.
    """
    if fading == "none":
        return 1.0
    if math.isinf(margin_db):
        return 0.0 if margin_db < 0 else 1.0
    return _faded(round(margin_db / MARGIN_STEP_DB), fading, k_db)


@functools.lru_cache(maxsize=4096)
def _faded(steps: int, fading: str, k_db: float) -> float:
    below = 10 ** (-steps * MARGIN_STEP_DB / 10)
    if fading == "rayleigh":
        return math.exp(-below)
    from scipy.stats import ncx2  # the only part of a run that needs scipy

    k = 10 ** (k_db / 10)
    return float(ncx2.sf(2 * (k + 1) * below, 2, 2 * k))


def put_obstacles(
    network: Network, impairments: Impairments, scenario: given.Scenario
) -> Planner | None:
    """Apply the boxes to links and flights; None if the scenario has neither boxes nor fading.

    Call this before the nodes start.
    """
    part = scenario.obstacles
    if not part.boxes and part.fading == "none":
        return None
    obstacles = obstacles_of(part)
    range_m = scenario.range_m
    if scenario.radio.kind != "disc":
        if part.boxes:  # its fading is the network's
            cast(ChannelAir, network.air).space.obstacles = obstacles.loss_db
    elif part.boxes:
        impairments.disc.sees = lambda a, b: (
            obstacles.margin_db(a.to_vector(), b.to_vector(), range_m) > 0
        )
    if part.fading != "none" and scenario.radio.kind == "disc":

        def arrives(a: Location, b: Location) -> float:
            margin_db = obstacles.margin_db(a.to_vector(), b.to_vector(), range_m)
            return success(margin_db, part.fading, part.rician_k_db)

        impairments.arrives = arrives
    planner = Planner(obstacles)
    for node_id, node in network.nodes.items():
        node.drone.plan_flight = functools.partial(planner.plan, node_id)
    return planner


def put_noise(network: Network, jam: Jam, range_m: float, rng: random.Random) -> Callable[[], None]:
    """Start a transmitter of noise on a shared channel; returns what stops it."""
    air = cast(ChannelAir, network.air)
    mhz = 2400 + air.settings.channel
    links, (x, y) = air.space.links, jam.center
    at_edge_dbm = links.received_dbm(range_m, float(air.settings.power.value), mhz)
    power_dbm = at_edge_dbm - links.received_dbm(jam.radius_m, 0.0, mhz)
    noise = Noise((x, y, 0.0), power_dbm, rng, centre_mhz=mhz, duty=jam.loss)
    air.space.noises.append(noise)
    return lambda: noise.stop(round(network.now_s() * NS_PER_S))


class ChannelAir(Protocol):
    """The air of radios that share a channel."""

    space: Space
    settings: RadioSettings
    airtime_s: float  # of all frames
    collisions: int  # receptions that another frame destroyed


class Planner:
    """Plans flights past the boxes, and records those without a path."""

    def __init__(self, obstacles: Obstacles) -> None:
        self.obstacles = obstacles
        self.refused: list[int] = []  # node ids

    def plan(
        self, node: int, start: Vector, goal: Vector, start_s: float, speed_m_s: float
    ) -> FlightPath | None:
        """Like Obstacles.plan_flight."""
        path = self.obstacles.plan_flight(start, goal, start_s, speed_m_s)
        if path is None:
            self.refused.append(node)
        return path
