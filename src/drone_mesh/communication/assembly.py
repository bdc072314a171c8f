"""Builds a mesh component, in the same way for every host."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

from drone_mesh.communication.component import MeshnetworkComponent
from drone_mesh.communication.gateway import MeshnetworkGateway
from drone_mesh.communication.interfaces import IInternetConnection, IWirelessCommunication
from drone_mesh.communication.mesh_node import NodeSettings
from drone_mesh.communication.named_techniques import (
    DEFAULT_ROUTING,
    create_routing_technique,
)
from drone_mesh.communication.repair.interfaces import IRepairStrategy
from drone_mesh.communication.repair.named_strategies import create_repair_strategy
from drone_mesh.communication.repair.options import DEFAULT_REPAIR
from drone_mesh.communication.router import MeshnetworkRouter
from drone_mesh.communication.ways import ITechnique
from drone_mesh.drone.interfaces import IDroneEngine

if TYPE_CHECKING:
    from typing_extensions import Unpack


def assemble_component(
    node_id: int,
    antenna: IWirelessCommunication,
    engine: IDroneEngine,
    rng: random.Random,
    *,
    internet: IInternetConnection | None = None,
    routing: str | ITechnique = DEFAULT_ROUTING,
    repair: str | IRepairStrategy = DEFAULT_REPAIR,
    **settings: Unpack[NodeSettings],
) -> MeshnetworkComponent:
    """A gateway if `internet` is given, otherwise a router; not started yet.

    `routing` is a routing technique or its name, `repair` a repair strategy or its name. Raises
    ConfigurationError for an unknown name and ValueError for a node id outside 0..253.
    """
    technique = create_routing_technique(routing) if isinstance(routing, str) else routing
    if internet is None:
        strategy = create_repair_strategy(repair) if isinstance(repair, str) else repair
        return MeshnetworkRouter(node_id, antenna, engine, technique, rng, strategy, **settings)
    return MeshnetworkGateway(node_id, antenna, engine, technique, internet, rng, **settings)
