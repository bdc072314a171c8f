"""Vehicle: what a gateway knows of a node, for ground stations; from a gateway, from a state."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Iterable

from drone_mesh.communication.node.gateway import MeshnetworkGateway
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.errors import LocationUnknown
from drone_mesh.state.model import MeshStatus, position_is_known

PROOF_PERIODS = 2.5  # two of a node's packets may be lost before it counts as silent
OLD_REPORT_S = 3.0  # wall: a host of the simulation that is silent for so long has ended


@dataclass(frozen=True)
class Vehicle:
    """One node. Times are those of the mesh's clock."""

    node: int
    heard_s: float  # when something last proved that it is there; -inf: nothing did
    is_gateway: bool = False
    flying: bool | None = None  # None: it has not reported yet
    place: Location | None = None
    place_s: float = -math.inf  # when it was there
    battery_percent: float | None = None
    why_not_fly: str = ""
    crashed: bool = False


def vehicles_of_gateway(
    gateway: MeshnetworkGateway, engine: IDroneEngine, now_s: float
) -> list[Vehicle]:
    """What a gateway with this drone knows from packets alone. Only on its thread."""
    try:
        place: Location | None = engine.get_location()
    except LocationUnknown:
        place = None
    vehicles = [
        Vehicle(
            gateway.get_node_id(),
            now_s,
            True,
            bool(engine.is_flying()),
            place,
            now_s,
            engine.battery_percent(),
            engine.why_not_fly(),
        )
    ]
    heard_s = {node.node_id: node.heard_s for node in gateway.get_known_nodes()}
    reported = {node.node_id: node for node in gateway.get_node_reports()}
    for node in sorted(heard_s.keys() | reported.keys()):
        told = reported.get(node)
        if told is None or told.heard_s == -math.inf:
            vehicles.append(Vehicle(node, heard_s.get(node, -math.inf)))
            continue
        report = told.report
        vehicles.append(
            Vehicle(
                node,
                max(told.heard_s, heard_s.get(node, -math.inf)),
                False,
                report.flying,
                report.place,
                told.heard_s,
                report.battery_percent,
                told.why_not_fly,
            )
        )
    return vehicles


def vehicles_of_state(mesh: MeshStatus, before: Iterable[Vehicle]) -> list[Vehicle]:
    """The same from a simulation's state, which also has what no gateway knows.

    A node without a gateway stays as it was `before`, when it still had one.
    """
    vehicles = {vehicle.node: vehicle for vehicle in before}
    present = {node.id for node in mesh.nodes}
    for node in mesh.nodes:
        if node.on and node.connected and node.report_age < OLD_REPORT_S:
            vehicles[node.id] = Vehicle(
                node.id,
                mesh.stamp_s,
                node.role == Role.GATEWAY,
                len(node.path) > 0 or len(node.heading) > 0,
                Location.from_vector(node.position) if position_is_known(node) else None,
                mesh.stamp_s,
                None if math.isnan(node.battery) else node.battery,
                node.why_not_fly,
                node.crashed,
            )
    return [vehicle for node, vehicle in sorted(vehicles.items()) if node in present]
