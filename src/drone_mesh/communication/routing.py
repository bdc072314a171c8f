"""Routing techniques by name, so that a launch argument can choose one."""

from __future__ import annotations

import importlib
from typing import Callable

from drone_mesh.communication.child_table_tree import ChildTableTree
from drone_mesh.communication.routing_interfaces import IRoutingTechnique
from drone_mesh.communication.techniques.babel import Babel
from drone_mesh.communication.techniques.batman import Batman
from drone_mesh.communication.techniques.dsdv import Dsdv
from drone_mesh.communication.techniques.etx_tree import EtxTree
from drone_mesh.communication.techniques.flooding import Flooding
from drone_mesh.communication.techniques.steady_tree import SteadyTree
from drone_mesh.errors import ConfigurationError

DEFAULT_ROUTING = "child_table_tree"
ROUTING_TECHNIQUES: dict[str, Callable[[], IRoutingTechnique]] = {
    DEFAULT_ROUTING: ChildTableTree,
    "steady_tree": SteadyTree,
    "etx_tree": EtxTree,
    "babel": Babel,
    "batman": Batman,
    "dsdv": Dsdv,
    "flooding": Flooding,
}


def create_routing_technique(name: str) -> IRoutingTechnique:
    """A new technique: a name of ROUTING_TECHNIQUES, or "package.module:Class" for one of your own.

    Raises ConfigurationError, with the known names, for anything else.
    """
    module_name, colon, class_name = name.partition(":")
    make = _from_module(module_name, class_name) if colon else ROUTING_TECHNIQUES.get(name)
    if make is None:
        known = ", ".join(sorted(ROUTING_TECHNIQUES))
        raise ConfigurationError(
            f"unknown routing technique {name!r}: use one of {known}, or package.module:Class"
        )
    try:
        technique = make()
    except TypeError as error:  # not a class, or one that needs arguments or lacks functions
        raise ConfigurationError(
            f"routing technique {name!r} cannot be created without arguments: {error}"
        ) from error
    if not isinstance(technique, IRoutingTechnique):
        raise ConfigurationError(f"routing technique {name!r} is not an IRoutingTechnique")
    return technique


def _from_module(module_name: str, class_name: str) -> Callable[[], IRoutingTechnique]:
    try:
        made: Callable[[], IRoutingTechnique] = getattr(
            importlib.import_module(module_name), class_name
        )
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        raise ConfigurationError(
            f"routing technique {module_name}:{class_name} cannot be loaded: {error}"
        ) from error
    return made
