"""A gateway's knowledge of its mesh: for GET /mesh, and through it for the web console."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from drone_mesh.communication.interfaces import NO_ROUTE, KnownNode
from drone_mesh.communication.node.gateway import MeshnetworkGateway
from drone_mesh.communication.reports import ReportedNode
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import LocationUnknown


def mesh_report(
    gateway: MeshnetworkGateway,
    engine: IDroneEngine,
    on: bool,
    origin: Origin | None,
    now_s: float,
) -> dict[str, Any]:
    """All nodes, as JSON values. Reads snapshots, so any thread may call it."""
    known = {node.node_id: node for node in gateway.get_known_nodes()}
    reported = {node.node_id: node for node in gateway.get_node_reports()}
    return {
        "gateway": gateway.get_node_id(),
        "origin": None if origin is None else dataclasses.astuple(origin),
        "nodes": [
            _gateway(gateway, engine, on, origin),
            *(
                _node(node_id, known.get(node_id), reported.get(node_id), origin, now_s)
                for node_id in sorted(known.keys() | reported.keys())
            ),
        ],
    }


def _gateway(
    gateway: MeshnetworkGateway, engine: IDroneEngine, on: bool, origin: Origin | None
) -> dict[str, Any]:
    try:
        place: Location | None = engine.get_location()
    except LocationUnknown:
        place = None
    me = gateway.get_node_id()
    return {
        "id": me,
        "role": "gateway",
        "on": on,
        "connected": True,
        "hops": 0,
        "next_hop": me,
        "heard_s_ago": 0.0,
        "reported": True,
        "neighbours": sorted(gateway.get_neighbours()),
        "battery_percent": engine.battery_percent(),
        "flying": bool(engine.is_flying()),
        "why_not_fly": engine.why_not_fly(),
        "tries": gateway.get_channel_use().tries,
        "shares_id": gateway.get_shares_id(),
        "messages_sent": gateway.get_total_message_sent(),
        **_place(place, origin),
    }


def _node(
    node_id: int,
    known: KnownNode | None,
    reported: ReportedNode | None,
    origin: Origin | None,
    now_s: float,
) -> dict[str, Any]:
    heard_s = max(
        known.heard_s if known is not None else -math.inf,
        reported.heard_s if reported is not None else -math.inf,
    )
    fields: dict[str, Any] = {
        "id": node_id,
        "role": "router",
        "on": True,
        "connected": known is not None and known.next_hop != NO_ROUTE,
        "hops": None if known is None or known.hops == NO_ROUTE else known.hops,
        "next_hop": None,
        "heard_s_ago": round(max(0.0, now_s - heard_s), 1) if math.isfinite(heard_s) else None,
        "reported": reported is not None and math.isfinite(reported.heard_s),
    }
    if reported is None:
        return {**fields, **_place(None, origin)}
    report = reported.report
    return {
        **fields,
        "hops": None if report.hops == NO_ROUTE else report.hops,
        "next_hop": None if report.next_hop == NO_ROUTE else report.next_hop,
        "neighbour_count": report.neighbours,
        "battery_percent": report.battery_percent,
        "flying": report.flying,
        "why_not_fly": reported.why_not_fly,
        "tries": report.tries,
        "shares_id": report.shares_id,
        **_place(report.place, origin),
    }


def _place(place: Location | None, origin: Origin | None) -> dict[str, Any]:
    """A position in metres in the common frame, and in degrees if that frame has an origin."""
    if place is None:
        return {"place": None, "earth": None}
    metres = [round(value, 2) for value in place]
    if origin is None:
        return {"place": metres, "earth": None}
    earth = origin.to_earth(place)
    degrees = [round(earth.latitude_deg, 7), round(earth.longitude_deg, 7)]
    return {"place": metres, "earth": [*degrees, round(earth.altitude_m, 1)]}
