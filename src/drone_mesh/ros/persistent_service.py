"""PersistentService: a service client that keeps its connection and never hangs in a call."""

from __future__ import annotations

import select
import socket
import struct

import rosgraph
import rospy
from genpy import Message
from rospy.exceptions import TransportException, TransportInitError
from rospy.impl.tcpros_base import TCPROSTransport

from drone_mesh.errors import MeshError

CALL_TIMEOUT_S = 2  # our choice: who does not answer in this time (wall seconds) is gone


class ServiceGone(MeshError):
    """Nobody answers. The connection is closed; connect() again when there is hope."""


class ServiceRefused(MeshError):
    """The service is there and answered with an error; the message is what it said."""


class PersistentService:
    """One connection to one service. A rospy call costs ten times as much without one.

    `connect` and `close` may be called by another thread than `call`, but not during a call.
    """

    def __init__(
        self, name: str, service_class: type, timeout_s: int = CALL_TIMEOUT_S
    ) -> None:
        """`timeout_s`: whole wall seconds to wait for an answer."""
        self.name = name
        self._timeout_s = timeout_s
        self._proxy = rospy.ServiceProxy(name, service_class, persistent=True)

    def is_connected(self) -> bool:
        """Whether there is a connection, and the other end has not closed it. Any thread."""
        transport = self._proxy.transport
        connection = None if transport is None else transport.socket
        if connection is None or connection.fileno() < 0:
            return False
        poller = select.poll()
        poller.register(connection.fileno(), select.POLLRDHUP)
        return not poller.poll(0)  # POLLHUP and POLLERR are always looked for

    def connect(self) -> None:
        """Look the service up and connect. Raises ServiceGone."""
        self.close()
        proxy = self._proxy
        try:
            uri = rosgraph.Master(rospy.get_name()).lookupService(proxy.resolved_name)
            host, port = rospy.core.parse_rosrpc_uri(uri)
            transport = TCPROSTransport(proxy.protocol, proxy.resolved_name)
            transport.buff_size = proxy.buff_size
            transport.connect(host, port, uri)
        except (rosgraph.MasterException, TransportInitError, OSError, ValueError) as error:
            raise ServiceGone(f"{self.name}: {error}") from error
        except rospy.impl.validators.ParameterInvalid as error:
            raise ServiceGone(f"{self.name}: {error}") from error
        # rospy has no timeout for calls; the kernel's makes a read fail, and that closes it.
        timeval = struct.pack("@ll", self._timeout_s, 0)
        transport.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, timeval)
        transport.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, timeval)
        proxy.transport = transport

    def call(self, request: Message) -> Message:
        """The answer. Raises ServiceGone without a connection and ServiceRefused for an error."""
        if self._proxy.transport is None:
            raise ServiceGone(f"{self.name}: not connected")
        try:
            return self._proxy.call(request)
        except rospy.ServiceException as error:
            if " responded with an error: " in str(error):
                raise ServiceRefused(str(error)) from None
            self.close()
            raise ServiceGone(f"{self.name}: {error}") from error
        except (TransportException, rospy.ROSException, OSError, AttributeError) as error:
            # AttributeError: rospy closed the connection under the call, because it shuts down.
            self.close()
            raise ServiceGone(f"{self.name}: {error}") from error

    def close(self) -> None:
        """Close the connection, if there is one."""
        self._proxy.close()
        self._proxy.transport = None
