"""Notifications to systemd (sd_notify(3)): ready, alive, stopping, and a status line."""

from __future__ import annotations

import contextlib
import os
import socket
from typing import Mapping


class ServiceManager:
    """Notifies the service manager that started this program; without one, does nothing.

    Our own because it sends one datagram: the library for it has had no release since 2017.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self._address = environment.get("NOTIFY_SOCKET", "")
        if self._address.startswith("@"):
            self._address = "\0" + self._address[1:]  # an abstract socket

    def ready(self) -> None:
        self._send("READY=1")

    def alive(self, status: str) -> None:
        """The program is alive; to be sent more often than WatchdogSec."""
        self._send(f"WATCHDOG=1\nSTATUS={status}")

    def stopping(self) -> None:
        """The program ends on purpose."""
        self._send("STOPPING=1")

    def _send(self, text: str) -> None:
        if self._address:
            with contextlib.suppress(OSError), socket.socket(
                socket.AF_UNIX, socket.SOCK_DGRAM
            ) as line:
                line.sendto(text.encode(), self._address)
