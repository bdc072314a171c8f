"""SilentEngines: the engines that do not answer, and how they are found again."""

from __future__ import annotations

import logging
import threading
from typing import Any

from drone_mesh.ros.graph.periodic import Periodic
from drone_mesh.ros.graph.persistent_service import (
    PersistentService,
    ServiceGone,
    ServiceRefused,
    ServiceSilent,
)
from drone_mesh.srv import RequestGPSRequest

ASK_AGAIN_AFTER_S = 1.0  # wall seconds

_log = logging.getLogger(__name__)

Gps = PersistentService[Any, Any]


class SilentEngines(Periodic):
    """Asks engines that did not answer again, in a thread of its own, since that may take seconds.

    Meanwhile nobody else uses their connections. One process may fly many drones: if it hangs, only
    the first of them costs the executor's worker its time. Any thread.
    """

    def __init__(self) -> None:
        super().__init__("silent engines", ASK_AGAIN_AFTER_S)
        self._lock = threading.Lock()
        # By the process that hangs, or else by the service that is not there.
        self._silent: dict[str, Gps] = {}

    def __len__(self) -> int:
        return len(self._silent)

    def holds(self, gps: Gps) -> bool:
        """Whether this engine, or the process that flies its drone, does not answer."""
        return gps.server in self._silent or gps.name in self._silent

    def add(self, gps: Gps, error: ServiceGone) -> None:
        """Ask this engine, which did not answer, again and again."""
        hangs = bool(gps.server) and isinstance(error, ServiceSilent)
        with self._lock:
            self._silent[gps.server if hangs else gps.name] = gps
        if hangs:
            _log.error("%s does not answer: its drones have no position", gps.server)

    def drop(self, gps: Gps) -> None:
        """Ask this engine no more, because its drone has ended."""
        with self._lock:
            self._silent = {key: other for key, other in self._silent.items() if other is not gps}

    def _work(self) -> None:
        for key, gps in list(self._silent.items()):
            try:
                gps.connect()
                gps.call(RequestGPSRequest())
            except ServiceRefused:
                pass
            except ServiceSilent:
                continue
            except ServiceGone as error:
                with self._lock:  # the process itself has ended, or answers
                    if self._silent.pop(key, None) is gps:
                        self._silent[gps.name] = gps
                _log.debug("%s", error)
                continue
            with self._lock:
                if self._silent.pop(key, None) is not gps:
                    gps.close()
                    continue
            if key != gps.name:
                _log.info("%s answers again", key)
