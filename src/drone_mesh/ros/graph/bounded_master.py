"""Calls to the master and to nodes that end, even if the other side hangs."""

from __future__ import annotations

import http.client
import xmlrpc.client
from typing import Any

import rosgraph
import rospy

from drone_mesh.errors import MeshError

ANSWER_TIMEOUT_S = 5.0  # wall; what is silent for longer is dead
NO_ANSWER = (OSError, http.client.HTTPException, xmlrpc.client.Error, rospy.ROSException)


class _BoundedTransport(xmlrpc.client.Transport):
    def __init__(self, timeout_s: float) -> None:
        super().__init__()
        self._timeout_s = timeout_s

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = self._timeout_s
        return connection


def bounded_proxy(uri: str, timeout_s: float) -> xmlrpc.client.ServerProxy:
    """Calls raise OSError after this wall time without an answer."""
    return xmlrpc.client.ServerProxy(uri, transport=_BoundedTransport(timeout_s))


def bounded_master(caller: str, timeout_s: float) -> rosgraph.Master:
    """Like rosgraph.Master. Calls raise OSError after this wall time without an answer.

    Raises MeshError if ROS_MASTER_URI is no address.
    """
    try:
        master = rosgraph.Master(caller)
    except (ValueError, OSError) as error:
        uri = rosgraph.get_master_uri()
        raise MeshError(
            f"ROS_MASTER_URI={uri} is no address of a master: it must look like "
            "http://localhost:11311"
        ) from error
    master.handle = bounded_proxy(master.master_uri, timeout_s)
    return master


def master_answers() -> bool:
    """Whether there is a master, and it does not hang. Raises MeshError as `bounded_master`."""
    try:
        bounded_master("drone_mesh", ANSWER_TIMEOUT_S).getPid()
    except (rosgraph.MasterException, *NO_ANSWER):
        return False
    return True
