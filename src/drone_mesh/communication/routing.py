"""Routing techniques by name, so that a launch argument can choose one."""

from __future__ import annotations

import importlib
from typing import Callable

from drone_mesh.communication.child_table_tree import ChildTableTree
from drone_mesh.communication.interfaces import IRoutingTechnique
from drone_mesh.errors import ConfigurationError

ROUTING_TECHNIQUES: dict[str, Callable[[], IRoutingTechnique]] = {
    "child_table_tree": ChildTableTree,
}


def create_routing_technique(name: str) -> IRoutingTechnique:
    """A new technique: a name of ROUTING_TECHNIQUES, or "package.module:Class" for one of your own.

    Raises ConfigurationError, naming what there is, for anything else.
    """
    module_name, colon, class_name = name.partition(":")
    make = _from_module(module_name, class_name) if colon else ROUTING_TECHNIQUES.get(name)
    if make is None:
        known = ", ".join(sorted(ROUTING_TECHNIQUES))
        raise ConfigurationError(
            f"routing technique {name!r} is not known: use one of {known}, or package.module:Class"
        )
    try:
        technique = make()
    except TypeError as error:  # no class, or one that wants arguments or lacks functions
        raise ConfigurationError(
            f"routing technique {name!r} cannot be made by its name alone: {error}"
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
