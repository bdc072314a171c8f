"""Builds a node of the mesh, in the same way for every host."""

from __future__ import annotations

import random
from typing import Callable, NamedTuple

from drone_mesh.communication.events.observer import MeshObserver, ignore_events
from drone_mesh.communication.interfaces import (
    NO_SEALS,
    IInternetConnection,
    IMeshNetwork,
    IWirelessCommunication,
)
from drone_mesh.communication.node.component import MeshnetworkComponent, NodeSettings
from drone_mesh.communication.node.gateway import MeshnetworkGateway
from drone_mesh.communication.node.node_configuration import (
    NodeConfiguration,
    create_routing_technique,
)
from drone_mesh.communication.node.router import MeshnetworkRouter
from drone_mesh.communication.repair.strategies import create_repair_strategy
from drone_mesh.communication.seals.keys import Keys
from drone_mesh.communication.seals.sealed_antenna import SealedAntenna
from drone_mesh.drone.interfaces import IDroneEngine

AS_IN_THE_DOCUMENT = NodeConfiguration()


class Security(NamedTuple):
    """What the seals of a node need (docs/security.md)."""

    keys: Keys
    clock: Callable[[], float]  # seconds, of the thread that drives the component
    rng: random.Random = random.SystemRandom()  # draws epochs and nonces


class AssembledNode(NamedTuple):
    """A node that is not started yet."""

    component: MeshnetworkComponent
    receiver: IMeshNetwork  # takes what the antenna receives: the component, or its seals


def assemble_node(
    node_id: int,
    antenna: IWirelessCommunication,
    engine: IDroneEngine,
    rng: random.Random,
    configuration: NodeConfiguration = AS_IN_THE_DOCUMENT,
    *,
    internet: IInternetConnection | None = None,
    security: Security | None = None,
    observer: MeshObserver = ignore_events,
    debug: bool = True,
) -> AssembledNode:
    """A gateway if `internet` is given, otherwise a router; sealed if `security` is given.

    `rng`, `observer` and `debug` as for MeshnetworkComponent. Raises ValueError for a node id
    outside 0..253.
    """
    seals = None
    if security is not None:
        keys, clock, seal_rng = security
        antenna = seals = SealedAntenna(
            antenna, node_id, keys, seal_rng, clock, configuration.timing
        )
    settings = NodeSettings(
        NO_SEALS if seals is None else seals,
        configuration.timing,
        configuration.repair_options,
        observer,
        debug,
    )
    technique = create_routing_technique(configuration.routing)
    component: MeshnetworkComponent
    if internet is None:
        strategy = create_repair_strategy(configuration.repair)
        component = MeshnetworkRouter(node_id, antenna, engine, technique, rng, strategy, settings)
    else:
        component = MeshnetworkGateway(node_id, antenna, engine, technique, internet, rng, settings)
    return AssembledNode(component, seals or component)
