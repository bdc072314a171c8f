"""One node of the mesh: radio, drone, software and thread."""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import random
import secrets
import time
from typing import Any, Callable

from drone_mesh.channel.antenna import DEBUG_PERIOD_S
from drone_mesh.communication.interfaces import IInternetConnection
from drone_mesh.communication.node.assembly import Security, assemble_node
from drone_mesh.communication.node.gateway import MeshnetworkGateway
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError, LocationUnknown
from drone_mesh.execution import MeshExecutor, Work
from drone_mesh.nrf24.high_level import NRF24HighLevelInterface
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.raspberry.node_events import EventHistory, NodeChanges
from drone_mesh.raspberry.node_reports import mesh_report, node_status
from drone_mesh.raspberry.options import Options
from drone_mesh.users.desk import UsersDesk
from drone_mesh.users.local_client import socket_path
from drone_mesh.users.local_socket import LocalSocket

ALIVE_WITHIN_S = 20.0  # two check periods, shorter than WatchdogSec of the units

_log = logging.getLogger(__name__)

MakeInternet = Callable[["RadioNode"], IInternetConnection]
"""Creates the internet connection of a gateway, before the node has its component."""


class RadioNode:
    """A router, or a gateway if it has an internet connection. For one thread at a time.

    From start to stop, the node's own thread runs the component.
    """

    def __init__(
        self,
        radio: NRF24LowLevelInterface,
        engine: IDroneEngine,
        options: Options,
        make_internet: MakeInternet | None = None,
        events: EventHistory | None = None,
        move: Callable[[Location], None] | None = None,
    ) -> None:
        """Takes ownership of radio and engine. Raises what `make_internet` raises.

        `events` is shared by the nodes of one program: each reports its own events. Without it, a
        gateway derives the events of its routers from their packets. `move` moves an emulated
        radio; a real one moves with its drone.
        """
        self.radio = radio
        self.engine = engine
        self._move = move
        self._executor = MeshExecutor(time.monotonic, False, name=f"mesh {radio.node_id}")
        self._slot = self._executor.slot()
        self._antenna = NRF24HighLevelInterface(
            radio, self._slot.submit, debug_period_s=options.debug_period_s or DEBUG_PERIOD_S
        )
        self._origin = options.flight.origin
        self.events = EventHistory() if events is None else events
        self._changes: NodeChanges | None = None
        if make_internet is not None and events is None:  # the others run in other programs
            check_s = options.mesh.timing.check_period_s
            self._changes = NodeChanges(radio.node_id, check_s, self.events.observe)
        self.users = UsersDesk(radio.node_id, self._slot.submit)
        self._socket: LocalSocket | None = None
        self.why_no_socket = ""  # why mesh_ping and the other commands cannot reach this node
        try:
            self._socket = LocalSocket(self.users, socket_path(radio.node_id))
        except ConfigurationError as error:
            self.why_no_socket = str(error)
        self._internet = None if make_internet is None else make_internet(self)
        self.component, _receiver = assemble_node(
            radio.node_id,
            self._antenna,
            engine,
            random.Random(),
            options.mesh,
            internet=self._internet,
            security=None if options.keys is None else Security(options.keys, time.monotonic),
            observer=self.events.observe,
            debug=options.debug_period_s > 0.0,
        )
        self.users.open(self.component.data)
        self._started = False
        self._run = secrets.token_hex(8)  # tells this start of the node from others
        self._started_s = self._beat_s = time.monotonic()

    def submit(self, work: Work) -> None:
        """Run this soon on the node's own thread. Any thread."""
        self._slot.submit(work)

    def call_every(self, period_s: float, work: Work) -> Callable[[], None]:
        """Run this once per period on the node's own thread; returns what ends that."""
        return self._slot.call_every(period_s, work)

    def mesh(self, after: int) -> dict[str, Any]:
        """A gateway's `mesh_report`, with the events after this number; for the node's thread."""
        component, now_s = self.component, time.monotonic()
        assert isinstance(component, MeshnetworkGateway)
        report = mesh_report(component, self.engine, self._antenna.on(), self._origin, now_s)
        return {
            **report,
            "run": self._run,
            "uptime_s": round(now_s - self._started_s, 2),
            "events": self.events.since(after, self._started_s),
        }

    def switch_debug(self) -> None:
        """Begin or end the lines of --debug. Any thread."""
        self._slot.submit(lambda _now_s: self.component.switch_debug())

    def check_others(self) -> None:
        """Have a gateway report changes at its routers; to be called periodically."""
        if self._changes is not None:
            self._slot.submit(self._note_changes)

    def move_radio(self) -> None:
        """Have an emulated radio follow its drone; to be called periodically."""
        if self._move is not None:
            with contextlib.suppress(LocationUnknown):
                self._move(self.engine.get_location())

    def _note_changes(self, now_s: float) -> None:
        component = self.component
        assert self._changes is not None
        assert isinstance(component, MeshnetworkGateway)
        self._changes.compare(component.get_known_nodes(), component.get_node_reports(), now_s)

    def status(self) -> dict[str, Any]:
        """The result of `node_status`; any thread may call it."""
        now_s = time.monotonic()
        return node_status(
            self.component, self.engine, self._antenna, now_s - self._started_s, now_s
        )

    def is_alive(self) -> bool:
        """Whether the node's own thread has run recently; to be called repeatedly."""
        self._slot.submit(self._beat)
        return time.monotonic() - self._beat_s < ALIVE_WITHIN_S

    def _beat(self, now_s: float) -> None:
        self._beat_s = now_s

    def start(self) -> None:
        """Start the radio and the mesh software; RadioError if the chip does not answer."""
        self.component.start(time.monotonic())  # before the thread, so that errors reach the caller
        self._started = True
        self._slot.submit(lambda _now_s: self._slot.drive(self.component))
        self._executor.start()
        if self._socket is not None:
            self._socket.start()

    def stop(self) -> None:
        """Stop the software and its thread; power the radio down and release it."""
        if self._socket is not None:
            self._socket.stop()
        if self._started:
            self._started = False
            self._antenna.fall_silent()  # remaining sends fail at once
            self._slot.submit(lambda _now_s: self.component.stop())
            self._executor.stop()
            counters = dataclasses.asdict(self._antenna.statistics())
            text = ", ".join(f"{name} {round(count, 3)}" for name, count in counters.items())
            _log.info("node %d: packets: %s", self.radio.node_id, text)
        else:
            if self._internet is not None:
                self._internet.disconnect()
            self.radio.close()
        self.engine.close()
