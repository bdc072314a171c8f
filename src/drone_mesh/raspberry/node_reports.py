"""What a node tells about itself, and a gateway about its mesh: as JSON values, a line, a table.

For GET /status and GET /mesh, and through these for raspberry_status and the web console.
"""

from __future__ import annotations

import dataclasses
import math
from importlib import metadata
from typing import Any

from drone_mesh.communication.events.observer import in_hops
from drone_mesh.communication.interfaces import NO_ROUTE, KnownNode
from drone_mesh.communication.node.component import MeshnetworkComponent
from drone_mesh.communication.node.gateway import MeshnetworkGateway
from drone_mesh.communication.reports import ReportedNode
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import LocationUnknown
from drone_mesh.nrf24.high_level import NRF24HighLevelInterface


def node_status(
    component: MeshnetworkComponent,
    engine: IDroneEngine,
    antenna: NRF24HighLevelInterface,
    uptime_s: float,
    now_s: float,
) -> dict[str, Any]:
    """The complete status as JSON values. Reads snapshots, so any thread may call it."""
    radio, links = antenna.statistics(), antenna.link_quality()
    neighbours = [
        {
            "id": node,
            "heard_s_ago": round(max(0.0, now_s - heard_s), 1),
            "tries_per_packet": round(links[node].tries, 2) if node in links else None,
            "delivered": round(links[node].delivered, 3) if node in links else None,
        }
        for node, heard_s in sorted(component.get_neighbours().items())
    ]
    return {
        "node": component.get_node_id(),
        "version": version(),
        "uptime_s": round(uptime_s, 1),
        "on": antenna.on(),
        "connected": component.get_connected_to_gateway(),
        "gateway": _known(component.get_preferred_gateway()),
        "hops": _known(component.get_hops_from_gateway_away()),
        "another_radio_uses_its_id": component.get_shares_id(),
        "known_nodes": component.get_router_tech_table_size(),
        "messages_sent": component.get_total_message_sent(),
        "steps_back_to": _known(component.get_last_good_known_location_id()),
        "repair": component.get_repair_status().in_words(now_s),
        "neighbours": neighbours,
        "flight": _flight(engine),
        "radio": {
            "sent": radio.sent,
            "acknowledged": radio.acknowledged,
            "lost": radio.lost,
            "broadcasts": radio.broadcasts,
            "received": radio.received,
            "retries": radio.retries,
            "tries_per_packet": round(radio.tries_per_packet, 2),
            "restarts": radio.restarts,
            "corrupt": radio.corrupt,
            "irq_fallbacks": radio.irq_fallbacks,
        },
    }


def one_line(status: dict[str, Any]) -> str:
    """The most important parts, in one line."""
    connected = (
        f"gateway {status['gateway']}, {in_hops(status['hops'])}"
        if status["connected"]
        else "not connected"
    )
    neighbours = " ".join(str(neighbour["id"]) for neighbour in status["neighbours"]) or "none"
    radio, flight = status["radio"], status["flight"]
    drone = flight["why_not"] or ("flying" if flight["flying"] else "can fly")
    return (
        f"{connected}; neighbours {neighbours}; sent {radio['sent']}, lost {radio['lost']}, "
        f"{radio['tries_per_packet']:g} tries per packet; drone: {drone}"
    )


def table(status: dict[str, Any]) -> str:
    """The complete status: one value per line, then one row per neighbour."""
    lines: list[str] = []
    for key, value in status.items():
        if isinstance(value, dict):
            lines.extend(_line(f"{key}: {name}", inner) for name, inner in value.items())
        elif key != "neighbours":
            lines.append(_line(key, value))
    lines.append(f"{'neighbour':11}{'heard':>12}{'tries':>8}{'delivered':>11}")
    lines.extend(_neighbour(one) for one in status.get("neighbours", ()))
    return "\n".join(lines)


def _line(name: str, value: object) -> str:
    words = ("no", "yes")[value] if isinstance(value, bool) else value
    return f"{name.replace('_', ' '):35}{'-' if words in (None, '') else words}"


def _neighbour(neighbour: dict[str, Any]) -> str:
    """One row: when it was heard, and the quality of its link; "-" if no packet was sent to it."""
    tries, delivered = neighbour["tries_per_packet"], neighbour["delivered"]
    quality = ("-", "-") if tries is None else (f"{tries:.2f}", f"{delivered:.0%}")
    heard = f"{neighbour['heard_s_ago']:g} s ago"
    return f"{neighbour['id']!s:11}{heard:>12}{quality[0]:>8}{quality[1]:>11}"


def _flight(engine: IDroneEngine) -> dict[str, Any]:
    try:
        place: list[float] | None = [round(metres, 2) for metres in engine.get_location()]
        unknown = ""
    except LocationUnknown as error:
        place, unknown = None, str(error)
    return {
        "flying": bool(engine.is_flying()),
        "why_not": engine.why_not_fly(),
        "latitude_longitude_height": place,
        "place_unknown": unknown,
    }


def _known(number: int) -> int | None:
    return None if number == NO_ROUTE else number


def version() -> str:
    try:
        return metadata.version("drone_mesh")
    except metadata.PackageNotFoundError:
        return "not installed"


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
        "fence": [
            {
                "name": zone.name,
                "inside": inside,
                **({"lowest": zone.lowest_m} if math.isfinite(zone.lowest_m) else {}),
                **({"highest": zone.highest_m} if math.isfinite(zone.highest_m) else {}),
                "corners": [round(m, 2) for ring in zone.rings for corner in ring for m in corner],
                "rings": [len(ring) for ring in zone.rings],
            }
            for zone, inside in engine.fence.zones
        ],
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
