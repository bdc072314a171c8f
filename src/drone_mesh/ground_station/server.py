"""GroundStationServer: the sockets of ground stations, and the thread that serves them."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import hmac
import logging
import math
import queue
import select
import socket
import threading
import time
from typing import Any, Callable, Iterable, Iterator

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.communication.timing import Throttle
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError
from drone_mesh.execution import FAILURE_PERIOD_S
from drone_mesh.ground_station.cursor_on_target import event_of
from drone_mesh.ground_station.reports import COMPONENT, Fleet, Message
from drone_mesh.ground_station.requests import Desk, OrderDrone
from drone_mesh.ground_station.settings import Address, GroundStationSettings
from drone_mesh.ground_station.vehicles import PROOF_PERIODS, Vehicle
from drone_mesh.state.model import EventRecord
from drone_mesh.web.access import Allowance

ROUND_S, IDLE_S = 0.02, 0.1  # between two readings at least, and at most
MOST_BYTES = 4096  # of one station in a round; to read noise takes 1.2 ms then
LEAST_BYTES = 128  # as which a shorter datagram counts
LONGEST_BYTES = 280  # of a signed message, MAVLink 2
MAGIC = b"\xfd", b"\xfe"  # of MAVLink 2 and 1; a page in a browser begins with HTTP
MOST_NOISE = 2000  # pieces of a TCP connection that are no message; then it is closed
MOST_STATIONS = 8  # over TCP
MESSAGES = 3000, 0.01  # at once, which is what 254 vehicles are asked at first; then one per period
ORDERS = 300, 0.05  # as over HTTP
OLD_VIEW_S = 3.0  # wall: without news of the mesh for so long, nothing is told
COT_AGAIN_S = 10  # period of an unchanged event, for those who begin to listen
_SIGNING_BEGAN_S = 1420070400  # 2015-01-01, MAVLink 2 "Message Signing"
_UNITS_PER_S = 100_000

_log = logging.getLogger(__name__)
logging.getLogger(mavlink.__name__).setLevel(logging.WARNING)  # it tells of each old signature


class _Codec(mavlink.MAVLink):  # type: ignore[misc]
    """Checks a signature before its time counts, or else strangers could move that forwards."""

    def check_signature(self, packet: bytearray, system: int, component: int) -> bool:
        digest = hashlib.sha256(self.signing.secret_key + packet[:-6]).digest()[:6]
        is_right = hmac.compare_digest(digest, bytes(packet[-6:]))
        return is_right and bool(super().check_signature(packet, system, component))


class _Station:
    """One ground station: at `peer` over UDP, or None: a TCP connection."""

    def __init__(self, sock: socket.socket, peer: tuple[str, int] | None, signing: Any) -> None:
        self.socket, self.peer = sock, peer
        self._codec = _Codec(None, 0, COMPONENT)
        self._codec.robust_parsing = True
        if signing is not None:
            self._codec.signing = signing  # one for all: a packet counts once
        self._numbers: dict[int, int] = {}  # by node, of its next message
        self._noise, self._begins = 0, True
        self._limit = Allowance(*MESSAGES)

    def send(self, node: int, message: Message) -> None:
        """Send a message of this node. Raises OSError: a connection is over."""
        codec = self._codec
        codec.srcSystem, codec.seq = node + 1, self._numbers.get(node, 0)
        self._numbers[node] = (codec.seq + 1) % 256
        packet = message.pack(codec)
        if self.peer is None:
            if self.socket.send(packet) < len(packet):
                raise BlockingIOError("it does not read")
            return
        with contextlib.suppress(OSError):  # nobody listens now, or the network is full
            self.socket.sendto(packet, self.peer)

    def receive(self) -> Iterator[Message]:
        """What has come, up to the limits of one round. Raises OSError: a connection is over."""
        if self.peer is None:
            data = self.socket.recv(MOST_BYTES)
            if self._begins and data and not data.startswith(MAGIC):
                raise ConnectionError("it does not begin with MAVLink")
            self._begins = False
            yield from self._read(data)
            if not data or self._noise > MOST_NOISE:
                raise ConnectionError("it sends noise" if data else "it closed the connection")
            return
        size = 0
        with contextlib.suppress(OSError):  # nothing is left, or nobody listened there before
            while size < MOST_BYTES:
                data, sender = self.socket.recvfrom(MOST_BYTES)
                size += max(len(data), LEAST_BYTES)
                if sender == self.peer:
                    yield from self._read(data)
                    if self._codec.buf_len():  # cut off; the next one begins a message
                        self._codec.parse_buffer(bytes(LONGEST_BYTES))

    def _read(self, data: bytes) -> Iterator[Message]:
        for message in self._codec.parse_buffer(data) or ():
            if message.get_type() == "BAD_DATA":
                self._noise += 1
            elif not self._limit.is_over():
                self._limit.note()
                yield message


class GroundStationServer:
    """Its thread owns sockets, fleet and desk. Any thread may call `show` and `tell`."""

    def __init__(
        self,
        settings: GroundStationSettings,
        origin: Origin | None,
        period_s: float,
        order: OrderDrone,
    ) -> None:
        """Open the sockets. A node is heard at least every `period_s` of the mesh's clock.

        Raises ConfigurationError for an address that is not available.
        """
        if settings.cot and origin is None:
            raise ConfigurationError("--cot needs an origin (--origin): it has places in degrees")
        self._settings, self._origin = settings, origin
        self._period_s, self._order = period_s, order
        self._work: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._seen_s = -math.inf  # wall, when the mesh was last shown
        self._fleet = Fleet(origin, PROOF_PERIODS * period_s, settings.may_order)
        self._desk = Desk(self._fleet, self._order_later, self._post, Allowance(*ORDERS))
        self._signing: Any = None
        if settings.key is not None:
            self._signing = mavlink.MAVLinkSigning()
            self._signing.secret_key, self._signing.sign_outgoing = settings.key, True
            self._signing.timestamp = _signing_time()
        self._cot = [(_udp_socket(), _numeric(address)) for address in settings.cot]
        self._cot_told: dict[int, float] = {}  # by node: of which place
        self._listeners = [_listener(one) for one in settings.stations if one.kind == "tcp"]
        self._stations = [
            _Station(_udp_socket(), _numeric(one), self._signing)
            for one in settings.stations
            if one.kind == "udp"
        ]
        self._second, self._due_s = 0, time.monotonic()
        self._failures = Throttle(FAILURE_PERIOD_S)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ground stations")

    def start(self) -> None:
        """Start its thread."""
        self._thread.start()
        may = "may order" if self._settings.may_order else "may only look"
        for address in self._settings.stations:
            _log.info("ground stations at %s:%s:%d %s", *address, may)

    def stop(self) -> None:
        """End the thread, and close all sockets."""
        self._ended.set()
        if self._thread.ident is not None:
            self._thread.join()
        stations = [station.socket for station in self._stations]
        for sock in (*stations, *self._listeners, *(sock for sock, _to in self._cot)):
            sock.close()

    def show(self, vehicles: Iterable[Vehicle], now_s: float) -> None:
        """The fleet now, with times of the mesh's clock; about once a second."""
        self._work.put(functools.partial(self._show, list(vehicles), now_s))

    def tell(self, event: EventRecord) -> None:
        self._work.put(functools.partial(self._tell, event))

    # Its thread ------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._ended.wait(ROUND_S):
            try:
                self._round()
            except Exception as error:  # of one message: the others must not wait for ever
                if self._failures.count(type(error).__name__, time.monotonic()):
                    _log.exception("ground stations")

    def _round(self) -> None:
        while not self._work.empty():
            self._work.get()()
        if time.monotonic() >= self._due_s:
            self._due_s = max(self._due_s + 1.0, time.monotonic())
            self._second += 1
            self._every_second()
        sources = {station.socket: station for station in self._stations}
        for sock in select.select([*sources, *self._listeners], [], [], IDLE_S)[0]:
            if sock in sources:
                self._receive(sources[sock])
            else:
                self._accept(sock)

    def _show(self, vehicles: list[Vehicle], now_s: float) -> None:
        self._seen_s = time.monotonic()
        self._fleet.show(vehicles, now_s)

    def _tell(self, event: EventRecord) -> None:
        self._desk.event(event)
        for told in self._fleet.event(event):
            self._post(*told, None)

    def _every_second(self) -> None:
        if self._signing is not None:  # its clock would stand still between two messages
            self._signing.timestamp = max(self._signing.timestamp, _signing_time())
        if time.monotonic() - self._seen_s > OLD_VIEW_S:
            self._fleet.show((), self._fleet.now_s)  # answers and orders end, too
            return
        for told in self._fleet.every_second(self._second) if self._stations else ():
            self._post(*told, None)
        for vehicle in self._fleet.all_alive() if self._cot else ():
            is_new = self._cot_told.get(vehicle.node) != vehicle.place_s
            if is_new or (self._second + vehicle.node) % COT_AGAIN_S == 0:
                self._cot_told[vehicle.node] = vehicle.place_s
                self._point(vehicle)

    def _point(self, vehicle: Vehicle) -> None:
        assert self._origin is not None
        now = self._fleet.now_s, time.time()
        event = event_of(vehicle, self._origin, *now, self._period_s)
        for sock, to in self._cot if event else ():
            with contextlib.suppress(OSError):  # nobody listens now, or there is no network
                sock.sendto(event, to)

    def _order_later(self, node: int, goal: Location, answer: Callable[[str], None]) -> None:
        self._order(node, goal, lambda why: self._work.put(functools.partial(answer, why)))

    def _post(self, node: int, message: Message, station: object) -> None:
        for one in list(self._stations):
            if station in (None, one):
                try:
                    one.send(node, message)
                except OSError as error:
                    self._close(one, error)

    def _receive(self, station: _Station) -> None:
        try:
            for message in station.receive():
                self._desk.received(message, station)
        except OSError as error:
            self._close(station, error)

    def _accept(self, listener: socket.socket) -> None:
        with contextlib.suppress(OSError):  # it has gone again
            sock, peer = listener.accept()
            if sum(station.peer is None for station in self._stations) >= MOST_STATIONS:
                sock.close()
                return
            sock.setblocking(False)
            self._stations.append(_Station(sock, None, self._signing))
            _log.info("ground station at %s:%d: connected", *peer[:2])

    def _close(self, station: _Station, why: OSError) -> None:
        if station in self._stations:
            self._stations.remove(station)
            station.socket.close()
            _log.info("ground station over TCP: disconnected: %s", why)


def _signing_time() -> int:
    return int((time.time() - _SIGNING_BEGAN_S) * _UNITS_PER_S)


def _numeric(address: Address) -> tuple[str, int]:
    """Where datagrams go to, and come from. Raises ConfigurationError."""
    try:
        return socket.gethostbyname(address.host), address.port
    except OSError as error:
        raise ConfigurationError(f"{address.host}: {error.strerror}") from error


def _udp_socket() -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
    sock.setblocking(False)
    return sock


def _listener(address: Address) -> socket.socket:
    try:
        listener = socket.create_server((address.host, address.port))
    except OSError as error:
        where = f"tcp:{address.host}:{address.port}"
        raise ConfigurationError(f"--ground-station {where}: {error.strerror}") from error
    listener.setblocking(False)
    return listener
