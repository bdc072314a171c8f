"""Cursor on Target (MIL-STD-2525 in XML) for ATAK: one event for each node and report."""

from __future__ import annotations

import time
from xml.etree import ElementTree

from drone_mesh.drone.geodesy import Origin
from drone_mesh.ground_station.vehicles import Vehicle

_DRONE = "a-f-A-M-H-Q"  # friend, air, military, rotary wing, drone
_UNKNOWN_M = "9999999.0"  # of the errors, as the schema has it


def event_of(
    vehicle: Vehicle, origin: Origin, now_s: float, now_utc_s: float, period_s: float
) -> bytes | None:
    """The event; None: its place is not known.

    `now_s` and the vehicle have the mesh's clock, which reads `now_utc_s` as seconds of 1970. The
    event is stale when the next report is due, `period_s` after its own.
    """
    if vehicle.place is None:
        return None
    earth = origin.to_earth(vehicle.place)
    true_utc_s = now_utc_s - (now_s - vehicle.place_s)
    event = ElementTree.Element(
        "event",
        version="2.0",
        uid=f"drone_mesh.{vehicle.node}",
        type=_DRONE,
        how="m-g",  # by a machine, with GPS
        time=_utc(true_utc_s),
        start=_utc(true_utc_s),
        stale=_utc(true_utc_s + period_s),
    )
    ElementTree.SubElement(
        event,
        "point",
        lat=f"{earth.latitude_deg:.7f}",
        lon=f"{earth.longitude_deg:.7f}",
        hae=f"{earth.altitude_m:.1f}",
        ce=_UNKNOWN_M,
        le=_UNKNOWN_M,
    )
    detail = ElementTree.SubElement(event, "detail")
    ElementTree.SubElement(detail, "contact", callsign=f"drone {vehicle.node}")
    if vehicle.battery_percent is not None:
        ElementTree.SubElement(detail, "status", battery=f"{vehicle.battery_percent:.0f}")
    words = vehicle.why_not_fly or ("in flight" if vehicle.flying else "")
    if words:
        ElementTree.SubElement(detail, "remarks").text = words
    return bytes(ElementTree.tostring(event, encoding="utf-8", xml_declaration=True))


def _utc(seconds: float) -> str:
    whole, rest = divmod(round(seconds * 1000), 1000)
    return f"{time.strftime('%Y-%m-%dT%H:%M:%S', time.gmtime(whole))}.{rest:03d}Z"
