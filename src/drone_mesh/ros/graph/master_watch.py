"""MasterWatch: registers a node again after the master was restarted."""

from __future__ import annotations

import logging
from typing import Any

import rosgraph
import rospy
from rospy.impl.registration import (
    Registration,
    get_registration_listeners,
    get_service_manager,
    get_topic_manager,
)

from drone_mesh.ros.graph.bounded_master import NO_ANSWER
from drone_mesh.ros.graph.periodic import Periodic

PERIOD_S = 2.0  # wall

_log = logging.getLogger(__name__)


class MasterWatch(Periodic):
    """Polls the master in a thread of its own.

    A new master starts empty: existing connections between nodes survive, but topics, services and
    parameters cannot be looked up. The watch registers all topics and services of this process
    again, and restores its private parameters and the public ones that it was given.
    """

    def __init__(self, *parameters: str) -> None:
        """`parameters`: names of public parameters to restore, if they exist when it starts."""
        super().__init__("master watch", PERIOD_S)
        self._master = rosgraph.Master(rospy.get_name())
        self._names = [rospy.resolve_name(name) for name in (rospy.get_name(), *parameters)]
        self._values: dict[str, Any] = {}  # replaced as a whole

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
        except rosgraph.MasterException:  # a new master, which does not know this node
            if not (self._stopped.is_set() or rospy.is_shutdown()):
                self._register_again()
        except NO_ANSWER as error:
            _log.debug("the master does not answer: %s", error)

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
