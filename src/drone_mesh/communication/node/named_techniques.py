"""Creates routing techniques by name, for launch arguments."""

from __future__ import annotations

from typing import Callable

from drone_mesh.by_name import create_by_name
from drone_mesh.communication.beacon.plane import BeaconTechnique
from drone_mesh.communication.control.delivery import ITechnique
from drone_mesh.communication.routing.child_table_tree import ChildTableTree
from drone_mesh.communication.routing.techniques.babel import Babel
from drone_mesh.communication.routing.techniques.batman import Batman
from drone_mesh.communication.routing.techniques.dsdv import Dsdv
from drone_mesh.communication.routing.techniques.etx_tree import EtxTree
from drone_mesh.communication.routing.techniques.flooding import Flooding
from drone_mesh.communication.routing.techniques.steady_tree import SteadyTree

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
