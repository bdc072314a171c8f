"""Cursor on Target (MIL-STD-2525 in XML) for ATAK: one event for each node and report."""

from __future__ import annotations

import time
from xml.etree.ElementTree import Element, SubElement, tostring

from drone_mesh.drone.geodesy import Origin
from drone_mesh.ground_station.vehicles import Vehicle

_DRONE = "a-f-A-M-H-Q"  # friend, air, military, rotary wing, drone
_UNKNOWN_M = "9999999.0"  # of the errors, as the schema has it


def event_of(
    vehicle: Vehicle, origin: Origin, now_s: float, now_utc_s: float, period_s: float
) -> bytes:
    """The event; empty: its place is not known.

    `now_s` and the vehicle have the mesh's clock, which reads `now_utc_s` as seconds of 1970. The
    event is stale when the next report is due, `period_s` after its own.
    """
    if vehicle.place is None:
        return b""
    north_deg, east_deg, altitude_m = origin.to_earth(vehicle.place)
    true_utc_s, uid = now_utc_s - (now_s - vehicle.place_s), f"drone_mesh.{vehicle.node}"
    at, stale = _utc(true_utc_s), _utc(true_utc_s + period_s)
    how = "m-g"  # by a machine, with GPS
    event = Element(
        "event", version="2.0", uid=uid, type=_DRONE, how=how, time=at, start=at, stale=stale
    )
    where = {"lat": f"{north_deg:.7f}", "lon": f"{east_deg:.7f}", "hae": f"{altitude_m:.1f}"}
    SubElement(event, "point", where, ce=_UNKNOWN_M, le=_UNKNOWN_M)
    detail = SubElement(event, "detail")
    SubElement(detail, "contact", callsign=f"drone {vehicle.node}")
    if vehicle.battery_percent is not None:
        SubElement(detail, "status", battery=f"{vehicle.battery_percent:.0f}")
    doing = {True: "in flight", False: "at rest", None: ""}[vehicle.flying]
    words = "".join(one if one.isprintable() else "?" for one in vehicle.why_not_fly or doing)
    SubElement(detail, "remarks").text = words  # in XML, other characters may be none
    return bytes(tostring(event, encoding="utf-8", xml_declaration=True))


def _utc(seconds: float) -> str:
    whole, rest = divmod(round(seconds * 1000), 1000)
    return f"{time.strftime('%Y-%m-%dT%H:%M:%S', time.gmtime(whole))}.{rest:03d}Z"
