"""Parts of a node declare, at the method, which packets and which timers they handle.

`@receives(MessageType.NODE_REPORT)` marks the method for packets of that type, `@due(Due.DATA)` the
method that is called when that work is due. A node asks its parts once, when it starts, so a search
for a type or a timer finds who handles it.
"""

from __future__ import annotations

from types import MethodType
from typing import Any, Callable, Sequence, TypeVar

from drone_mesh.communication.timing import Due

Receiver = Callable[[bytes, int, int], None]
"""Handles a packet, given with its creator and the sender of this hop."""

_Receives = TypeVar("_Receives", bound=Callable[[Any, bytes, int, int], None])
_Works = TypeVar("_Works", bound=Callable[[Any], None])

_received: dict[object, tuple[int, ...]] = {}  # by method: the types of packets
_due: dict[object, Due] = {}  # by method
_declared: dict[type, list[Callable[..., None]]] = {}  # by class of a part that was asked


def receives(*kinds: int) -> Callable[[_Receives], _Receives]:
    """The method handles packets of these types; it gets packet, creator and sender."""

    def declare(method: _Receives) -> _Receives:
        _received[method] = kinds
        return method

    return declare


def due(work: Due) -> Callable[[_Works], _Works]:
    """The method is called when this work is due; it schedules the next time itself."""

    def declare(method: _Works) -> _Works:
        _due[method] = work
        return method

    return declare


def receivers(parts: Sequence[object]) -> dict[int, Receiver]:
    """By type of packet: the method that handles it, of the first part that has one."""
    found: dict[int, Receiver] = {}
    for part in parts:
        for method in _methods(type(part)):
            handle = MethodType(method, part)
            for kind in _received.get(method, ()):
                found.setdefault(kind, handle)
    return found


def timers(parts: Sequence[object]) -> list[tuple[Due, Callable[[], None]]]:
    """What is called when which work is due, in the order of Due."""
    found: dict[Due, Callable[[], None]] = {}
    for part in parts:
        for method in _methods(type(part)):
            if method in _due:
                found.setdefault(_due[method], MethodType(method, part))
    return sorted(found.items())


def _methods(part: type) -> list[Callable[..., None]]:
    """What a class declares; that of a derived class before what it overrides."""
    if part not in _declared:  # a search through all its methods, and not for each node again
        methods = [method for owner in part.__mro__ for method in vars(owner).values()]
        _declared[part] = [m for m in methods if callable(m) and (m in _received or m in _due)]
    return _declared[part]
