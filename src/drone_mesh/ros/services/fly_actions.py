"""The node /fly_actions: drone flights as actions (docs/ros.md, "Actions")."""

from __future__ import annotations

import functools
import logging
import math
import queue
import time
from typing import Callable

import actionlib
import rospy

from drone_mesh.communication.interfaces import OrderState
from drone_mesh.drone.location import Location
from drone_mesh.msg import FlyAction, FlyFeedback, FlyResult, MeshEvent, MeshState, NodeState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import start_node
from drone_mesh.ros.graph.conversions import event_record, location_of
from drone_mesh.ros.graph.fleet_parameter import drones_if_known
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.master import NO_ANSWER, MasterWatch
from drone_mesh.ros.graph.orderly_stop import OrderlyStop
from drone_mesh.ros.graph.simulation import Run, run_of
from drone_mesh.ros.services.flight_request import FlightNotOrdered, FlightRefused, request_flight
from drone_mesh.state.orders import CLOCKS_DIFFER_S, OrderProgress

POLL_PERIOD_S = 1.0  # wall; how often the drones are compared with the actions
SENT_WITHIN_S = 30.0  # wall; a gateway reports an order within a second

_log = logging.getLogger(__name__)


class _Flight:
    """One accepted goal."""

    def __init__(self, handle: actionlib.ServerGoalHandle, drone: int, since_s: float) -> None:
        """`since_s`: simulated; no event of the order is older."""
        self.handle = handle
        self.drone = drone
        self.goal = location_of(handle.get_goal())
        self.progress = OrderProgress(drone, self.goal, since_s)
        self.begun_s = time.monotonic()
        self.warning = ""  # who will lose the mesh by it, in words


class FlyActions:
    """Offers the flight of each drone as an action: /Drones/<id>/fly (Fly).

    Subscribes: /mesh/events (MeshEvent); while a drone flies also /mesh/state (MeshState)
    Calls:      /DroneManager/orderFlight (OrderFlight)
    """

    # One node for all drones, and no thread per drone: an action server of actionlib repeats its
    # status five times a second in a thread of its own. Here `run` repeats the status of those
    # that have goals. Threads of rospy only fill the queue; all else belongs to the thread of
    # `run`, which orders one drone after the other.

    def __init__(self) -> None:
        rospy.set_param("~actionlib_status_frequency", 0)  # for actionlib: no thread
        self._work: queue.Queue[Callable[[], None]] = queue.Queue()
        self._servers: dict[int, actionlib.ActionServer] = {}
        self._flights: list[_Flight] = []
        self._states: rospy.Subscriber | None = None
        self._nodes: dict[int, NodeState] = {}
        self._run: Run | None = None  # of these nodes
        rospy.Subscriber(names.EVENTS_TOPIC, MeshEvent, self._later(self._take_event))

    def run(self, ended: Callable[[], bool]) -> None:
        polled_s = -math.inf
        while not ended():
            if time.monotonic() - polled_s >= POLL_PERIOD_S:
                polled_s = time.monotonic()
                self._poll()
            try:
                work = self._work.get(timeout=POLL_PERIOD_S / 4)
            except queue.Empty:
                continue
            work()

    def _later(self, work: Callable[..., None], *first: object) -> Callable[[object], None]:
        """Make a handler for rospy that leaves the work to the thread of `run`."""
        return lambda came: self._work.put(functools.partial(work, *first, came))

    # The thread of `run` ---------------------------------------------------------------------

    def _poll(self) -> None:
        """Offer the actions of the present drones and no others; end flights without news."""
        try:
            present = drones_if_known()
        except NO_ANSWER as error:
            _log.debug("the drones are not known: %s", error)
            present = None
        if present is not None:
            for drone in self._servers.keys() - present.roles.keys():
                self._withdraw(drone)
            new = present.roles.keys() - self._servers.keys()
            for drone in new:
                self._offer(drone)
            if new:
                _log.info("offering the flights of %d drones as actions", len(self._servers))
        for server in self._servers.values():
            if server.status_list:
                server.publish_status()
        for flight in list(self._flights):
            silent = time.monotonic() - flight.begun_s > SENT_WITHIN_S
            if silent and not flight.progress.was_sent:
                self._end(flight, FlyResult.GIVEN_UP, "no gateway reported that it sent the order")

    def _offer(self, drone: int) -> None:
        self._servers[drone] = server = actionlib.ActionServer(
            names.fly_action(drone),
            FlyAction,
            self._later(self._begin, drone),
            self._later(self._cancel),
            auto_start=False,
        )
        server.start()

    def _withdraw(self, drone: int) -> None:
        for flight in [flight for flight in self._flights if flight.drone == drone]:
            self._end(flight, FlyResult.GIVEN_UP, f"drone {drone} was removed")
        server = self._servers.pop(drone)
        server.started = False
        # Not its stop(), which expects the thread that this node does without.
        subscribers = (server.goal_sub, server.cancel_sub)
        for topic in (*subscribers, server.status_pub, server.feedback_pub, server.result_pub):
            topic.unregister()

    def _begin(self, drone: int, handle: actionlib.ServerGoalHandle) -> None:
        flight = _Flight(handle, drone, rospy.get_time() - CLOCKS_DIFFER_S)
        try:
            flight.warning = request_flight(drone, flight.goal)
        except FlightNotOrdered as error:
            refused = isinstance(error, FlightRefused)
            outcome = FlyResult.REFUSED if refused else FlyResult.NO_ROUTE
            handle.set_rejected(FlyResult(outcome, str(error)), str(error))
            return
        handle.set_accepted(flight.warning)
        self._flights.append(flight)
        if self._states is None:
            self._states = rospy.Subscriber(
                names.STATE_TOPIC, MeshState, self._later(self._take_state), queue_size=1
            )

    def _cancel(self, handle: actionlib.ServerGoalHandle) -> None:
        flight = next((f for f in self._flights if f.handle == handle), None)
        if flight is None:  # rejected, or it has ended meanwhile
            return
        node = self._nodes.get(flight.drone)
        try:
            if node is None or not math.isfinite(node.position[0]):
                raise FlightNotOrdered("its place is not known")
            x, y, z = node.position
            here = Location.from_vector((x, y, max(0.0, z)))
            request_flight(flight.drone, here, allow_shared_place=True)  # above all, it stops
            why = f"ordered to stop at x {x:.1f} m, y {y:.1f} m, z {max(0.0, z):.0f} m"
        except FlightNotOrdered as error:
            why = f"the drone continues its flight: {error}"
        self._forget(flight)
        handle.set_canceled(FlyResult(FlyResult.CANCELLED, why), why)

    def _take_event(self, event: MeshEvent) -> None:
        record = event_record(event)
        for flight in list(self._flights):
            flight.progress.on_event(record)
            if flight.progress.is_over:
                arrived = flight.progress.state is OrderState.ARRIVED
                words = "" if arrived else flight.progress.in_words()
                self._end(flight, getattr(FlyResult, flight.progress.state.name), words)

    def _take_state(self, state: MeshState) -> None:
        before, self._run = self._run, run_of(state)
        if before not in (None, self._run):
            for flight in list(self._flights):
                self._end(flight, FlyResult.GIVEN_UP, "the simulation was restarted")
            return
        self._nodes = {node.id: node for node in state.nodes}
        for flight in self._flights:
            node = self._nodes.get(flight.drone)
            if node is not None:
                x, y, z = node.position
                left_m = Location.from_vector(node.position).distance_m(flight.goal)
                words = "; ".join(filter(None, (flight.progress.in_words(node), flight.warning)))
                flight.handle.publish_feedback(FlyFeedback(words, y, x, z, left_m))

    def _end(self, flight: _Flight, outcome: int, why: str) -> None:
        self._forget(flight)
        result = FlyResult(outcome, why)
        if outcome == FlyResult.ARRIVED:
            flight.handle.set_succeeded(result)
        else:
            flight.handle.set_aborted(result, why)

    def _forget(self, flight: _Flight) -> None:
        self._flights.remove(flight)
        if not self._flights and self._states is not None:
            self._states.unregister()
            self._states, self._nodes, self._run = None, {}, None


def main() -> None:
    start_node(FlyActions.__doc__, "fly_actions", disable_signals=True)
    show_library_logs_on_rosout()
    with OrderlyStop() as stop:
        actions = FlyActions()
        MasterWatch().start()
        actions.run(stop.requested)
