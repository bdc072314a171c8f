"""What a user sets on the nodes of a mesh, for every host, and the techniques to choose from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Callable

from drone_mesh.by_name import create_by_name
from drone_mesh.communication.beacon.plane import BeaconTechnique
from drone_mesh.communication.control.control_plane import ITechnique
from drone_mesh.communication.repair.interfaces import IRepairStrategy
from drone_mesh.communication.repair.options import DEFAULT_REPAIR, RepairOptions
from drone_mesh.communication.repair.strategies import create_repair_strategy
from drone_mesh.communication.routing.child_table_tree import ChildTableTree, SteadyTree
from drone_mesh.communication.routing.techniques.babel import Babel
from drone_mesh.communication.routing.techniques.batman import Batman
from drone_mesh.communication.routing.techniques.dsdv import Dsdv
from drone_mesh.communication.routing.techniques.etx_tree import EtxTree
from drone_mesh.communication.routing.techniques.flooding import Flooding
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.settings import setting

DEFAULT_ROUTING = "child_table_tree"
ROUTING_TECHNIQUES: dict[str, Callable[[], ITechnique]] = {
    DEFAULT_ROUTING: ChildTableTree,
    "steady_tree": SteadyTree,
    "etx_tree": EtxTree,
    "babel": Babel,
    "batman": Batman,
    "dsdv": Dsdv,
    "flooding": Flooding,
    "beacon": BeaconTechnique,
}


def create_routing_technique(chosen: str | Callable[[], ITechnique]) -> ITechnique:
    """A new technique: a name in ROUTING_TECHNIQUES, "package.module:Class" or a class.

    Raises ConfigurationError, with the known names, for anything else.
    """
    return create_by_name("routing technique", chosen, ROUTING_TECHNIQUES, ITechnique)


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
