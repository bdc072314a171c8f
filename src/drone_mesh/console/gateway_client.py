"""GatewayClient: reaches a real gateway over HTTP; GatewayControls sends it the page's orders."""

from __future__ import annotations

import json
from types import MappingProxyType
from typing import Any

from drone_mesh.console.controls import MeshControls, OrderRefused
from drone_mesh.web.json_client import NoAnswer, ask_json

ANSWER_WITHIN_S = 5.0  # the gateway itself answers within two seconds


class GatewayClient:
    """One gateway. Any thread: each request has a connection of its own."""

    def __init__(self, url: str, token: str = "") -> None:
        """`url` as in http://pi:9080; `token`: the gateway's, if it has one."""
        self.url = url.rstrip("/")
        self._token = token

    def mesh(self, after: int) -> dict[str, Any]:
        """The mesh as the gateway reports it, with events after this number. Raises NoAnswer."""
        answer = self._ask("GET", f"/mesh?after={after}")
        if not isinstance(answer, dict) or "nodes" not in answer:
            raise NoAnswer(f"{self.url} is not a gateway of this version")
        return answer

    def order(
        self, drone: int, latitude: float, longitude: float, height: int, allow_shared_place: bool
    ) -> None:
        """Send a drone to a position in metres. Raises NoAnswer with the gateway's reason."""
        body = {"latitude": latitude, "longitude": longitude, "height": height}
        shared = "?allow_shared_place=true" if allow_shared_place else ""
        self._ask("POST", f"/drones/{drone}/goal{shared}", json.dumps(body).encode())

    def _ask(self, method: str, path: str, body: bytes | None = None) -> Any:
        return ask_json(f"{self.url}{path}", ANSWER_WITHIN_S, self._token, method, body)


ONLY_SIMULATED = "layouts and formations exist only in the simulation"
OWN_AUTOPILOT = "the missions of real drones belong to their autopilots"


class GatewayControls(MeshControls):
    """The MeshControls of a real mesh: it can fly drones and nothing else."""

    ACTIONS = ("fly",)
    WHY_NOT = MappingProxyType(
        {
            "power": "a real node can only be switched at its battery",
            "layout": ONLY_SIMULATED,
            "formation": ONLY_SIMULATED,  # the page orders each drone
            "preview": ONLY_SIMULATED,
            "speed": "the speed of a real mesh cannot be changed",
            "add": "a real drone joins when it is switched on",
            "remove": "a real drone leaves when it is switched off",
            "mission": OWN_AUTOPILOT,
            "pilots": OWN_AUTOPILOT,
        }
    )

    def __init__(self, client: GatewayClient) -> None:
        self._client = client

    def fly(self, node: int, x: float, y: float, z: float, allow_shared_place: bool = False) -> str:
        try:
            self._client.order(node, y, x, round(z), allow_shared_place)
        except NoAnswer as error:
            raise OrderRefused(str(error)) from error
        return f"ordered drone {node} to x {x:g}, y {y:g}, z {round(z)} m"
