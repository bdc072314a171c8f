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
from rosgraph.network import (
    ROSHandshakeException,
    read_ros_handshake_header,
    write_ros_handshake_header,
)
from rospy.impl.validators import ParameterInvalid

from drone_mesh.errors import MeshError
from drone_mesh.ros.graph.master import NO_ANSWER, bounded_master

CALL_TIMEOUT_S = 2  # wall seconds without an answer until a service is gone
SINGLE_CALL_TIMEOUT_S = 10  # the same for `call_once`: the DroneManager may wait for a gateway
_READ_BYTES = 4096  # more than any answer here
# TCPROS (wiki.ros.org/ROS/TCPROS): a request is its length and its fields. An answer has a status
# byte first; after status 0 an error text follows in place of the fields.
_REQUEST_HEAD = struct.Struct("<I")
_ANSWER_HEAD = struct.Struct("<BI")
_PREFIX = "service cannot process request: "  # rospy prepends this to the service's own text


class ServiceGone(MeshError):
    """The service does not answer. The connection is closed; connect() tries again."""


class ServiceSilent(ServiceGone):
    """The process of the service, or the master, is there and does not answer."""


class ServiceUnknown(ServiceGone):
    """Nobody offers the service."""


class ServiceRefused(MeshError):
    """The service answered with an error; the message is its text."""


Request = TypeVar("Request", bound=Message)
Response = TypeVar("Response", bound=Message)


class ServiceClass(Protocol[Request, Response]):
    """The class that genpy generates from a .srv file."""

    _md5sum: str
    _request_class: type[Request]
    _response_class: type[Response]


class PersistentService(Generic[Request, Response]):
    """One connection to one service.

    Connecting and calls end after a time. Those of rospy's ServiceProxy do not; they also report a
    lost connection only as text, and cost three times as much.

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
        self._timeout_s = timeout_s
        self._response_class = service_class._response_class
        self._md5sum = service_class._md5sum
        self._connection: socket.socket | None = None
        self.server = ""  # the name of the node that offers it; empty if unknown

    def is_connected(self) -> bool:
        """Whether there is a connection that the other end has not closed. Any thread."""
        connection = self._connection
        if connection is None or connection.fileno() < 0:
            return False
        poller = select.poll()
        poller.register(connection.fileno(), select.POLLRDHUP)
        return not poller.poll(0)  # POLLHUP and POLLERR are always reported

    def connect(self) -> None:
        """Look the service up and connect. Raises ServiceGone."""
        self.close()
        try:
            master = bounded_master(rospy.get_name(), self._timeout_s)
            uri = master.lookupService(self.name)
            address = rospy.core.parse_rosrpc_uri(uri)
        except rosgraph.MasterException as error:
            raise ServiceUnknown(f"{self.name}: {error}") from error
        except (ParameterInvalid, *NO_ANSWER) as error:
            raise self._gone(error) from error
        try:
            self._connection = self._shake_hands(address)
        except (OSError, ROSHandshakeException) as error:
            raise self._gone(error) from error

    def _shake_hands(self, address: tuple[str, int]) -> socket.socket:
        connection = socket.create_connection(address, self._timeout_s)
        try:
            header = {
                "service": self.name,
                "md5sum": self._md5sum,
                "callerid": rospy.get_name(),
                "persistent": "1",
            }
            write_ros_handshake_header(connection, header)
            answer = read_ros_handshake_header(connection, io.BytesIO(), _READ_BYTES)
            if "error" in answer:
                raise ROSHandshakeException(answer["error"])
            connection.settimeout(None)  # Python would ask the kernel twice for each call
            timeval = struct.pack("@ll", self._timeout_s, 0)
            for option in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):
                connection.setsockopt(socket.SOL_SOCKET, option, timeval)
        except BaseException:
            connection.close()
            raise
        self.server = answer.get("callerid", "")
        return connection

    def _gone(self, error: Exception) -> ServiceGone:
        if isinstance(error, (BlockingIOError, socket.timeout)):
            return ServiceSilent(f"{self.name}: no answer for {self._timeout_s} s")
        return ServiceGone(f"{self.name}: {error}")

    def call(self, request: Request) -> Response:
        """Send a request and wait for the answer. Raises ServiceGone and ServiceRefused."""
        fields = io.BytesIO()
        request.serialize(fields)
        return self._response_class().deserialize(self.call_bytes(fields.getvalue()))

    def call_bytes(self, fields: bytes) -> bytes:
        """Like `call`, with the fields of request and answer as ROS serialises them."""
        connection = self._connection
        if connection is None:
            raise ServiceGone(f"{self.name}: not connected")
        try:
            connection.sendall(_REQUEST_HEAD.pack(len(fields)) + fields)
            ok, answer = self._read_answer(connection)
        except (OSError, EOFError) as error:
            self.close()
            raise self._gone(error) from error
        if not ok:
            text = answer.decode("utf-8", "replace")
            raise ServiceRefused(text.replace(_PREFIX, "", 1))
        return answer

    def close(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()

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
