"""Builds a mesh component, in the same way for every host."""

from __future__ import annotations

import random

from drone_mesh.communication.component import MeshnetworkComponent
from drone_mesh.communication.gateway import MeshnetworkGateway
from drone_mesh.communication.interfaces import IInternetConnection, IWirelessCommunication
from drone_mesh.communication.named_techniques import (
    DEFAULT_ROUTING,
    create_routing_technique,
)
from drone_mesh.communication.observer import MeshObserver, ignore_events
from drone_mesh.communication.repair.interfaces import IRepairStrategy
from drone_mesh.communication.repair.named_strategies import create_repair_strategy
from drone_mesh.communication.repair.options import DEFAULT_REPAIR, RepairOptions
from drone_mesh.communication.router import MeshnetworkRouter
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.communication.ways import ITechnique
from drone_mesh.drone.interfaces import IDroneEngine


def assemble_component(
    node_id: int,
    antenna: IWirelessCommunication,
    engine: IDroneEngine,
    rng: random.Random,
    *,
    internet: IInternetConnection | None = None,
    routing: str | ITechnique = DEFAULT_ROUTING,
    timing: MeshTiming | None = None,
    observer: MeshObserver = ignore_events,
    debug: bool = True,
    repair: str | IRepairStrategy = DEFAULT_REPAIR,
    repair_options: RepairOptions | None = None,
) -> MeshnetworkComponent:
    """A gateway if `internet` is given, otherwise a router; not started yet.

    `routing` is a routing technique or its name, `repair` a repair strategy or its name. Raises
    ConfigurationError for an unknown name and ValueError for a node id outside 0..253.
    """
    technique = create_routing_technique(routing) if isinstance(routing, str) else routing
    if internet is None:
        strategy = create_repair_strategy(repair) if isinstance(repair, str) else repair
        return MeshnetworkRouter(
            node_id,
            antenna,
            engine,
            technique,
            rng,
            timing,
            observer,
            debug,
            strategy,
            repair_options,
        )
    return MeshnetworkGateway(
        node_id,
        antenna,
        engine,
        technique,
        internet,
        rng,
        timing,
        observer,
        debug,
        repair_options,
    )
