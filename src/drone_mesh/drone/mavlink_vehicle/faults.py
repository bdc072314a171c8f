"""Faults of a simulated vehicle, which may be set at any time."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class VehicleFaults:
    """No faults by default."""

    silent: bool = False  # the link is broken in both directions
    fix_type: int = 3  # GPS_FIX_TYPE
    estimate_good: bool = True
    positions_stop: bool = False
    fence_breached: bool = False
    refuses_to_arm: bool = False
    spool_up_s: float = 0.0  # from the acknowledgement of a take-off to the first movement
    battery_known: bool = True
    stick_us: int = 1500  # of the roll stick
