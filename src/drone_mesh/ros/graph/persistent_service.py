"""PersistentService: a service client that keeps its connection and never hangs in a call."""

from __future__ import annotations

import io
import select
import socket
import struct
from typing import Generic, Protocol, TypeVar

import rosgraph
import rospy
from genpy import Message
from rospy.exceptions import TransportInitError
from rospy.impl.tcpros_base import TCPROSTransport
from rospy.impl.tcpros_service import TCPROSServiceClient
from rospy.impl.validators import ParameterInvalid

from drone_mesh.errors import MeshError

CALL_TIMEOUT_S = 2  # our choice: wall seconds without an answer until a service is gone
SINGLE_CALL_TIMEOUT_S = 10  # the same for `call_once`: the DroneManager may wait for a gateway
_READ_BYTES = 4096  # more than any answer here
# TCPROS (wiki.ros.org/ROS/TCPROS): a request is its length and its fields. An answer has a status
# byte first; after status 0 an error text follows in place of the fields.
_REQUEST_HEAD = struct.Struct("<I")
_ANSWER_HEAD = struct.Struct("<BI")
_PREFIX = "service cannot process request: "  # rospy prepends this to the service's own text


class ServiceGone(MeshError):
    """The service does not answer. The connection is closed; connect() tries again."""


class ServiceRefused(MeshError):
    """The service answered with an error; the message is its text."""


Request = TypeVar("Request", bound=Message)
Response = TypeVar("Response", bound=Message)


class ServiceClass(Protocol[Request, Response]):
    """The class that genpy generates from a .srv file."""

    _request_class: type[Request]
    _response_class: type[Response]


class PersistentService(Generic[Request, Response]):
    """One connection to one service.

    rospy makes the connection, this class the calls: those of rospy's ServiceProxy have no timeout,
    report a lost connection only as text, and cost three times as much.

    A thread other than the caller of `call` may use `connect` and `close`, but not during a call.
    """

    def __init__(
        self,
        name: str,
        service_class: ServiceClass[Request, Response],
        timeout_s: int = CALL_TIMEOUT_S,
    ) -> None:
        """`timeout_s`: whole wall seconds to wait for an answer."""
        self.name = rospy.resolve_name(name)
        self._timeval = struct.pack("@ll", timeout_s, 0)
        self._response_class = service_class._response_class
        self._protocol = TCPROSServiceClient(self.name, service_class, headers={"persistent": "1"})
        self._transport: TCPROSTransport | None = None

    def is_connected(self) -> bool:
        """Whether there is a connection that the other end has not closed. Any thread."""
        transport = self._transport
        connection = None if transport is None else transport.socket
        if connection is None or connection.fileno() < 0:
            return False
        poller = select.poll()
        poller.register(connection.fileno(), select.POLLRDHUP)
        return not poller.poll(0)  # POLLHUP and POLLERR are always reported

    @property
    def server(self) -> str:
        """The name of the node that offers the service; empty if unknown or not connected."""
        return "" if self._transport is None else self._transport.header.get("callerid", "")

    def connect(self) -> None:
        """Look the service up and connect. Raises ServiceGone."""
        self.close()
        try:
            uri = rosgraph.Master(rospy.get_name()).lookupService(self.name)
            host, port = rospy.core.parse_rosrpc_uri(uri)
            transport = TCPROSTransport(self._protocol, self.name)
            transport.connect(host, port, uri)
            for option in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):
                transport.socket.setsockopt(socket.SOL_SOCKET, option, self._timeval)
        except (rosgraph.MasterException, TransportInitError, ParameterInvalid, OSError) as error:
            raise ServiceGone(f"{self.name}: {error}") from error
        self._transport = transport

    def call(self, request: Request) -> Response:
        """Send a request and wait for the answer. Raises ServiceGone and ServiceRefused."""
        fields = io.BytesIO()
        request.serialize(fields)
        return self._response_class().deserialize(self.call_bytes(fields.getvalue()))

    def call_bytes(self, fields: bytes) -> bytes:
        """Like `call`, with the fields of request and answer as ROS serialises them."""
        transport = self._transport
        if transport is None:
            raise ServiceGone(f"{self.name}: not connected")
        try:
            transport.socket.sendall(_REQUEST_HEAD.pack(len(fields)) + fields)
            ok, answer = self._read_answer(transport.socket)
        # AttributeError: rospy shuts down and closed the connection during the call.
        except (OSError, EOFError, AttributeError) as error:
            self.close()
            raise ServiceGone(f"{self.name}: {error}") from error
        if not ok:
            text = answer.decode("utf-8", "replace")
            raise ServiceRefused(text.replace(_PREFIX, "", 1))
        return answer

    def close(self) -> None:
        """Close the connection, if there is one."""
        transport, self._transport = self._transport, None
        if transport is not None:
            transport.close()

    @staticmethod
    def _read_answer(connection: socket.socket) -> tuple[bool, bytes]:
        data = b""
        end = _ANSWER_HEAD.size
        while len(data) < end:
            part = connection.recv(_READ_BYTES)
            if not part:
                raise EOFError("it closed the connection")
            data += part
            if len(data) >= _ANSWER_HEAD.size:
                ok, length = _ANSWER_HEAD.unpack_from(data)
                end = _ANSWER_HEAD.size + length
        return bool(ok), data[_ANSWER_HEAD.size : end]


def call_once(
    name: str, service_class: ServiceClass[Request, Response], request: Request
) -> Response:
    """Call a service on a connection of its own. Raises ServiceGone and ServiceRefused."""
    service = PersistentService(name, service_class, SINGLE_CALL_TIMEOUT_S)
    try:
        service.connect()
        return service.call(request)
    finally:
        service.close()
