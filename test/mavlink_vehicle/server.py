"""VehicleServer: simulated vehicles over UDP, in real time."""

from __future__ import annotations

import contextlib
import selectors
import socket
import threading
import time
from typing import Sequence, Tuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.mavlink.autopilots import Autopilot
from drone_mesh.drone.mavlink.telemetry import Message
from mavlink_vehicle.vehicle import MavlinkVehicle

Address = Tuple[str, int]

TICK_S = 0.05  # ten centimetres of flight at 2 m/s
FORGET_PEER_S = 10.0  # a peer silent for this long gets no more messages
MOST_BYTES = 4096
LOOPBACK = "127.0.0.1"


class _Port:
    """One vehicle on its own UDP port; it answers every peer."""

    def __init__(self, system_id: int, autopilot: Autopilot, home: Origin) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind((LOOPBACK, 0))
        self.socket.setblocking(False)
        self.vehicle = MavlinkVehicle(autopilot, home, self._send, system_id)
        self._codec = mavlink.MAVLink(None, system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._codec.robust_parsing = True
        self._heard_s: dict[Address, float] = {}

    @property
    def address(self) -> str:
        """The address for an engine."""
        return f"udpout:{LOOPBACK}:{self.socket.getsockname()[1]}"

    def read(self, now_s: float) -> None:
        """Process the messages that have arrived."""
        while True:
            try:
                data, sender = self.socket.recvfrom(MOST_BYTES)
            except OSError:  # nothing left, or a peer has gone
                return
            self._heard_s[sender] = now_s
            for message in self._codec.parse_buffer(data) or ():
                self.vehicle.on_message(message, now_s)

    def tick(self, now_s: float) -> None:
        """Fly on, and forget silent peers."""
        for peer, heard_s in list(self._heard_s.items()):
            if now_s - heard_s > FORGET_PEER_S:
                del self._heard_s[peer]
        self.vehicle.tick(now_s)

    def _send(self, message: Message) -> None:
        data = message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % 256
        for peer in self._heard_s:
            with contextlib.suppress(OSError):  # no listener there now; datagrams may get lost
                self.socket.sendto(data, peer)


class VehicleServer:
    """Vehicles with system ids 1, 2, ... Its thread flies them, from start to close."""

    def __init__(self, autopilot: Autopilot, homes: Sequence[Origin]) -> None:
        """Each vehicle starts at its home."""
        self._ports = [_Port(number, autopilot, home) for number, home in enumerate(homes, start=1)]
        self._selector = selectors.DefaultSelector()
        for port in self._ports:
            self._selector.register(port.socket, selectors.EVENT_READ, port)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="vehicles", daemon=True)

    @property
    def addresses(self) -> list[str]:
        """The addresses of the vehicles for engines, in the order of their homes."""
        return [port.address for port in self._ports]

    @property
    def vehicles(self) -> list[MavlinkVehicle]:
        """The vehicles themselves; while the server runs, for its thread, or read-only."""
        return [port.vehicle for port in self._ports]

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """End the thread and close the ports."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        self._selector.close()
        for port in self._ports:
            port.socket.close()

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._ended.is_set():
            now_s = time.monotonic()
            for key, _ in self._selector.select(max(0.0, due_s - now_s)):
                key.data.read(time.monotonic())
            now_s = time.monotonic()
            if now_s >= due_s:
                due_s = max(due_s, now_s - TICK_S) + TICK_S
                for port in self._ports:
                    port.tick(now_s)
