"""RosControls: carries out the console's orders through the public services."""

from __future__ import annotations

import json
import logging
from typing import Protocol, Sequence

import rospy

from drone_mesh import srv
from drone_mesh.console.controls import MeshControls, OrderRefused
from drone_mesh.drone.flight_path import Point
from drone_mesh.drone.location import Location as Place
from drone_mesh.formations.layouts import Order
from drone_mesh.formations.missions import Mission
from drone_mesh.formations.preview import FormationPreview
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import formation_request, mission_request
from drone_mesh.ros.graph.fleet_parameter import drones_if_known
from drone_mesh.ros.graph.persistent_service import (
    Request,
    Response,
    ServiceClass,
    ServiceGone,
    ServiceRefused,
    call_once,
)
from drone_mesh.ros.services.flight_request import FlightNotOrdered, request_flight

log = logging.getLogger(__name__)


class RosControls(MeshControls):
    """Any thread; each call opens a connection of its own and closes it."""

    def power(self, node: int, on: bool) -> str:
        _call(names.power_switch(node), srv.PowerSwitch, power=on)
        return f"node {node} is {'on' if on else 'off'}"

    def fly(self, node: int, x: float, y: float, z: float, allow_shared_place: bool = False) -> str:
        try:
            goal = Place(latitude=y, longitude=x, height=z)
            warning = request_flight(node, goal, allow_shared_place)
        except FlightNotOrdered as error:
            raise OrderRefused(str(error)) from error
        done = f"ordered drone {node} to x {x:g}, y {y:g}, z {round(z)} m"
        return f"{done}; {warning}" if warning else done

    def layout(self, case: int) -> str:
        answer = _call(names.ORDER_LAYOUT_SERVICE, srv.OrderLayout, caseID=case)
        return _outcome(f"layout {case}", answer)

    def formation(self, name: str, orders: Sequence[Order], gateways: Sequence[int]) -> str:
        request = formation_request(name, orders, gateways=gateways)
        answer = _ask(names.ORDER_FORMATION_SERVICE, srv.OrderFormation, request)
        return _outcome(name, answer)

    def preview(self, case: int) -> FormationPreview:
        answer = _call(names.PREVIEW_LAYOUT_SERVICE, srv.PreviewLayout, caseID=case)
        return FormationPreview(
            answer.duration,
            list(answer.out_of_reach),
            list(answer.cut_off),
            dict(zip(answer.stay, answer.reasons)),
            answer.least_connected,
        )

    def speed(self, paused: bool, factor: float) -> str:
        _done(_call(names.SPEED_SERVICE, srv.SetSpeed, paused=paused, real_time_factor=factor))
        if paused:
            return "paused"
        how = f"runs at {factor:g} times real time" if factor else "resumes"
        return f"simulated time {how}"

    def add(self, node: int | None, gateway: bool, x: float, y: float) -> str:
        wanted = srv.AddDroneRequest.LOWEST_FREE if node is None else node
        where = {"latitude": y, "longitude": x}
        return _done(
            _call(names.ADD_DRONE_SERVICE, srv.AddDrone, id=wanted, gateway=gateway, **where)
        )

    def remove(self, node: int) -> str:
        return _done(_call(names.REMOVE_DRONE_SERVICE, srv.RemoveDrone, id=node))

    def fence(
        self, name: str, corners: Sequence[Point], inside: bool, max_height: float | None
    ) -> str:
        area = {"name": name, "inclusion": inside, "polygon": corners, "max_height": max_height}
        text = json.dumps({"areas": [area]}, ensure_ascii=False) if corners else ""
        gone = [] if corners else [name]
        return _call(
            names.SET_FENCE_SERVICE, srv.SetFence, areas=text, keep=True, remove=gone
        ).message

    def mission(self, nodes: Sequence[int], mission: Mission) -> str:
        request = mission_request(mission)
        for node in nodes:
            _done(_ask(names.mission_service(node), srv.FlyMission, request))
        who = f"drone {nodes[0]}" if len(nodes) == 1 else f"{len(nodes)} drones"
        return f"the mission of {who} has begun"

    def pilots(self, action: str) -> str:
        drones = drones_if_known()
        request = srv.FlyMissionRequest(action=_ACTIONS[action])
        done = sum(
            _ask(names.mission_service(node), srv.FlyMission, request).success
            for node in (drones.roles if drones else ())
        )
        if not done:
            raise OrderRefused("no drone has a mission")
        return f"{_DONE[action]} {done} {'mission' if done == 1 else 'missions'}"


_ACTIONS = {
    "pause": srv.FlyMissionRequest.PAUSE,
    "resume": srv.FlyMissionRequest.RESUME,
    "stop": srv.FlyMissionRequest.STOP,
}
_DONE = {"pause": "paused", "resume": "resumed", "stop": "ended"}


def _outcome(name: str, answer: srv.OrderLayoutResponse | srv.OrderFormationResponse) -> str:
    if not (answer.sent or answer.later or answer.there or answer.no_route):  # all are refused
        raise OrderRefused(f"{name}: {answer.message}")
    return f"{name}: {answer.message}"


class _Answer(Protocol):
    success: bool
    message: str


def _done(answer: _Answer) -> str:
    """The words of an answer. Raises OrderRefused with them if the order was not carried out."""
    if not answer.success:
        raise OrderRefused(answer.message)
    return answer.message


def _call(name: str, service_class: ServiceClass[Request, Response], **fields: object) -> Response:
    return _ask(name, service_class, service_class._request_class(**fields))


def _ask(name: str, service_class: ServiceClass[Request, Response], request: Request) -> Response:
    try:
        return call_once(name, service_class, request)
    except ServiceGone as error:
        log.warning("console: order failed: %s", error)
        full = rospy.resolve_name(name)
        raise OrderRefused(f"no answer from {full}: is the simulation running?") from error
    except ServiceRefused as error:
        raise OrderRefused(str(error)) from error
