"""The ROS master: calls that end even if it hangs, and what a node does after its restart."""

from __future__ import annotations

import http.client
import logging
import xmlrpc.client
from typing import Any

import rosgraph
import rospy
from rospy.impl.registration import (
    Registration,
    get_registration_listeners,
    get_service_manager,
    get_topic_manager,
)

from drone_mesh.errors import MeshError
from drone_mesh.ros.graph.periodic import Periodic

ANSWER_TIMEOUT_S = 5.0  # wall; what is silent for longer is dead
POLL_PERIOD_S = 2.0  # wall
NO_ANSWER = (OSError, http.client.HTTPException, xmlrpc.client.Error, rospy.ROSException)

_log = logging.getLogger(__name__)


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


class MasterWatch(Periodic):
    """Polls the master in a thread of its own.

    A new master starts empty: existing connections between nodes survive, but topics, services and
    parameters cannot be looked up. The watch registers all topics and services of this process
    again. It restores the public parameters that it was given, and the private ones as they were at
    its start: a parameter that changes must not be private.

    It also asks once more for the publishers of each topic that it finds without a connection.
    rospy never connects to one that registers while a subscription is under way: it takes the
    master's answer, which is older, for the news, if that comes later.
    """

    def __init__(self, *parameters: str) -> None:
        """`parameters`: names of public parameters to restore, if they exist when it starts."""
        super().__init__("master watch", POLL_PERIOD_S)
        self._master = rosgraph.Master(rospy.get_name())
        self._names = [rospy.resolve_name(name) for name in (rospy.get_name(), *parameters)]
        self._values: dict[str, Any] = {}  # replaced as a whole
        self._asked: set[str] = set()  # topics; the watch's own thread

    def start(self) -> None:
        """Store the parameters and start polling; the thread ends when the node shuts down."""
        present = {name: rospy.get_param(name) for name in self._names if rospy.has_param(name)}
        self._values = {**present, **self._values}
        rospy.on_shutdown(self._stopped.set)
        super().start()

    def keep(self, parameter: str, value: Any) -> None:
        """Also restore this value of a public parameter. After `start`, from one thread only."""
        self._values = {**self._values, rospy.resolve_name(parameter): value}

    def _work(self) -> None:
        try:
            self._master.lookupNode(rospy.get_name())
            self._ask_again()
        except rosgraph.MasterException:  # a new master, which does not know this node
            if not (self._stopped.is_set() or rospy.is_shutdown()):
                self._register_again()
        except NO_ANSWER as error:
            _log.debug("the master does not answer: %s", error)

    def _ask_again(self) -> None:
        topics = get_topic_manager()
        subscribed = dict(topics.get_subscriptions())
        for name in subscribed.keys() - self._asked:
            subscriber = topics.get_subscriber_impl(name)
            if subscriber is not None and not subscriber.has_connections():
                # Not by rospy, which waits for a master that has died: the new one would know this
                # node by one topic, and so the others would not be registered again.
                uri = rospy.get_node_uri()
                publishers = self._master.registerSubscriber(name, subscribed[name], uri)
                node = bounded_proxy(uri, ANSWER_TIMEOUT_S)
                node.publisherUpdate(rospy.get_name(), name, publishers)
        self._asked = set(subscribed)

    def _register_again(self) -> None:
        listeners = get_registration_listeners()
        try:
            for name, value in self._values.items():
                rospy.set_param(name, value)
        except NO_ANSWER as error:
            _log.debug("the master does not answer: %s", error)
            return
        topics, services = get_topic_manager(), get_service_manager()
        for name, kind in topics.get_publications():
            listeners.notify_added(name, kind, Registration.PUB)
        for name, kind in topics.get_subscriptions():
            listeners.notify_added(name, kind, Registration.SUB)
        for name, uri in services.get_services():
            listeners.notify_added(name, uri, Registration.SRV)
        _log.warning("registered %s again: the master was restarted", rospy.get_name())
