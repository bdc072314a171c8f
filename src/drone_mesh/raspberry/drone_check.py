"""raspberry_router ... check-drone: the autopilot's parameters as docs/flying.md wants them.

Also what the autopilot's home says about --origin.
"""

from __future__ import annotations

import math
import time
from typing import Sequence

from drone_mesh.drone.engines import MAVLINK
from drone_mesh.errors import ConfigurationError
from drone_mesh.raspberry.options import Options

WITHIN_S = 30.0  # to the first heartbeat, and again to the last parameter
HOME_WITHIN_S = 6.0  # after the parameters; it comes every 2 s
POLL_S = 0.05


def check_drone(options: Options) -> int:
    """Print every parameter; the exit status is 0 if each is safe. Raises ConfigurationError."""
    if not options.flight.drone.startswith(MAVLINK):
        raise ConfigurationError("check-drone needs --drone mavlink:ADDRESS")
    from drone_mesh.drone.mavlink.authority import FlightArea
    from drone_mesh.drone.mavlink.commander import Commander
    from drone_mesh.drone.mavlink.link import MavlinkLink
    from drone_mesh.drone.mavlink.parameter_check import ParameterCheck
    from drone_mesh.drone.mavlink.telemetry import Telemetry

    telemetry = Telemetry()
    link = MavlinkLink(options.flight.drone[len(MAVLINK) :])
    try:
        commander = Commander(telemetry, link.send)
        parameters = ParameterCheck(commander, telemetry)
        end_s = time.monotonic() + WITHIN_S
        heard, done_s = False, math.inf
        while True:
            now_s = time.monotonic()
            if parameters.is_done:
                done_s = min(done_s, now_s)
                has_compared = options.flight.origin is None or telemetry.home is not None
                if has_compared or now_s > done_s + HOME_WITHIN_S:
                    break
            if telemetry.autopilot is not None and not heard:
                heard, end_s = True, now_s + WITHIN_S
            elif now_s > end_s and not parameters.is_done:
                raise ConfigurationError(telemetry.link_trouble(now_s) or "no answer in 30 s")
            for message in link.receive(POLL_S):
                is_ours = telemetry.on_message(message, now_s)
                if is_ours and message.get_type() == "PARAM_VALUE":
                    parameters.on_value(message)
            commander.tick(now_s)
            parameters.tick(now_s)
    finally:
        link.close()
    rows: list[Sequence[str]] = [("parameter", "found", "", "wanted", "to set it")]
    for finding in parameters.findings:
        rows.append(
            (
                finding.name,
                "not readable" if finding.value is None else f"{finding.value:g}",
                "ok" if finding.is_safe else "UNSAFE",
                finding.requirement.wanted,
                f"param set {finding.name} {finding.requirement.for_example:g}",
            )
        )
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip())
    origin = options.flight.origin
    doubts = FlightArea(telemetry, origin, options.flight.limits).doubts() if origin else ""
    if origin is not None and telemetry.home is None:
        doubts = "its home is not known yet, so --origin was not compared with it: GPS?"
    if doubts:
        print(doubts)
    return 0 if all(finding.is_safe for finding in parameters.findings) else 1
