"""Creates parts that a launch argument selects: by a short name, or as package.module:Class."""

from __future__ import annotations

import importlib
from typing import Any, Callable, Mapping, TypeVar

from drone_mesh.errors import ConfigurationError

Part = TypeVar("Part")


def create_by_name(
    what: str, name: str, known: Mapping[str, Callable[[], Part]], interface: type[Any]
) -> Part:
    """Create a part: a name in `known`, or "package.module:Class" for your own.

    `what` names the part in messages. Raises ConfigurationError, with the known names, for anything
    that does not implement `interface`.
    """
    module_name, colon, class_name = name.partition(":")
    make = _from_module(what, module_name, class_name) if colon else known.get(name)
    if make is None:
        names = ", ".join(sorted(known))
        raise ConfigurationError(
            f"unknown {what} {name!r}: use one of {names}, or package.module:Class"
        )
    try:
        part = make()
    except TypeError as error:  # not a class, or one that needs arguments or lacks functions
        raise ConfigurationError(
            f"{what} {name!r} cannot be created without arguments: {error}"
        ) from error
    fits: bool = isinstance(part, interface)
    if not fits:
        raise ConfigurationError(f"{what} {name!r} is not an {interface.__name__}")
    return part


def _from_module(what: str, module_name: str, class_name: str) -> Callable[[], Any]:
    try:
        made: Callable[[], Any] = getattr(importlib.import_module(module_name), class_name)
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        raise ConfigurationError(
            f"{what} {module_name}:{class_name} cannot be loaded: {error}"
        ) from error
    return made
