"""The network of a scenario: its nodes, at their places, on its medium."""

from __future__ import annotations

from typing import Any

from drone_mesh.communication.repair.options import RepairOptions
from drone_mesh.communication.seals.keys import Keys, MeshKey
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.positions import PositionErrors
from drone_mesh.lab.impairments import OneWay
from drone_mesh.lab.places import StartPoint, draw_places
from drone_mesh.lab.propagation import obstacles_of
from drone_mesh.lab.scenario import Scenario
from drone_mesh.lab.streams import Streams
from drone_mesh.nrf24.emulator.links import IdealDisc, LinkModel, LogDistance, ScriptedLoss
from drone_mesh.nrf24.settings import DEFAULT_RATE, data_rate
from drone_mesh.settings import with_settings

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
    return network


def places_of(scenario: Scenario, streams: Streams) -> list[StartPoint]:
    obstacles = obstacles_of(scenario.obstacles) if scenario.obstacles.boxes else None
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
