"""A fleet and a desk without sockets: a ground station's messages in, as bytes, answers out."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.ground_station.reports import Fleet
from drone_mesh.ground_station.requests import Desk
from drone_mesh.ground_station.vehicles import Vehicle
from drone_mesh.state.model import EventRecord
from drone_mesh.web.access import Allowance

ORIGIN = Origin(52.0, 5.0, 3.0)
HERE = Location(10.0, 20.0, 4.0)
GCS = mavlink.MAVLink(None, 255, 190)


def drone(node=3, heard_s=100.0, **fields):
    fields = {"flying": False, "place": HERE, "place_s": heard_s, **fields}
    return Vehicle(node, heard_s, node == 0, **fields)


class DeskRig:
    """Node 0 is a gateway, node 3 a drone in flight that was first seen at its home."""

    def __init__(self, origin=ORIGIN, may_order=True):
        self.ordered, self.posted = [], []  # drone, goal, answer; node, message, station
        self.fleet = Fleet(origin, 25.0, may_order)
        self.desk = Desk(
            self.fleet,
            lambda *order: self.ordered.append(order),
            lambda *post: self.posted.append(post),
            Allowance(5, 1.0, clock=lambda: 0.0),
        )
        self.fleet.show([drone(0), drone(3, place=HERE._replace(height=0.0))], 100.0)
        self.fleet.show([drone(0, 101.0), drone(3, 101.0, flying=True)], 101.0)

    def ask(self, message, station="qgc"):
        """What is answered: (node, message type, the fields that matter)."""
        packet = message.pack(GCS)
        for parsed in GCS.parse_buffer(packet):
            self.desk.received(parsed, station)
        return self.answers()

    def event(self, kind, number=7, at_s=102.0):
        """What an event of the latest order brings."""
        node, goal, _answer = self.ordered[-1]
        self.desk.event(EventRecord(at_s, 0, kind, (node,), "why", number, goal))
        return self.answers()

    def answers(self):
        posted, self.posted = self.posted, []
        return [(node, message.get_type(), brief(message)) for node, message, _to in posted]


def brief(message):
    if message.get_type() == "STATUSTEXT":
        return text_of(message)
    names = ("command", "result", "count", "type", "mission_type", "param_id", "param_value")
    return tuple(getattr(message, name) for name in names if hasattr(message, name))


def text_of(message):
    text = message.text
    return (text if isinstance(text, str) else text.decode()).rstrip("\0")


def long(command, *parameters, node=3, target=1):
    values = [*parameters, *[0.0] * (7 - len(parameters))]
    return mavlink.MAVLink_command_long_message(node + 1, target, command, 0, *values)


def reposition(latitude_deg, longitude_deg, height_m, frame=mavlink.MAV_FRAME_GLOBAL, node=3):
    nan = float("nan")
    x, y = (round(degrees * 1e7) for degrees in (latitude_deg, longitude_deg))
    return mavlink.MAVLink_command_int_message(
        node + 1, 1, frame, mavlink.MAV_CMD_DO_REPOSITION, 0, 0, -1, 1, 0, nan, x, y, height_m
    )
