"""Loads by name: what a user names, as package.module:Name too, and the names of a package."""

from __future__ import annotations

import contextlib
import importlib
from typing import Any, Callable, Iterator, Mapping, TypeVar

from drone_mesh.errors import ConfigurationError

Part = TypeVar("Part")


def on_demand(package: str, modules: Mapping[str, str]) -> Callable[[str], object]:
    """The `__getattr__` of a package (PEP 562): the use of a name loads the module that has it."""

    def load(name: str) -> object:
        if name not in modules:
            raise AttributeError(f"module {package} has no attribute {name}")
        return getattr(importlib.import_module(modules[name]), name)

    return load


def load_by_name(what: str, name: str) -> Any:
    """The object with this name; `what` is for messages. Raises ConfigurationError."""
    module_name, _, attribute = name.partition(":")
    with in_one_line(f"{what} {name!r} cannot be loaded"):
        return getattr(importlib.import_module(module_name), attribute)


def create_by_name(
    what: str,
    chosen: str | Callable[[], Part],
    known: Mapping[str, Callable[[], Part]],
    interface: type[Any],
) -> Part:
    """Create a part: a name in `known`, "package.module:Class", or a class of your own.

    `what` names the part in messages. Raises ConfigurationError, with the known names, for anything
    that does not implement `interface`.
    """
    name = chosen if isinstance(chosen, str) else getattr(chosen, "__qualname__", repr(chosen))
    make: Callable[[], Part] | None
    if not isinstance(chosen, str):
        make = chosen
    else:
        make = load_by_name(what, chosen) if ":" in chosen else known.get(chosen)
    if make is None:
        names = ", ".join(sorted(known))
        raise ConfigurationError(
            f"unknown {what} {name!r}: use one of {names}, or package.module:Class"
        )
    with in_one_line(f"{what} {name!r} cannot be created without arguments"):
        part = make()
    fits: bool = isinstance(part, interface)
    if not fits:
        raise ConfigurationError(f"{what} {name!r} is not an {interface.__name__}")
    return part


@contextlib.contextmanager
def in_one_line(what: str) -> Iterator[None]:
    """A user's module may raise anything, even SyntaxError and SystemExit: report it as its error.

    Raises ConfigurationError, in one line.
    """
    try:
        yield
    except (ConfigurationError, KeyboardInterrupt):
        raise
    except BaseException as error:
        words = " ".join(str(error).split())
        if not isinstance(error, (ImportError, AttributeError)):
            words = f"{type(error).__name__}: {words}"
        raise ConfigurationError(f"{what}: {words}") from error
