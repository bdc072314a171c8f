"""StandingLayouts: the ROS side of the DroneManager's standing orders."""

from __future__ import annotations

import functools
import json
import logging
import threading
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Callable, Mapping, NamedTuple, Sequence

import actionlib
import rospy

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.flight_path import FlightPath, PlanFlight
from drone_mesh.errors import ConfigurationError
from drone_mesh.formations.airspace import SWAY_M
from drone_mesh.formations.departures import FlightRules
from drone_mesh.formations.layouts import Order
from drone_mesh.formations.preview import FormationPreview, LostRoutes, lost_routes, preview
from drone_mesh.formations.relief import Relief, ReliefRules
from drone_mesh.formations.relief_policies import relief_policy
from drone_mesh.formations.standing_order import PartState, StandingProgress
from drone_mesh.formations.standing_orders import StandingOrders
from drone_mesh.msg import (
    LayoutAction,
    LayoutFeedback,
    LayoutProgress,
    LayoutResult,
    MeshEvent,
    MeshState,
)
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import event_record, mesh_status
from drone_mesh.ros.graph.fleet_parameter import get_fleet_parameter
from drone_mesh.ros.graph.master import NO_ANSWER, MasterWatch
from drone_mesh.ros.graph.orderly_stop import FINISH_TIMEOUT_S
from drone_mesh.ros.graph.parameters import configured_obstacles
from drone_mesh.ros.graph.simulation import Run, run_of
from drone_mesh.state.model import MeshStatus

_QUEUE = 1000  # events that may wait

_log = logging.getLogger(__name__)


def progress_msg(progress: StandingProgress, over: bool) -> LayoutProgress:
    ids = {state: bytes(drones) for state, drones in progress.drones.items()}
    return LayoutProgress(
        id=progress.number,
        name=progress.name,
        arrived=ids[PartState.ARRIVED],
        flying=ids[PartState.FLYING],
        later=ids[PartState.LATER],
        waiting=ids[PartState.WAITING],
        refused=ids[PartState.REFUSED],
        reasons=[progress.reasons[drone] for drone in progress.drones[PartState.REFUSED]],
        replaced=ids[PartState.REPLACED],
        not_in_fleet=ids[PartState.ABSENT],
        over=over,
        message=progress.in_words(),
        relieves=NO_ROUTE if progress.relieves is None else progress.relieves,
    )


class LayoutStart(NamedTuple):
    """A standing order at its start."""

    progress: StandingProgress
    orders: Sequence[Order]  # that must be given first
    is_followed: bool  # whether others follow as the state of the mesh demands


class StandingLayouts:
    """Orders again what was not accepted, and reports how far each layout has come.

    Subscribes: /mesh/state (MeshState), /mesh/events (MeshEvent)
    Publishes:  /DroneManager/layouts (LayoutProgress, latched)
    Action:     /DroneManager/layout (Layout)
    Parameter:  /drone_mesh/standing, what is left to order, for the next start

    `_lock` guards the orders and the actions; nothing is published, stored or planned while it is
    held. Who plans holds `_planning`; the relief belongs to the thread of the states.
    One thread publishes and stores, in the order in which it was told under the lock: what was
    said last is what a latched topic keeps. It ends with the process.
    """

    def __init__(
        self,
        order: Callable[[Sequence[Order]], None],
        begin: Callable[[int, bool, actionlib.ServerGoalHandle], object],
        on_other_run: Callable[[], None],
        watch: MasterWatch,
    ) -> None:
        """`order` publishes orders; `begin` orders a layout for the goal of an action.

        `on_other_run`: the world in which these were ordered is over. All are called in threads of
        rospy. `begin` calls `give`, or raises rospy.ServiceException with the reason if the layout
        cannot be ordered. `watch` restores the parameter after a restart of the master.
        """
        self._order = order
        self._begin = begin
        self._on_other_run, self._watch = on_other_run, watch
        self._lock = threading.RLock()
        self._planning = threading.Lock()
        self._orders = StandingOrders(self._lock)
        self._reporter = ThreadPoolExecutor(max_workers=1, thread_name_prefix="standing layouts")
        self._relief: Relief | None = None  # made as soon as there is a fleet
        self._relief_left: Mapping[str, Any] | None = None  # what a restarted one goes on with
        self._mesh: MeshStatus | None = None  # the latest state
        self._run: Run | None = None  # of that state
        self._shown: dict[int, StandingProgress] = {}
        self._saved = ""
        self._handles: dict[int, actionlib.ServerGoalHandle] = {}
        self._publisher = rospy.Publisher(
            names.LAYOUTS_TOPIC, LayoutProgress, queue_size=_QUEUE, latch=True
        )
        self._restore()
        self._server = actionlib.ActionServer(
            names.LAYOUT_ACTION, LayoutAction, self._goal_came, self._cancel_came, auto_start=False
        )
        self._server.start()
        rospy.on_shutdown(self._end_status)
        rospy.Subscriber(names.EVENTS_TOPIC, MeshEvent, self._event_came, queue_size=_QUEUE)
        rospy.Subscriber(names.STATE_TOPIC, MeshState, self._state_came, queue_size=1)

    def _end_status(self) -> None:
        """Before the topics are closed: actionlib's timer would die of a closed one, aloud."""
        self._server.started = False
        if self._server.lock.acquire(timeout=FINISH_TIMEOUT_S):  # it publishes under its lock
            self._server.lock.release()

    def give(
        self,
        name: str,
        orders: Sequence[Order],
        at_once: bool,
        handle: actionlib.ServerGoalHandle | None,
    ) -> LayoutStart:
        """Make a standing order of these. The caller publishes the first ones next.

        Without a state of the mesh, as beside the world of another program, that is all of them.
        `handle` is the accepted goal of the action, if it was ordered by one.
        """
        rules = flight_rules()
        with self._lock:
            number = self._orders.give(name, dict(orders), rospy.get_time(), at_once)
            if handle is not None:
                self._handles[number] = handle
            (progress,) = [p for p in self._orders.all_progress() if p.number == number]
        mesh = self._mesh
        first = orders if mesh is None else self._plan(mesh, rules)
        with self._lock:
            now = [p for p in self._orders.all_progress() if p.number == number]
        self._show()
        return LayoutStart(now[0] if now else progress, first, mesh is not None)

    def _plan(self, mesh: MeshStatus, rules: FlightRules) -> list[Order]:
        with self._planning:
            return [Order(*one) for one in self._orders.update(mesh, rules)]

    def preview(self, orders: Sequence[Order], at_once: bool) -> FormationPreview | None:
        """Preview an order to these drones; None: the state of the mesh is unknown."""
        mesh = self._mesh
        if mesh is None:
            return None
        with self._lock:
            standing = self._orders.goals(mesh)
        return preview(mesh, dict(orders), flight_rules(), at_once, standing)

    def lost_routes(self, orders: Sequence[Order]) -> LostRoutes:
        """Who would lose the mesh by these orders; nobody if its state is unknown."""
        mesh = self._mesh
        return LostRoutes() if mesh is None else lost_routes(mesh, dict(orders))

    def ordered(self, order: Order) -> None:
        """Somebody ordered one drone to a place."""
        with self._lock:
            self._orders.ordered(*order, rospy.get_time())
        self._show()

    def withdraw(self, number: int) -> str | None:
        """Order its drones no more; returns how far it came, in words. None: it is unknown."""
        with self._lock:
            progress = self._orders.withdraw(number)
            handle = self._handles.pop(number, None)
            self._shown.pop(number, None)
            if progress is None:
                return None
            self._save()
            self._later(self._report, progress, handle, True)
        return progress.in_words()

    # Threads of rospy ------------------------------------------------------------------------

    def _event_came(self, event: MeshEvent) -> None:
        with self._lock:
            self._orders.on_event(event_record(event))

    def _state_came(self, state: MeshState) -> None:
        mesh = mesh_status(state)
        before, self._run = self._run, run_of(state)
        if before not in (None, self._run):
            self._on_other_run()
            return
        relief = self._relief = self._relief or relief_of_fleet(self._relief_left)
        with self._lock:
            is_idle = not (relief and relief.is_active or self._orders.all_progress())
        rules = FlightRules() if is_idle else flight_rules()
        if relief and relief.is_active:
            relief.update(mesh, self._orders, rules)
            self._relief_left = relief.saved()
        self._mesh = mesh
        self._order(self._plan(mesh, rules))
        self._show()

    def _goal_came(self, handle: actionlib.ServerGoalHandle) -> None:
        handle.set_accepted()  # first: it may be over before `begin` returns
        try:
            goal = handle.get_goal()
            self._begin(goal.caseID, goal.at_once, handle)
        except rospy.ServiceException as error:
            handle.set_aborted(LayoutResult(0, False, str(error)), str(error))

    def _cancel_came(self, handle: actionlib.ServerGoalHandle) -> None:
        with self._lock:
            numbers = [n for n, other in self._handles.items() if other == handle]
        for number in numbers:
            self.withdraw(number)

    def _show(self) -> None:
        """Report what has changed since the last call, and end what is over."""
        with self._lock:
            progresses = self._orders.all_progress()
            changed = [p for p in progresses if self._shown.get(p.number) != p]
            self._shown = {p.number: p for p in progresses if not p.is_over}
            self._orders.forget_complete()
            self._save()  # first: what is reported outlives this program
            for progress in changed:
                handle = self._handles.get(progress.number)
                if progress.is_over:
                    self._handles.pop(progress.number, None)
                self._later(self._report, progress, handle)

    def _save(self) -> None:
        """Store what is left to do, for a restart. The caller holds the lock."""
        left = json.dumps({"orders": self._orders.saved(), "relief": self._relief_left})
        if left != self._saved:
            self._saved = left
            self._later(self._store, left)

    def _store(self, left: str) -> None:
        self._watch.keep(names.STANDING_PARAM, left)
        try:
            rospy.set_param(names.STANDING_PARAM, left)
        except NO_ANSWER as error:
            _log.debug("what is left to order is not stored: %s", error)

    def _later(self, work: Callable[..., None], *what: object) -> None:
        """Leave this work to the reporter's thread. The caller holds the lock."""
        self._reporter.submit(work, *what).add_done_callback(_log_failure)

    # The reporter's thread -------------------------------------------------------------------

    def _report(
        self,
        progress: StandingProgress,
        handle: actionlib.ServerGoalHandle | None,
        withdrawn: bool = False,
    ) -> None:
        words, over = progress.in_words(), withdrawn or progress.is_over
        self._publisher.publish(progress_msg(progress, over))
        if over:
            _log.info("%s: %s%s", progress.name, "withdrawn: " if withdrawn else "", words)
        if handle is not None and withdrawn:
            handle.set_canceled(LayoutResult(progress.number, False, words), words)
        elif handle is not None:
            _tell(handle, progress)

    # At the start ----------------------------------------------------------------------------

    def _restore(self) -> None:
        try:
            left = json.loads(rospy.get_param(names.STANDING_PARAM, "null"))
            if left is None:
                return
            with self._lock:
                self._orders.restore(left["orders"])
            self._relief_left = left.get("relief")
        except (KeyError, TypeError, ValueError) as error:
            _log.warning("parameter %s is ignored: %s", names.STANDING_PARAM, error)
            return
        for progress in self._orders.all_progress():
            _log.info("%s: goes on: %s", progress.name, progress.in_words())


def _log_failure(report: Future[None]) -> None:
    error = report.exception()
    if error is not None and not rospy.is_shutdown():  # whose topics are closed
        _log.error("a report of a layout is lost", exc_info=error)


def _tell(handle: actionlib.ServerGoalHandle, progress: StandingProgress) -> None:
    words = progress.in_words()
    arrived, flying = progress.drones[PartState.ARRIVED], progress.drones[PartState.FLYING]
    if not progress.is_over:
        feedback = LayoutFeedback(progress.number, bytes(arrived), bytes(flying), words)
        handle.publish_feedback(feedback)
        return
    complete = len(arrived) == sum(map(len, progress.drones.values()))
    end = handle.set_succeeded if complete else handle.set_aborted
    end(LayoutResult(progress.number, complete, words), words)


def relief_of_fleet(left: Mapping[str, Any] | None) -> Relief | None:
    """What relieves the drones of the present factory; None if there is none (yet).

    `left`: what one before it saved.
    """
    try:
        fleet = get_fleet_parameter()
    except (KeyError, *NO_ANSWER):
        return None
    rules = ReliefRules(fleet.swap_time, fleet.swaps_at_once, 60.0 * fleet.hover_minutes)
    relief = Relief(relief_policy(fleet.relief), rules)
    try:
        if left is not None:
            relief.restore(left)
    except (KeyError, TypeError, ValueError) as error:
        _log.warning("the reliefs in parameter %s are ignored: %s", names.STANDING_PARAM, error)
    return relief


def flight_rules() -> FlightRules:
    """The rules of the present factory; those of kinematic drones if there is none."""
    try:
        fleet = get_fleet_parameter()
        obstacles = configured_obstacles(fleet)
    except (KeyError, ConfigurationError, *NO_ANSWER):
        return FlightRules()
    plan: PlanFlight = functools.partial(FlightPath, ceiling_m=fleet.cruise_height)
    if obstacles is not None:
        plan = obstacles.plan_flight
    sway_m = SWAY_M if fleet.flight == "dynamic" else 0.0
    fence = Fence() if obstacles is None else obstacles.fence
    return FlightRules(plan, sway_m, fleet.node.repair_options.clearance_m, fence)
