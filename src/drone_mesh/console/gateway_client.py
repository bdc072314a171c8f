"""A real mesh over the HTTP of its gateway: its state for the page, and the orders of the page."""

from __future__ import annotations

import json
import math
from types import MappingProxyType
from typing import Any, Dict, Mapping

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.console.controls import MeshControls, OrderRefused
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.state.links import route_to_gateway
from drone_mesh.state.model import UNKNOWN_POSITION, AreaStatus, EventRecord, MeshStatus, NodeStatus
from drone_mesh.web.json_client import NoAnswer, ask_json

ANSWER_WITHIN_S = 5.0  # the gateway itself answers within two seconds
REPORTS_MISSING_S = 75.0  # two reports of the default period, and a half
_ONLY_SIMULATED = "layouts and formations exist only in the simulation"
_OWN_AUTOPILOT = "the missions of real drones belong to their autopilots"
_NO_ENDS = {"lowest": -math.inf, "highest": math.inf}  # of an area that has none in height

More = Dict[int, Dict[str, Any]]
"""By node, the fields for the page that only real nodes have."""


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


class GatewayControls(MeshControls):
    """The MeshControls of a real mesh: it can fly drones and nothing else."""

    ACTIONS = ("fly",)
    WHY_NOT = MappingProxyType(
        {
            "power": "a real node can only be switched at its battery",
            "layout": _ONLY_SIMULATED,
            "formation": _ONLY_SIMULATED,  # the page orders each drone
            "preview": _ONLY_SIMULATED,
            "speed": "the speed of a real mesh cannot be changed",
            "add": "a real drone joins when it is switched on",
            "remove": "a real drone leaves when it is switched off",
            "mission": _OWN_AUTOPILOT,
            "pilots": _OWN_AUTOPILOT,
            "fence": "each node of a real mesh has its own fence: --fence",
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


def real_mesh(answer: Mapping[str, Any]) -> tuple[MeshStatus, More]:
    """The mesh, and the fields for which MeshStatus has no place.

    Raises KeyError, TypeError or ValueError if the answer is invalid.
    """
    gateway = int(answer["gateway"])
    nodes = [_node(entry, gateway) for entry in answer["nodes"]]
    by_id = {node.id: node for node in nodes}
    for node in nodes:
        node.route = route_to_gateway(node.id, by_id)
    uptime_s = float(answer["uptime_s"])
    fence = [AreaStatus(**{**_NO_ENDS, **area}) for area in answer.get("fence", ())]  # or older
    mesh = MeshStatus(uptime_s, nodes, max_distance=0.0, achieved_real_time_factor=1.0, fence=fence)
    return mesh, {int(entry["id"]): _more(entry) for entry in answer["nodes"]}


def origin_of(answer: Mapping[str, Any]) -> Origin | None:
    """Where the mesh is on the earth; None: its gateway does not know, or is older.

    Raises TypeError or ConfigurationError if the answer is invalid.
    """
    place = answer.get("origin")
    return None if place is None else Origin(*place)


def events_of(answer: Mapping[str, Any]) -> list[EventRecord]:
    """The events in the answer, oldest first."""
    return [_event(entry) for entry in answer["events"]]


def _event(entry: Mapping[str, Any]) -> EventRecord:
    place = entry.get("place")  # an older gateway tells neither place nor order
    return EventRecord(
        float(entry["t"]),
        int(entry["node"]),
        entry["kind"],
        tuple(entry["peers"]),
        entry["detail"],
        int(entry.get("order") or 0),
        None if place is None else Location(*place),
    )


def _node(entry: Mapping[str, Any], gateway: int) -> NodeStatus:
    place, age_s, battery = entry["place"], entry["heard_s_ago"], entry.get("battery_percent")
    position = UNKNOWN_POSITION if place is None else (place[1], place[0], place[2])
    is_silent = age_s is None or age_s > REPORTS_MISSING_S
    return NodeStatus(
        int(entry["id"]),
        role=Role.GATEWAY if entry["role"] == "gateway" else Role.ROUTER,
        on=bool(entry["on"]),
        connected=bool(entry["connected"]),
        gateway=gateway if entry["connected"] else NO_ROUTE,
        hops=_or_none(entry["hops"]),
        next_hop=_or_none(entry["next_hop"]),
        neighbours=bytes(entry.get("neighbours", ())),
        neighbour_ages=bytes(len(entry.get("neighbours", ()))),
        position=position,
        path=position if entry.get("flying") and place is not None else (),  # no goal is reported
        battery=math.nan if battery is None else float(battery),
        report_age=(age_s or REPORTS_MISSING_S) if is_silent else 0.0,
        total_messages=int(entry.get("messages_sent", 0)),
        tries=float(entry.get("tries", 0.0)),
        why_not_fly=str(entry.get("why_not_fly", "")),
        shares_id=bool(entry.get("shares_id", False)),
    )


def _more(entry: Mapping[str, Any]) -> dict[str, Any]:
    tries = float(entry.get("tries", 0.0))
    more: dict[str, Any] = {
        "earth": entry["earth"],
        "drone": _drone_in_words(entry),
        "channel": f"{tries:.1f} tries per packet" if tries else "",  # the only figure reported
        "known_nodes": None,  # not reported; nor is the next one
        "total_messages": entry.get("messages_sent"),
    }
    if "neighbour_count" in entry:
        more["neighbours"] = int(entry["neighbour_count"])
    return more


def _drone_in_words(entry: Mapping[str, Any]) -> str:
    if not entry["reported"]:
        return "has not reported yet"
    if entry["flying"]:
        return "in flight"
    return "" if entry["why_not_fly"] else "can fly"  # the reason is a field of its own


def _or_none(value: int | None) -> int:
    return NO_ROUTE if value is None else int(value)
