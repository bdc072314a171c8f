"""Converts a gateway's answer to GET /mesh into the state that the page shows."""

from __future__ import annotations

from typing import Any, Dict, Mapping

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.state.model import UNKNOWN_POSITION, EventRecord, MeshStatus, NodeStatus
from drone_mesh.state.routes import route_to_gateway

REPORTS_MISSING_S = 75.0  # two reports of the default period, and a half

More = Dict[int, Dict[str, Any]]
"""By node, the fields for the page that only real nodes have."""


def real_mesh(answer: Mapping[str, Any]) -> tuple[MeshStatus, More]:
    """The mesh, and the fields for which MeshStatus has no place.

    Raises KeyError, TypeError or ValueError if the answer is invalid.
    """
    gateway = int(answer["gateway"])
    nodes = [_node(entry, gateway) for entry in answer["nodes"]]
    by_id = {node.id: node for node in nodes}
    for node in nodes:
        node.route = route_to_gateway(node.id, by_id)
    mesh = MeshStatus(
        float(answer["uptime_s"]), nodes, max_distance=0.0, achieved_real_time_factor=1.0
    )
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
    place, age_s = entry["place"], entry["heard_s_ago"]
    is_silent = age_s is None or age_s > REPORTS_MISSING_S
    node = NodeStatus(
        int(entry["id"]),
        role=Role.GATEWAY if entry["role"] == "gateway" else Role.ROUTER,
        on=bool(entry["on"]),
        connected=bool(entry["connected"]),
        gateway=gateway if entry["connected"] else NO_ROUTE,
        hops=_or_none(entry["hops"]),
        next_hop=_or_none(entry["next_hop"]),
        neighbours=bytes(entry.get("neighbours", ())),
        neighbour_ages=bytes(len(entry.get("neighbours", ()))),
        report_age=(age_s or REPORTS_MISSING_S) if is_silent else 0.0,
        total_messages=int(entry.get("messages_sent", 0)),
        tries=float(entry.get("tries", 0.0)),
        why_not_fly=str(entry.get("why_not_fly", "")),
        shares_id=bool(entry.get("shares_id", False)),
    )
    if entry.get("battery_percent") is not None:
        node.battery = float(entry["battery_percent"])
    if place is not None:
        latitude, longitude, height = place
        node.position = (longitude, latitude, height)
    else:
        node.position = UNKNOWN_POSITION
    if entry.get("flying") and place is not None:
        node.path = tuple(node.position)  # its goal is not reported
    return node


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
