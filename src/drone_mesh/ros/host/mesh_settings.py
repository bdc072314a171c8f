"""MeshSettings: what the mesh software of all nodes has in common."""

from __future__ import annotations

from dataclasses import dataclass

from drone_mesh.communication.observer import MeshObserver, ignore_events
from drone_mesh.communication.routing import create_routing_technique
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.configuration import FactoryConfiguration


@dataclass(frozen=True)
class MeshSettings:
    """Settings of every node of a simulation."""

    gateways: int  # ids below are gateways, the others routers
    routing: str  # name of the routing technique
    timing: MeshTiming
    seed: int
    debug: bool
    observer: MeshObserver
    internet: str  # "mock" or "http"

    @classmethod
    def of(cls, configuration: FactoryConfiguration) -> MeshSettings:
        """The part of the configuration that concerns the nodes. Raises ConfigurationError."""
        create_routing_technique(configuration.routing)  # one error now instead of one per node
        return cls(
            gateways=configuration.gateways,
            routing=configuration.routing,
            timing=MeshTiming(configuration.check_period, configuration.connection_lost_after),
            seed=configuration.seed,
            debug=configuration.debug,
            observer=ignore_events,
            internet=configuration.internet,
        )
