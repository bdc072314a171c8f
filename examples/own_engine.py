"""An engine of your own: PYTHONPATH=examples raspberry_router --id 3 --drone own_engine:OwnEngine

This drone accepts lines "goto X Y Z" over TCP and sends lines "at X Y Z", in metres.
"""

from __future__ import annotations

import os
import socket
import threading

from drone_mesh import IDroneEngine, Location, LocationUnknown, check_goal

ADDRESS = ("127.0.0.1", int(os.environ.get("DRONE_PORT", "5770")))


class OwnEngine(IDroneEngine):
    """Flies the drone that listens at ADDRESS."""

    def __init__(self, node_id: int) -> None:
        self._line = socket.create_connection(ADDRESS, timeout=2.0).makefile("rw", newline="\n")
        self._location: Location | None = None  # written only by the thread of _read
        threading.Thread(target=self._read, name=f"drone {node_id}", daemon=True).start()

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        check_goal(latitude, longitude, height)
        self._line.write(f"goto {longitude} {latitude} {height}\n")
        self._line.flush()

    def get_location(self) -> Location:
        if self._location is None:
            raise LocationUnknown("the drone has not reported its place yet")
        return self._location

    def _read(self) -> None:
        for line in self._line:
            self._location = Location.from_vector([float(word) for word in line.split()[1:4]])
