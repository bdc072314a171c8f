"""The network of a scenario: its nodes at their places, on their medium, among its obstacles."""

from __future__ import annotations

import functools
import math
import random
from typing import Any, Callable, Protocol, cast

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.communication.repair.options import RepairOptions
from drone_mesh.communication.seals.keys import Keys, MeshKey
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.drone.location import Location
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.drone import PositionErrors
from drone_mesh.lab.impairments import Impairments, OneWay
from drone_mesh.lab.places import StartPoint, draw_places
from drone_mesh.lab.scenario import Scenario, Streams
from drone_mesh.lab.scenario_parts import Jam
from drone_mesh.nrf24.emulator.links import IdealDisc, LinkModel, LogDistance, ScriptedLoss
from drone_mesh.nrf24.emulator.space import Noise, Space
from drone_mesh.nrf24.registers import NS_PER_S
from drone_mesh.nrf24.settings import DEFAULT_RATE, RadioSettings, data_rate
from drone_mesh.settings import with_settings

MARGIN_STEP_DB = 0.1  # of the fading table


def obstacles_of(scenario: Scenario) -> Obstacles:
    """Its boxes and its fence. A material is one of CUT_DB; `cut_db` is the loss of brick."""
    part = scenario.obstacles
    boxes = [box.to_box(part.cut_db) for box in part.boxes]
    return Obstacles(
        boxes,
        part.radio == "block",
        part.metre_db,
        part.exponent,
        part.ceiling_m,
        fence=scenario.fence.fence(),
    )


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


def put_obstacles(network: Network, impairments: Impairments, scenario: Scenario) -> None:
    """Apply boxes and fence to links and flights. Call this before the nodes start."""
    part = scenario.obstacles
    if not (part.boxes or scenario.fence.areas) and part.fading == "none":
        return
    obstacles = obstacles_of(scenario)
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
    for node in network.nodes.values():
        node.drone.plan_flight = obstacles.plan_flight


def put_noise(network: Network, jam: Jam, range_m: float, rng: random.Random) -> Callable[[], None]:
    """Start a transmitter of noise on a shared channel; returns what stops it."""
    if not jam.loss:
        return lambda: None
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


_KEY = MeshKey(b"the key of a lab")


def network_of(
    scenario: Scenario, streams: Streams, places: list[StartPoint], one_way: OneWay
) -> Network:
    gateways = {place.node_id for place in places if place.gateway}

    def key_of(node: int) -> Keys:
        return _KEY if node in gateways else _KEY.for_node(node)

    network = Network(
        seed=streams.number("mesh"),
        timing=MeshTiming(**scenario.timing.model_dump()),
        routing=scenario.routing,
        max_distance_m=scenario.range_m,
        repair=scenario.repair,
        repair_options=with_settings(
            RepairOptions, {**scenario.repair_options.model_dump(), "range_m": scenario.range_m}
        ),
        key=key_of if scenario.key else None,
        positions=PositionErrors(**scenario.positions.model_dump()),
        fence=scenario.fence.fence(),
        **_radio(scenario, streams, one_way),
    )
    grounded = streams.generator("grounded")
    for place in places:
        if place.gateway:
            network.add_gateway(place.node_id, place.x, place.y)
        else:
            is_grounded = grounded.random() < scenario.grounded_share
            why = "on the ground" if is_grounded else ""
            network.add_router(place.node_id, place.x, place.y, why_not_fly=why)
    for node in network.nodes.values():
        node.drone.speed_m_s = scenario.speed_m_s
    return network


def places_of(scenario: Scenario, streams: Streams) -> list[StartPoint]:
    has_any = scenario.obstacles.boxes or scenario.fence.areas
    obstacles = obstacles_of(scenario) if has_any else None
    return draw_places(scenario.layout, scenario.range_m, streams.generator("layout"), obstacles)


def _radio(scenario: Scenario, streams: Streams, one_way: OneWay) -> dict[str, Any]:
    """The arguments of the network about its medium."""
    radio, part = scenario.radio, scenario.obstacles
    if radio.kind == "disc":
        return {"delay_s": radio.delay_s, "jitter_s": radio.jitter_s}
    rate = radio.rate or DEFAULT_RATE
    return {
        "radio": radio.kind,
        "rate": rate,
        "links": _links(scenario, rate, streams, one_way),
        "fading": part.fading,
        "rician_k_db": part.rician_k_db,
    }


def _links(scenario: Scenario, rate: str, streams: Streams, one_way: OneWay) -> LinkModel:
    """Which frames arrive undamaged if no other frame is on the air."""
    links: LinkModel = IdealDisc(scenario.range_m)
    if scenario.radio.links == "distance" or scenario.obstacles.fading != "none":
        links = LogDistance.with_edge_at(
            scenario.range_m, streams.generator("links"), bits_per_s=data_rate(rate).value
        )
    if one_way.occurs:
        links = ScriptedLoss(links, one_way.loses)
    if scenario.radio.loss:
        rng = streams.generator("frames")
        return ScriptedLoss(links, lambda _hop: rng.random() < scenario.radio.loss)
    return links
