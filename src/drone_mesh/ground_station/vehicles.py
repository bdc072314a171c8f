"""Vehicle: what a gateway knows of a node, for ground stations; from a gateway, from a state."""

from __future__ import annotations

import contextlib
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
    me, flying, place = gateway.get_node_id(), bool(engine.is_flying()), None
    with contextlib.suppress(LocationUnknown):
        place = engine.get_location()
    battery, why_not = engine.battery_percent(), engine.why_not_fly()
    vehicles = {me: Vehicle(me, now_s, True, flying, place, now_s, battery, why_not)}
    for known in gateway.get_known_nodes():
        vehicles[known.node_id] = Vehicle(known.node_id, known.heard_s)
    for node, report, why_not, at_s in gateway.get_node_reports():
        if at_s > -math.inf:
            heard_s = max(at_s, vehicles[node].heard_s if node in vehicles else at_s)
            told = report.flying, report.place, at_s, report.battery_percent, why_not
            vehicles[node] = Vehicle(node, heard_s, False, *told)
    return [vehicle for _node, vehicle in sorted(vehicles.items())]


def vehicles_of_state(mesh: MeshStatus, before: Iterable[Vehicle]) -> list[Vehicle]:
    """The same from a simulation's state, which also has what no gateway knows.

    A node without a gateway stays as it was `before`, when it still had one.
    """
    vehicles = {vehicle.node: vehicle for vehicle in before}
    for node in mesh.nodes:
        if node.on and node.connected and node.report_age < OLD_REPORT_S:
            flying = len(node.path) > 0 or len(node.heading) > 0
            place = Location.from_vector(node.position) if position_is_known(node) else None
            battery = None if math.isnan(node.battery) else node.battery
            told = flying, place, mesh.stamp_s, battery, node.why_not_fly, node.crashed
            is_gateway = node.role == Role.GATEWAY
            vehicles[node.id] = Vehicle(node.id, mesh.stamp_s, is_gateway, *told)
    return [vehicles[node.id] for node in mesh.nodes if node.id in vehicles]
