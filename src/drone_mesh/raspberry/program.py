"""Runs raspberry_router and raspberry_gateway, from start to end."""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from types import FrameType
from typing import TYPE_CHECKING, Callable, Iterator, Sequence

from drone_mesh.communication.interfaces import IInternetConnection
from drone_mesh.internet.http_settings import HttpSettings
from drone_mesh.internet.on_demand import http_internet, mqtt_internet, status_server
from drone_mesh.internet.several import SeveralInternets
from drone_mesh.nrf24.gpio import GpiodCe, GpiodIrq
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.nrf24.settings import RadioSettings
from drone_mesh.nrf24.spi import open_spi
from drone_mesh.raspberry.emulated_air import EmulatedAir
from drone_mesh.raspberry.emulated_fleet import EmulatedFleet
from drone_mesh.raspberry.event_history import EventHistory
from drone_mesh.raspberry.mesh_record import MeshRecord
from drone_mesh.raspberry.node import MakeInternet, RadioNode
from drone_mesh.raspberry.node_status import one_line
from drone_mesh.raspberry.options import Hardware, Options
from drone_mesh.raspberry.served_air import MoveRadio, joining_node, node_with_drone, serving_node
from drone_mesh.raspberry.service_manager import ServiceManager
from drone_mesh.stopping import StopRequest
from drone_mesh.users.local_socket import warn_of_unreachable

if TYPE_CHECKING:
    from drone_mesh.internet.status import StatusServer

POLL_PERIOD_S = 0.5  # our choice: how often the main thread checks the nodes
ALIVE_PERIOD_S = 5.0  # our choice: several times in WatchdogSec of the units
STATUS_PERIOD_S = 60.0  # our choice: one line a minute for each node
LONELY_AFTER_S = 15.0  # our choice: one check period and half of the next
LONELY_AGAIN_S = 300.0  # our choice: period of the repeated warning
END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

_log = logging.getLogger(__name__)


def run(parse: Callable[[], Options]) -> int:
    """Run until a signal ends it; returns the exit status."""
    with _signals() as request:
        options = parse()
        logging.basicConfig(
            format="%(asctime)s %(levelname)s %(message)s", level=options.log_level.upper()
        )
        _run(options, request)
    return 0


@contextlib.contextmanager
def _signals() -> Iterator[StopRequest]:
    """A stop request set by Ctrl-C, TERM or HUP; a second signal ends the program at once."""
    with StopRequest() as request:

        def end(number: int, _frame: FrameType | None) -> None:
            request.make()
            signal.signal(number, signal.SIG_DFL)

        before = {number: signal.signal(number, end) for number in END_SIGNALS}
        try:
            yield request
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


class _DebugSwitch:
    """The signal USR1 begins and ends the lines of --debug, within POLL_PERIOD_S."""

    def __init__(self) -> None:
        self.pressed = False

    def __enter__(self) -> _DebugSwitch:
        self._before = signal.signal(signal.SIGUSR1, self._press)
        return self

    def __exit__(self, *_error: object) -> None:
        signal.signal(signal.SIGUSR1, self._before)

    def _press(self, _number: int, _frame: FrameType | None) -> None:
        self.pressed = not self.pressed


def _run(options: Options, request: StopRequest) -> None:
    with contextlib.ExitStack() as stack:
        move_radios: MoveRadio = _stay
        if options.emulated:
            fleet = _emulated_fleet(options, stack)
            nodes, move_radios = _emulated_nodes(options, fleet), fleet.move_radios
        elif options.air.join is not None:
            node, move_radios = joining_node(options, options.air.join, _orders(options))
            nodes = [node]
        elif options.air.serve is not None:
            air = EmulatedAir(options.radio, 1, options.trace)
            stack.callback(air.close)
            node, move_radios = serving_node(options, air, options.air.serve, _orders(options))
            nodes = [node]
        else:
            nodes = [_real_node(options)]
        stack.callback(_stop, nodes)
        warn_of_unreachable(
            {node.radio.node_id: node.why_no_socket for node in nodes if node.why_no_socket}
        )
        if options.keys is None:
            _log.warning(
                "no key: every radio in range can take part in this mesh and order its drones to "
                "fly; raspberry_key new makes a key, --key-file uses it"
            )
        if not options.gateway and options.http is not None:
            server = _status_server(nodes[0], options.http)
            server.start()
            stack.callback(server.stop)
        record: MeshRecord | None = None
        if options.record is not None:
            record = MeshRecord(options.record, nodes[0].submit, nodes[0].mesh)
            stack.callback(record.close)
        switch = stack.enter_context(_DebugSwitch())  # first: without it, USR1 ends the program
        for node in nodes:
            node.start()
        manager = ServiceManager()
        manager.ready()
        watch = _Watch(nodes, options, manager)
        while not request.wait(POLL_PERIOD_S):
            watch.check(time.monotonic())
            if record is not None:
                record.check(time.monotonic())
            for node in nodes:
                node.check_others()
                if switch.pressed:
                    node.switch_debug()
            switch.pressed = False
            move_radios()
        manager.stopping()
        _log.info("stopping")


def _stop(nodes: Sequence[RadioNode]) -> None:
    """Stop all nodes in parallel; one by one, each would still call nodes that have stopped."""
    with ThreadPoolExecutor(len(nodes)) as pool:
        for stopped in [pool.submit(node.stop) for node in nodes]:
            stopped.result()


def _real_node(options: Options) -> RadioNode:
    radio = _open_radio(options.node_id, options.hardware, options.radio)
    node = node_with_drone(radio, options, options.location, _orders(options))
    hardware = options.hardware
    _log.info(
        "node %d: nRF24L01+ on SPI %d.%d, CE on GPIO%d, %s; channel %d, %d kbit/s, CRC %d bit",
        options.node_id,
        *hardware.spi,
        hardware.ce_gpio,
        "polled" if hardware.irq_gpio is None else f"IRQ on GPIO{hardware.irq_gpio}",
        options.radio.channel,
        options.radio.data_rate.value // 1000,
        options.radio.crc_bytes * 8,
    )
    return node


def _open_radio(
    node_id: int, hardware: Hardware, settings: RadioSettings
) -> NRF24LowLevelInterface:
    with contextlib.ExitStack() as opened:
        spi = open_spi(*hardware.spi, hardware.spi_hz)
        opened.callback(spi.close)
        ce = GpiodCe(hardware.ce_gpio)
        opened.callback(ce.close)
        irq = None if hardware.irq_gpio is None else GpiodIrq(hardware.irq_gpio)
        opened.pop_all()
    return NRF24LowLevelInterface(spi, ce, irq, node_id=node_id, settings=settings)


def _emulated_fleet(options: Options, stack: contextlib.ExitStack) -> EmulatedFleet:
    air = EmulatedAir(options.radio, options.emulated, options.trace)
    stack.callback(air.close)
    fleet = EmulatedFleet(options.fleet, options.flight, air)
    stack.callback(fleet.close)
    return fleet


def _emulated_nodes(options: Options, fleet: EmulatedFleet) -> list[RadioNode]:
    _log.info("%d nodes on emulated radios; node 0 is the gateway", options.emulated)
    options = dataclasses.replace(
        options, flight=dataclasses.replace(options.flight, origin=fleet.origin)
    )
    events = EventHistory()
    make_internet = _orders(options) or without_internet
    return [
        RadioNode(
            fleet.air.radio(node_id, options.radio),
            fleet.engine(node_id),
            options,
            None if node_id else make_internet,
            events,
        )
        for node_id in range(options.emulated)
    ]


def _stay() -> None:
    """Does nothing: real radios move with their drones."""


def _orders(options: Options) -> MakeInternet | None:
    """How a gateway receives orders; None for a router."""
    return _internet(options) if options.gateway else None


def _internet(options: Options) -> MakeInternet:
    http, mqtt = options.http, options.mqtt

    def make(node: RadioNode) -> IInternetConnection:
        connections: list[IInternetConnection] = []
        if mqtt is not None:
            to_broker = mqtt_internet(
                node.submit,
                node.users,
                mqtt.broker,
                ca_file=mqtt.ca_file,
                is_internet=mqtt.is_internet,
            )
            node.events.others.add(to_broker.observe)
            connections.append(to_broker)
        if http is not None:
            connections.append(_http(node, http, options))
        return SeveralInternets(*connections)

    return make


def _http(node: RadioNode, http: HttpSettings, options: Options) -> IInternetConnection:
    return http_internet(
        node.submit,
        http,
        origin=options.flight.origin,
        status=node.status,
        mesh=node.mesh,
        users=node.users,
        silence_s=options.silence_s,
    )


def _status_server(node: RadioNode, http: HttpSettings) -> StatusServer:
    server = status_server(node.status, http)
    _log.info("node %d: its status over HTTP at %s/status", node.radio.node_id, server.url)
    return server


def without_internet(_node: RadioNode) -> IInternetConnection:
    """For a gateway that receives no orders."""
    return SeveralInternets()


class _Watch:
    """Logs the progress of the nodes."""

    def __init__(
        self, nodes: Sequence[RadioNode], options: Options, manager: ServiceManager
    ) -> None:
        self._nodes = nodes
        self._manager = manager
        self._alive_at_s = time.monotonic()
        self._status_at_s = self._alive_at_s + STATUS_PERIOD_S
        self._options = options
        self._connected = -1
        self._started_s = time.monotonic()
        self._lonely_at_s = self._started_s + LONELY_AFTER_S

    def check(self, now_s: float) -> None:
        """Log what has changed; to be called periodically."""
        self._log_status(now_s)
        if len(self._nodes) > 1:
            self._count_connected(now_s)
        elif self._nodes[0].component.get_neighbours():
            self._lonely_at_s = now_s + LONELY_AFTER_S
        elif now_s >= self._lonely_at_s:
            self._lonely_at_s = now_s + LONELY_AGAIN_S
            _log.warning(
                "node %d hears no other node: are others on and in range, with the same channel, "
                "rate and CRC?",
                self._options.node_id,
            )

    def _log_status(self, now_s: float) -> None:
        if now_s >= self._alive_at_s:
            self._alive_at_s = now_s + ALIVE_PERIOD_S
            alive = [node.is_alive() for node in self._nodes]
            if all(alive):
                self._manager.alive(one_line(self._nodes[0].status()))
        if now_s >= self._status_at_s:
            self._status_at_s = now_s + STATUS_PERIOD_S
            for node in self._nodes:
                status = node.status()
                _log.info("node %d: %s", status["node"], one_line(status))

    def _count_connected(self, now_s: float) -> None:
        components = [node.component for node in self._nodes]
        connected = sum(component.get_connected_to_gateway() for component in components)
        if connected == self._connected:
            return
        self._connected = connected
        if connected < len(components):
            _log.info("%d of %d nodes are connected", connected, len(components))
            return
        hops = " ".join(f"{c.get_node_id()}:{c.get_hops_from_gateway_away()}" for c in components)
        _log.info(
            "all %d nodes are connected after %.1f s; hops to the gateway: %s",
            len(components),
            now_s - self._started_s,
            hops,
        )
