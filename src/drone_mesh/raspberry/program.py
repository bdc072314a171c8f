"""The programs raspberry_router and raspberry_gateway, from start to end."""

from __future__ import annotations

import contextlib
import logging
import signal
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from types import FrameType
from typing import Callable, Iterable, Iterator, Sequence

from drone_mesh.communication.interfaces import IInternetConnection
from drone_mesh.drone.engines import create_engine
from drone_mesh.ground_station.settings import NO_STATIONS
from drone_mesh.internet.on_demand import (
    SeveralInternets,
    http_internet,
    mqtt_internet,
    status_server,
)
from drone_mesh.nrf24.low_level import NRF24LowLevelInterface
from drone_mesh.raspberry.drone_check import check_drone
from drone_mesh.raspberry.emulated_air import (
    EmulatedAir,
    joining_node,
    node_with_drone,
    serving_node,
)
from drone_mesh.raspberry.mesh_record import MeshRecord
from drone_mesh.raspberry.node import MakeInternet, RadioNode
from drone_mesh.raspberry.node_events import EventHistory
from drone_mesh.raspberry.node_reports import one_line
from drone_mesh.raspberry.options import CHECK_DRONE, Options, parse_gateway, parse_router
from drone_mesh.raspberry.service_manager import ServiceManager
from drone_mesh.stopping import StopRequest, ends_as
from drone_mesh.users.local_socket import warn_of_unreachable

POLL_PERIOD_S = 0.5  # how often the main thread checks the nodes
ALIVE_PERIOD_S = 5.0  # several times in WatchdogSec of the units
STATUS_PERIOD_S = 60.0  # one line a minute for each node
LONELY_AFTER_S = 15.0  # one check period and half of the next
LONELY_AGAIN_S = 300.0  # period of the repeated warning
END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

_log = logging.getLogger(__name__)


@ends_as("raspberry_router")
def router() -> int:
    """Run until Ctrl-C or SIGTERM, or check the drone; the exit status."""
    if sys.argv[-1] != CHECK_DRONE:
        return run(parse_router)
    return check_drone(parse_router(sys.argv[1:-1]))


@ends_as("raspberry_gateway")
def gateway() -> int:
    """Run until Ctrl-C or SIGTERM; the exit status."""
    return run(parse_gateway)


def run(parse: Callable[[], Options]) -> int:
    """Run until a signal ends it, a second one at once; returns the exit status."""
    with StopRequest() as request:

        def end(number: int, _frame: FrameType | None) -> None:
            request.make()
            signal.signal(number, signal.SIG_DFL)

        with _handling(END_SIGNALS, end):
            options = parse()
            logging.basicConfig(
                format="%(asctime)s %(levelname)s %(message)s", level=options.log_level.upper()
            )
            _run(options, request)
    return 0


@contextlib.contextmanager
def _handling(
    numbers: Iterable[signal.Signals], handler: Callable[[int, FrameType | None], None]
) -> Iterator[None]:
    """Let this function handle these signals; at the end they are handled as before."""
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


class _DebugSwitch:
    """The signal USR1 begins and ends the lines of --debug, within POLL_PERIOD_S."""

    pressed = False

    def press(self, _number: int, _frame: FrameType | None) -> None:
        """Switch once more; two presses within one period of the check cancel each other."""
        self.pressed = not self.pressed


def _run(options: Options, request: StopRequest) -> None:
    with contextlib.ExitStack() as stack:
        if options.emulated:
            nodes = _emulated_nodes(options, stack)
        elif options.air.join is not None:
            nodes = [joining_node(options, options.air.join, _orders(options))]
        elif options.air.serve is not None:
            air = EmulatedAir(options.radio, 1, options.trace)
            stack.callback(air.close)
            nodes = [serving_node(options, air, options.air.serve, _orders(options))]
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
            server = status_server(nodes[0].status, options.http)
            _log.info("node %d: its status over HTTP at %s/status", options.node_id, server.url)
            server.start()
            stack.callback(server.stop)
        record: MeshRecord | None = None
        if options.record is not None:
            record = MeshRecord(options.record, nodes[0].submit, nodes[0].mesh)
            stack.callback(record.close)
        switch = _DebugSwitch()  # first: without it, USR1 ends the program
        stack.enter_context(_handling([signal.SIGUSR1], switch.press))
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
                node.move_radio()
                if switch.pressed:
                    node.switch_debug()
            switch.pressed = False
        manager.stopping()
        _log.info("stopping")


def _stop(nodes: Sequence[RadioNode]) -> None:
    """Stop all nodes in parallel; one by one, each would still call nodes that have stopped."""
    with ThreadPoolExecutor(len(nodes)) as pool:
        for stopped in [pool.submit(node.stop) for node in nodes]:
            stopped.result()


def _real_node(options: Options) -> RadioNode:
    hardware = options.hardware
    radio = NRF24LowLevelInterface(
        *hardware.open(), node_id=options.node_id, settings=options.radio
    )
    node = node_with_drone(radio, options, options.location, _orders(options))
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


def _emulated_nodes(options: Options, stack: contextlib.ExitStack) -> list[RadioNode]:
    air = EmulatedAir(options.radio, options.emulated, options.trace)
    stack.callback(air.close)
    _log.info("%d nodes on emulated radios; node 0 is the gateway", options.emulated)
    events = EventHistory()
    make_internet = _orders(options) or without_internet
    return [
        RadioNode(
            air.radio(node_id, options.radio),
            create_engine(node_id, air.place(node_id), options.flight),
            options,
            None if node_id else make_internet,
            events,
            partial(air.move, node_id),
        )
        for node_id in range(options.emulated)
    ]


def _orders(options: Options) -> MakeInternet | None:
    """How a gateway receives orders; None for a router."""
    return partial(_internet, options) if options.gateway else None


def _internet(options: Options, node: RadioNode) -> IInternetConnection:
    http, mqtt = options.http, options.mqtt
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
        over_http = http_internet(
            node.submit,
            http,
            origin=options.flight.origin,
            status=node.status,
            mesh=node.mesh,
            users=node.users,
            silence_s=options.silence_s,
        )
        connections.append(over_http)
    if options.ground_station != NO_STATIONS:
        # Only here: pymavlink takes most of a second to load.
        from drone_mesh.ground_station.gateway_link import GatewayLink

        timing = options.mesh.timing
        link = GatewayLink(
            options.ground_station,
            options.flight.origin,
            max(timing.check_period_s, timing.report_period_s),
            node.engine,
            node.submit,
            node.call_every,
        )
        node.events.others.add(link.observe)
        connections.append(link)
    return SeveralInternets(*connections)


def without_internet(_node: RadioNode) -> IInternetConnection:
    """The internet connection of a gateway that receives no orders: none."""
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
