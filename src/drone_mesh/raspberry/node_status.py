"""The status of a node: for GET /status, for one log line, and for a table."""

from __future__ import annotations

from importlib import metadata
from typing import Any, Mapping

from drone_mesh.communication.component import MeshnetworkComponent
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.errors import LocationUnknown
from drone_mesh.nrf24.link_quality import Quality
from drone_mesh.nrf24.statistics import RadioStatistics


def node_status(
    component: MeshnetworkComponent,
    engine: IDroneEngine,
    radio: RadioStatistics,
    links: Mapping[int, Quality],
    on: bool,
    uptime_s: float,
    now_s: float,
) -> dict[str, Any]:
    """The complete status as JSON values. Reads snapshots, so any thread may call it."""
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
        "version": _version(),
        "uptime_s": round(uptime_s, 1),
        "on": on,
        "connected": component.get_connected_to_gateway(),
        "gateway": _known(component.get_preferred_gateway()),
        "hops": _known(component.get_hops_from_gateway_away()),
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
        f"gateway {status['gateway']}, {status['hops']} hops"
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
    """The complete status, one value per line."""
    rows: list[tuple[str, Any]] = []
    for key, value in status.items():
        if isinstance(value, dict):
            rows.extend((f"{key}.{name}", inner) for name, inner in value.items())
        elif isinstance(value, list):
            words = ", ".join(_link(one) for one in value)
            rows.append((key, words or "none"))
        else:
            rows.append((key, value))
    return "\n".join(f"{key:24} {'-' if value is None else value}" for key, value in rows)


def _link(neighbour: dict[str, Any]) -> str:
    """A neighbour as text: when it was heard, and how well packets reach it."""
    words = f"{neighbour['heard_s_ago']:g} s ago"
    if neighbour.get("tries_per_packet") is not None:
        words += (
            f", {neighbour['tries_per_packet']:g} tries, {neighbour['delivered']:.0%} delivered"
        )
    return f"{neighbour['id']} ({words})"


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


def _version() -> str:
    try:
        return metadata.version("drone_mesh")
    except metadata.PackageNotFoundError:
        return "not installed"
