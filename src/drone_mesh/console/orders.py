"""What a page may ask for, and who carries it out."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any, Callable, Mapping, Protocol

from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.errors import MeshError

FURTHEST_M = 5000.0  # docs/protocol.md, "Goals"
HIGHEST_M = 500.0
FASTEST = 100.0  # simulated seconds per wall second; our choice


class OrderRefused(MeshError):
    """An order was not carried out; the text says why, in words for the page."""


class MeshControls(Protocol):
    """Carries out orders. Each call may block for seconds and raises OrderRefused with a reason."""

    def power(self, node: int, on: bool) -> str: ...

    def fly(self, node: int, x: float, y: float, z: float) -> str: ...

    def layout(self, case: int) -> str: ...

    def speed(self, paused: bool, factor: float) -> str: ...


@dataclass(frozen=True)
class Order:
    """One order of one page; `number` comes back with the answer."""

    number: int
    carry_out: Callable[[MeshControls], str]  # returns a few words for the page


@dataclass(frozen=True)
class Watch:
    """The page wants to see one node's neighbours in detail; None: no longer."""

    node: int | None


def parse_request(text: str) -> Order | Watch:
    """A page's message. Raises OrderRefused for anything that is not exactly a known request."""
    try:
        request = json.loads(text)
    except ValueError:
        raise OrderRefused("this is not JSON") from None
    if not isinstance(request, dict):
        raise OrderRefused("a request is an object")
    if request.get("do") == "watch":
        return Watch(None if request.get("node") is None else _node(request))
    number = _whole(request, "number", 0, 2**53)
    action = request.get("do")
    if action == "power":
        node, on = _node(request), _truth(request, "on")
        return Order(number, lambda controls: controls.power(node, on))
    if action == "fly":
        node = _node(request)
        x = _real(request, "x", -FURTHEST_M, FURTHEST_M)
        y = _real(request, "y", -FURTHEST_M, FURTHEST_M)
        z = _real(request, "z", 0, HIGHEST_M)
        return Order(number, lambda controls: controls.fly(node, x, y, z))
    if action == "layout":
        case = _whole(request, "case", 0, 2**32 - 1)
        return Order(number, lambda controls: controls.layout(case))
    if action == "speed":
        paused, factor = _truth(request, "paused"), _real(request, "factor", 0, FASTEST)
        return Order(number, lambda controls: controls.speed(paused, factor))
    raise OrderRefused(f"{action!r} is not something this console does")


def _node(request: Mapping[str, Any]) -> int:
    return _whole(request, "node", 0, MAX_NODE_ID)


def _whole(request: Mapping[str, Any], key: str, low: int, high: int) -> int:
    value = request.get(key)
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise OrderRefused(f"{key}: a whole number from {low} to {high} is wanted, not {value!r}")
    return value


def _real(request: Mapping[str, Any], key: str, low: float, high: float) -> float:
    value = request.get(key)
    if (
        not isinstance(value, (int, float))
        or isinstance(value, bool)
        or not math.isfinite(value)
        or not low <= value <= high
    ):
        raise OrderRefused(f"{key}: a number from {low:g} to {high:g} is wanted, not {value!r}")
    return float(value)


def _truth(request: Mapping[str, Any], key: str) -> bool:
    value = request.get(key)
    if not isinstance(value, bool):
        raise OrderRefused(f"{key}: true or false is wanted, not {value!r}")
    return value
