"""scripts/autopilots: several of ArduPilot's simulated copters, ready for the nodes of a mesh."""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import Sequence

from arducopter import ArduCopter, program_from_environment
from pilot_side import PilotSide

from drone_mesh.arguments import whole
from drone_mesh.drone.geodesy import Origin
from drone_mesh.errors import ConfigurationError
from drone_mesh.nrf24.settings import DataRate
from drone_mesh.raspberry.emulated_air import column_place
from drone_mesh.stopping import ends_as

DEMONSTRATION_ORIGIN = Origin(52.0907, 5.1214, 3.0)  # Utrecht; only without --origin
MOST_COPTERS = 16
POLL_S = 0.5


@ends_as("scripts/autopilots")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run them until Ctrl-C; the exit status is 1 if they do not start."""
    parser = argparse.ArgumentParser(
        "scripts/autopilots",
        description="Starts ArduPilot's simulated copters for the nodes 1..N, in GUIDED and ready "
        "to arm, where emulated nodes stand on the map. Node N's copter has system id N, its "
        "engine's port is 5750 + 10 N and its pilot's port 5752 + 10 N.",
        epilog="Environment: ARDUCOPTER, the program; ARDUCOPTER_PARAMETERS, the file copter.parm, "
        "if it is not beside the source of that program.",
    )
    parser.add_argument("copters", type=whole(1, MOST_COPTERS), help=f"1..{MOST_COPTERS}")
    parser.add_argument("--origin", default="", metavar="LAT,LON,ALT", help="as for the nodes")
    parser.add_argument("--speedup", type=float, default=1.0, help="default: %(default)g")
    parsed = parser.parse_args(arguments)
    origin = Origin.parse(parsed.origin) if parsed.origin else DEMONSTRATION_ORIGIN
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with contextlib.suppress(KeyboardInterrupt):
        _run(parsed.copters, origin, parsed.speedup)
    return 0


def _run(copters: int, origin: Origin, speedup: float) -> None:
    program = program_from_environment()
    as_text = f"{origin.latitude_deg:g},{origin.longitude_deg:g},{origin.altitude_m:g}"
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="autopilots-")))
        fleet = []
        for node_id in range(1, copters + 1):
            place = origin.to_earth(column_place(node_id, DataRate.KBPS_250))
            own = folder / str(node_id)
            own.mkdir()
            copter = ArduCopter(program, own, node_id - 1, Origin(*place), speedup)
            stack.callback(copter.close)
            fleet.append(copter)
        for copter in fleet:
            # A port has one user: from here on the pilot's own ground station.
            with contextlib.closing(PilotSide(copter.pilot_address, copter.system_id)) as pilot:
                pilot.make_ready()
            print(
                f"raspberry_router --id {copter.system_id} --emulated-air 9100 "
                f"--drone mavlink:{copter.address} --origin {as_text} "
                "--may-arm --may-take-off --may-change-mode",
                flush=True,
            )
        print(f"{copters} copters are ready; Ctrl-C ends them", flush=True)
        while True:
            time.sleep(POLL_S)
            for copter in fleet:
                if not copter.is_running:
                    raise ConfigurationError(f"copter {copter.system_id} has ended by itself")


if __name__ == "__main__":
    sys.exit(main())
