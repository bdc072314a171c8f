"""MeshControls: the interface that carries out the orders of a page."""

from __future__ import annotations

from typing import Protocol, Sequence

from drone_mesh.errors import MeshError
from drone_mesh.layouts import Order
from drone_mesh.missions import Mission
from drone_mesh.state.formation_preview import FormationPreview

RECORDED = "this is a recording: it cannot be changed"


class OrderRefused(MeshError):
    """An order was not carried out; the text is the reason, in words for the page."""


class MeshControls(Protocol):
    """Executes orders. Each call may block for seconds and raises OrderRefused with a reason."""

    def power(self, node: int, on: bool) -> str: ...

    def fly(
        self, node: int, x: float, y: float, z: float, allow_shared_place: bool = False
    ) -> str: ...

    def layout(self, case: int) -> str: ...

    def formation(self, name: str, orders: Sequence[Order]) -> str: ...

    def preview(self, case: int) -> FormationPreview: ...

    def speed(self, paused: bool, factor: float) -> str: ...

    def add(self, node: int | None, gateway: bool, x: float, y: float) -> str: ...

    def remove(self, node: int) -> str: ...

    def mission(self, nodes: Sequence[int], mission: Mission) -> str: ...

    def pilots(self, action: str) -> str: ...


class RecordingControls:
    """The MeshControls of a recording: nothing can be ordered."""

    def power(self, node: int, on: bool) -> str:
        """Refused, like everything below."""
        raise OrderRefused(RECORDED)

    def fly(  # noqa: D102
        self, node: int, x: float, y: float, z: float, allow_shared_place: bool = False
    ) -> str:
        raise OrderRefused(RECORDED)

    def layout(self, case: int) -> str:  # noqa: D102
        raise OrderRefused(RECORDED)

    def formation(self, name: str, orders: Sequence[Order]) -> str:  # noqa: D102
        raise OrderRefused(RECORDED)

    def preview(self, case: int) -> FormationPreview:  # noqa: D102
        raise OrderRefused(RECORDED)

    def speed(self, paused: bool, factor: float) -> str:  # noqa: D102
        raise OrderRefused(RECORDED)

    def add(self, node: int | None, gateway: bool, x: float, y: float) -> str:  # noqa: D102
        raise OrderRefused(RECORDED)

    def remove(self, node: int) -> str:  # noqa: D102
        raise OrderRefused(RECORDED)

    def mission(self, nodes: Sequence[int], mission: Mission) -> str:  # noqa: D102
        raise OrderRefused(RECORDED)

    def pilots(self, action: str) -> str:  # noqa: D102
        raise OrderRefused(RECORDED)
