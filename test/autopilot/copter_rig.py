"""One ArduCopter, its pilot's ground station and the node's engine."""

from __future__ import annotations

import os
import random
import socket
import threading
from pathlib import Path
from typing import Mapping

from arducopter import GCS_TIMEOUT_S, SAFE, ArduCopter
from pilot_side import PilotSide

from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.engine import MavlinkEngine
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions

ORIGIN = Origin(52.0907, 5.1214, 3.0)
ALL = Permissions(may_arm=True, may_take_off=True, may_change_mode=True)
LIMITS = FlightLimits(speed_m_s=5.0, cruise_height_m=6.0, layer_m=1.0)
FLIGHT_S = 150.0
REPORTED_WITHIN_S = 5.0
DISARM_DELAY_S = 10.0  # ArduPilot's default, after arming without a take-off
FLOWN = "flights"  # a test's property: what flew, how often, how often to its goal
WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])  # each flies a copter of its own


class LossyLine:
    """Passes MAVLink between an engine and a copter and drops a share of the messages."""

    def __init__(self, port: int, share: float, seed: int) -> None:
        self.dropped = self.passed = 0
        self._rng = random.Random(seed)
        self._share = share
        self._port = port
        self._listener = socket.create_server(("127.0.0.1", 0))
        threading.Thread(target=self._accept, daemon=True).start()

    @property
    def address(self) -> str:
        return f"tcp:127.0.0.1:{self._listener.getsockname()[1]}"

    def close(self) -> None:
        self._listener.close()

    def _accept(self) -> None:
        try:
            near, _ = self._listener.accept()
        except OSError:
            return
        far = socket.create_connection(("127.0.0.1", self._port))
        for source, sink in ((near, far), (far, near)):
            threading.Thread(target=self._pass, args=(source, sink), daemon=True).start()

    def _pass(self, source: socket.socket, sink: socket.socket) -> None:
        waiting = b""
        try:
            while True:
                data = source.recv(4096)
                if not data:
                    break
                waiting += data
                while (length := _frame_bytes(waiting)) and length <= len(waiting):
                    frame, waiting = waiting[:length], waiting[length:]
                    if self._rng.random() < self._share:
                        self.dropped += 1
                    else:
                        self.passed += 1
                        sink.sendall(frame)
        except OSError:
            pass
        source.close()
        sink.close()


def _frame_bytes(data: bytes) -> int:
    """Length of the MAVLink frame that begins here; 1 for a byte that begins none, 0: unknown."""
    if not data:
        return 0
    if data[0] not in (0xFD, 0xFE):
        return 1
    if len(data) < 3:
        return 0
    if data[0] == 0xFE:
        return data[1] + 8
    return data[1] + 12 + (13 if data[2] & 1 else 0)


class CopterRig:
    """Ready in GUIDED on the ground, if not told otherwise."""

    def __init__(
        self,
        program: tuple[Path, Path],
        folder: Path,
        instance: int = WORKER,
        speedup: float = 5.0,
        permissions: Permissions = ALL,
        losing: float = 0.0,
        parameters: Mapping[str, float] | None = None,
        ready: bool = True,
        limits: FlightLimits = LIMITS,
        home: Location = Location(0.0, 0.0, 0.0),  # noqa: B008 (immutable)
        node: int = 1,
    ) -> None:
        # The copter's clock runs faster than the node's: what it waits for lasts longer there.
        faster = max(1.0, speedup)
        waits = {
            "FS_GCS_TIMEOUT": min(120.0, GCS_TIMEOUT_S * faster),
            "DISARM_DELAY": min(127.0, DISARM_DELAY_S * faster),
        }
        wanted = {**SAFE, **waits, **(parameters or {})}
        stands = Origin(*ORIGIN.to_earth(home))
        self.copter = ArduCopter(program, folder, instance, stands, speedup, wanted)
        self.line: LossyLine | None = None
        address = self.copter.address
        if losing:
            self.line = LossyLine(int(address.rpartition(":")[2]), losing, seed=instance)
            address = self.line.address
        self.pilot = PilotSide(self.copter.pilot_address, self.copter.system_id)
        self._node = (node, address, ORIGIN, limits, permissions)
        self.start_engine()
        if ready:
            self.pilot.make_ready()
            self.pilot.until("ready to fly", self.engine.can_fly)

    def __enter__(self) -> CopterRig:
        return self

    def __exit__(self, *_error: object) -> None:
        self.engine.close()
        self.pilot.close()
        self.copter.close()
        if self.line is not None:
            self.line.close()

    def start_engine(self) -> None:
        """The node starts, or starts again."""
        self.engine = MavlinkEngine(*self._node)

    def fly(self, latitude: float, longitude: float, height: float) -> None:
        """Until the flight is over; it must end at its goal."""
        assert self.try_to_fly(Location(latitude, longitude, height)) == ""

    def try_to_fly(self, goal: Location) -> str:
        """Until the flight is over; why it did not end at its goal, landed if that is 0 m high."""
        self.engine.set_goal(*goal)
        self.pilot.until("at its goal", lambda: not self.engine.is_flying(), FLIGHT_S)
        if self.engine.why_ended():
            return self.engine.why_ended()
        away_m = self.engine.get_location().distance_m(goal)
        if away_m > 1.6:
            return f"{away_m:.1f} m from its goal"
        if goal.height == 0.0:  # its pilot may hear of that later
            self.pilot.until("on the ground and disarmed", self._is_down, REPORTED_WITHIN_S)
        return ""

    def _is_down(self) -> bool:
        return bool(self.engine.status().on_ground) and not self.pilot.armed

    def bring_down(self) -> None:
        """The pilot lands it and gives it back."""
        self.pilot.choose("LAND")
        self.pilot.until("down", lambda: not self.pilot.armed, FLIGHT_S)
        self.pilot.choose("GUIDED")

    def set_out(self, latitude: float, longitude: float, height: float) -> None:
        """Until it is on its way across."""
        start = self.engine.get_location()
        self.engine.set_goal(latitude, longitude, height)
        self.pilot.until(
            "on its way", lambda: self.engine.get_location().distance_m(start) > 15.0, FLIGHT_S
        )
