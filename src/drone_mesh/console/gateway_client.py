"""GatewayClient: reaches a real gateway over HTTP; GatewayControls sends it the page's orders."""

from __future__ import annotations

import json
from typing import Any, Sequence

from drone_mesh.console.controls import OrderRefused
from drone_mesh.errors import MeshError
from drone_mesh.layouts import Order
from drone_mesh.missions import Mission
from drone_mesh.state.formation_preview import FormationPreview
from drone_mesh.web.json_client import NoAnswer, ask_json

ANSWER_WITHIN_S = 5.0  # our choice: the gateway itself answers within two seconds


class GatewayGone(MeshError):
    """The gateway does not answer, or its answer is invalid; the text gives details."""


class GatewayClient:
    """One gateway. Any thread: each request has a connection of its own."""

    def __init__(self, url: str, token: str = "") -> None:
        """`url` as in http://pi:9080; `token`: the gateway's, if it has one."""
        self.url = url.rstrip("/")
        self._token = token

    def mesh(self, after: int) -> dict[str, Any]:
        """The mesh as the gateway reports it, with events after this number. Raises GatewayGone."""
        answer = self._ask("GET", f"/mesh?after={after}")
        if not isinstance(answer, dict) or "nodes" not in answer:
            raise GatewayGone(f"{self.url} is not a gateway of this version")
        return answer

    def order(
        self, drone: int, latitude: float, longitude: float, height: int, allow_shared_place: bool
    ) -> None:
        """Send a drone to a position in metres. Raises GatewayGone with the gateway's reason."""
        body = {"latitude": latitude, "longitude": longitude, "height": height}
        shared = "?allow_shared_place=true" if allow_shared_place else ""
        self._ask("POST", f"/drones/{drone}/goal{shared}", json.dumps(body).encode())

    def _ask(self, method: str, path: str, body: bytes | None = None) -> Any:
        try:
            return ask_json(f"{self.url}{path}", ANSWER_WITHIN_S, self._token, method, body)
        except NoAnswer as error:
            raise GatewayGone(str(error)) from error


ONLY_SIMULATED = "layouts and formations exist only in the simulation"
OWN_AUTOPILOT = "the missions of real drones belong to their autopilots"


class GatewayControls:
    """The MeshControls of a real mesh: it can fly drones and nothing else."""

    ACTIONS = ("fly",)

    def __init__(self, client: GatewayClient) -> None:
        self._client = client

    def fly(self, node: int, x: float, y: float, z: float, allow_shared_place: bool = False) -> str:
        """Order a drone to a place, through the mesh."""
        try:
            self._client.order(node, y, x, round(z), allow_shared_place)
        except GatewayGone as error:
            raise OrderRefused(str(error)) from error
        return f"ordered drone {node} to x {x:g}, y {y:g}, z {round(z)} m"

    def power(self, node: int, on: bool) -> str:
        """Refused."""
        raise OrderRefused("a real node can only be switched at its battery")

    def layout(self, case: int) -> str:
        """Refused."""
        raise OrderRefused(ONLY_SIMULATED)

    def formation(self, name: str, orders: Sequence[Order]) -> str:
        """Refused: the page orders each drone."""
        raise OrderRefused(ONLY_SIMULATED)

    def preview(self, case: int) -> FormationPreview:
        """Refused."""
        raise OrderRefused(ONLY_SIMULATED)

    def speed(self, paused: bool, factor: float) -> str:
        """Refused."""
        raise OrderRefused("the speed of a real mesh cannot be changed")

    def add(self, node: int | None, gateway: bool, x: float, y: float) -> str:
        """Refused."""
        raise OrderRefused("a real drone joins when it is switched on")

    def remove(self, node: int) -> str:
        """Refused."""
        raise OrderRefused("a real drone leaves when it is switched off")

    def mission(self, nodes: Sequence[int], mission: Mission) -> str:
        """Refused."""
        raise OrderRefused(OWN_AUTOPILOT)

    def pilots(self, action: str) -> str:
        """Refused."""
        raise OrderRefused(OWN_AUTOPILOT)
