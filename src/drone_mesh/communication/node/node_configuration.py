"""NodeConfiguration: what a user sets on the nodes of a mesh, for every host."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Callable

from drone_mesh.communication.control.delivery import ITechnique
from drone_mesh.communication.node.named_techniques import (
    DEFAULT_ROUTING,
    create_routing_technique,
)
from drone_mesh.communication.repair.interfaces import IRepairStrategy
from drone_mesh.communication.repair.named_strategies import create_repair_strategy
from drone_mesh.communication.repair.options import DEFAULT_REPAIR, RepairOptions
from drone_mesh.communication.timing.mesh_timing import MeshTiming
from drone_mesh.settings import setting


@dataclass(frozen=True)
class NodeConfiguration:
    """The settings of one node. All nodes of a mesh need the same `routing`."""

    routing: str | Callable[[], ITechnique] = setting(
        DEFAULT_ROUTING,
        "routing technique: a built-in name, or package.module:Class for your own",
        "the name of a routing technique",
    )
    repair: str | Callable[[], IRepairStrategy] = setting(
        DEFAULT_REPAIR,
        "repair strategy: a built-in name (docs/strategies.md), or package.module:Class for "
        "your own",
        "the name of a repair strategy",
    )
    timing: MeshTiming = MeshTiming()
    repair_options: RepairOptions = RepairOptions()

    def __post_init__(self) -> None:
        """Raise ConfigurationError for a technique or a strategy that does not exist."""
        create_routing_technique(self.routing)
        create_repair_strategy(self.repair)
