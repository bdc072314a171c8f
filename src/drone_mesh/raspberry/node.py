"""One node of the mesh: radio, drone, software and thread."""

from __future__ import annotations

import dataclasses
import logging
import random
import time
from typing import Any, Callable, Dict

from drone_mesh.communication.assembly import assemble_component
from drone_mesh.communication.interfaces import MAX_NODE_ID, IInternetConnection
from drone_mesh.communication.observer import MeshEvent, MeshEventKind
from drone_mesh.communication.repair_options import RepairOptions
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.execution import MeshExecutor, Work
from drone_mesh.nrf24.high_level import NRF24HighLevelInterface
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.raspberry.node_status import node_status
from drone_mesh.raspberry.options import Options

ALIVE_WITHIN_S = 20.0  # our choice: two check periods; systemd's watchdog waits longer

_log = logging.getLogger(__name__)

ReadStatus = Callable[[], Dict[str, Any]]
"""The status of a node; any thread may call it."""

MakeInternet = Callable[[Callable[[Work], None], ReadStatus], IInternetConnection]
"""Creates the internet connection of a gateway from `submit` and its node's status."""


class RadioNode:
    """A router, or a gateway if it gets an internet connection. For one thread at a time.

    The node's own thread works in the component, from start to stop.
    """

    def __init__(
        self,
        radio: NRF24LowLevelInterface,
        engine: IDroneEngine,
        options: Options,
        make_internet: MakeInternet | None = None,
    ) -> None:
        """Takes ownership of radio and engine. Raises what `make_internet` raises."""
        self.radio = radio
        self.engine = engine
        self._executor = MeshExecutor(time.monotonic, False, name=f"mesh {radio.node_id}")
        self._seat = self._executor.seat()
        self._antenna = NRF24HighLevelInterface(radio, self._seat.submit)
        self._internet = (
            make_internet(self._seat.submit, self.status) if make_internet is not None else None
        )
        self.component = assemble_component(
            radio.node_id,
            self._antenna,
            engine,
            random.Random(),
            internet=self._internet,
            routing=options.routing,
            repair=options.repair,
            repair_options=RepairOptions(clearance_m=options.clearance_m),
            timing=options.timing,
            observer=_log_event,
        )
        self._started = False
        self._started_s = self._beat_s = time.monotonic()

    def status(self) -> dict[str, Any]:
        """What `node_status` says; any thread may call it."""
        now_s = time.monotonic()
        return node_status(
            self.component,
            self.engine,
            self._antenna.statistics(),
            self._antenna.on(),
            now_s - self._started_s,
            now_s,
        )

    def is_alive(self) -> bool:
        """Whether the node's own thread came to its work lately; to be asked again and again."""
        self._seat.submit(self._beat)
        return time.monotonic() - self._beat_s < ALIVE_WITHIN_S

    def _beat(self, now_s: float) -> None:
        self._beat_s = now_s

    def start(self) -> None:
        """Start the radio and the mesh software; RadioError if the chip does not answer."""
        self.component.start(time.monotonic())  # before the thread, so that errors reach the caller
        self._started = True
        self._seat.submit(lambda _now_s: self._seat.take(self.component))
        self._executor.start()

    def stop(self) -> None:
        """Stop the software and its thread; power the radio down and release it."""
        if self._started:
            self._started = False
            self._antenna.fall_silent()  # remaining sends fail at once
            self._seat.submit(lambda _now_s: self.component.stop())
            self._executor.stop()
            counters = dataclasses.asdict(self._antenna.statistics())
            text = ", ".join(f"{name} {count}" for name, count in counters.items())
            _log.info("node %d: packets: %s", self.radio.node_id, text)
        else:
            if self._internet is not None:
                self._internet.disconnect()
            self.radio.close()
        self.engine.close()


_ABOUT_GATEWAYS = frozenset(
    (MeshEventKind.CONNECTED, MeshEventKind.DISCONNECTED, MeshEventKind.GATEWAY_CHANGED)
)
_WITHOUT_LINE = frozenset((MeshEventKind.NO_ROUTE, MeshEventKind.FLIGHT_ORDERED))


def _log_event(event: MeshEvent) -> None:
    """One line per event; orders have their own lines already."""
    if event.kind in _WITHOUT_LINE:
        return
    words = [event.kind.value]
    if event.peer <= MAX_NODE_ID:
        words.append(f"gateway {event.peer}" if event.kind in _ABOUT_GATEWAYS else str(event.peer))
    if event.detail:
        words.append(f"({event.detail})")
    level = logging.WARNING if event.kind is MeshEventKind.EMERGENCY else logging.INFO
    _log.log(level, "node %d: %s", event.node, " ".join(words))
