"""MeshControls: the interface that carries out the orders of a page."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Mapping, Sequence

from drone_mesh.drone.flight_path import Point
from drone_mesh.errors import MeshError
from drone_mesh.formations.layouts import Order
from drone_mesh.formations.missions import Mission

if TYPE_CHECKING:  # which needs numpy
    from drone_mesh.formations.preview import FormationPreview


class OrderRefused(MeshError):
    """An order was not carried out; the text is the reason, in words for the page."""


class MeshControls:
    """Executes orders. Each call may block for seconds and raises OrderRefused with a reason.

    What a subclass does not implement is refused.
    """

    WHY_NOT: ClassVar[Mapping[str, str]] = {}  # by order
    WHY_NOTHING: ClassVar[str] = "there is nothing to control"  # for the orders without a reason

    def power(self, node: int, on: bool) -> str:
        """Switch the antenna of a node."""
        raise self._refusal("power")

    def fly(self, node: int, x: float, y: float, z: float, allow_shared_place: bool = False) -> str:
        """Order a drone to a place, through the mesh."""
        raise self._refusal("fly")

    def layout(self, case: int) -> str:
        """Order all drones of a layout to their positions."""
        raise self._refusal("layout")

    def formation(self, name: str, orders: Sequence[Order], gateways: Sequence[int]) -> str:
        """Order drones, of gateways only `gateways`, to the places of a formation of this name."""
        raise self._refusal("formation")

    def preview(self, case: int) -> FormationPreview:
        """Describe what would happen if this layout were ordered now."""
        raise self._refusal("preview")

    def speed(self, paused: bool, factor: float) -> str:
        """Pause or resume simulated time, or change its speed."""
        raise self._refusal("speed")

    def add(self, node: int | None, gateway: bool, x: float, y: float) -> str:
        """Add a drone to the simulation; None: it gets the lowest free id."""
        raise self._refusal("add")

    def remove(self, node: int) -> str:
        """Remove a drone from the simulation."""
        raise self._refusal("remove")

    def mission(self, nodes: Sequence[int], mission: Mission) -> str:
        """Let the pilots of these drones fly this mission."""
        raise self._refusal("mission")

    def pilots(self, action: str) -> str:
        """Pause, resume or stop all missions."""
        raise self._refusal("pilots")

    def fence(
        self, name: str, corners: Sequence[Point], inside: bool, max_height: float | None
    ) -> str:
        """Add this area to the fence, or replace the one of this name; no corners: delete it."""
        raise self._refusal("fence")

    def _refusal(self, order: str) -> OrderRefused:
        return OrderRefused(self.WHY_NOT.get(order, self.WHY_NOTHING))


class RecordingControls(MeshControls):
    """The MeshControls of a recording: nothing can be ordered."""

    WHY_NOTHING = "this is a recording: it cannot be changed"
