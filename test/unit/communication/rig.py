"""One mesh component in a test rig: literal packets in, literal packets out.

Packets are written as hex: creator, from, type, to, forward, body; zeros at the end are left out.
"""

from __future__ import annotations

import random

from drone_mesh.communication.interfaces import (
    NO_SEALS,
    IInternetConnection,
    IWirelessCommunication,
)
from drone_mesh.communication.node.component import NodeSettings
from drone_mesh.communication.node.gateway import MeshnetworkGateway
from drone_mesh.communication.node.router import MeshnetworkRouter
from drone_mesh.communication.repair.options import RepairOptions
from drone_mesh.communication.routing.child_table_tree import ChildTableTree
from drone_mesh.communication.timing import UNDISTURBED, MeshTiming
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import LocationUnknown

FIRST_CHECK_S = 5.0  # half a period: see AlwaysHalf
PERIOD_S = 10.0
FROM_0 = "00 00 00 00 00 00 00 00 01 00"  # in a request: the place of the node that asks


def packet(text):
    """The 32 bytes that are written as `text`."""
    return bytes.fromhex(text).ljust(32, b"\0")


class RecordingAntenna(IWirelessCommunication):
    """Keeps what is sent. Loses the next `losing` packets; `dead` neighbours never take one.

    `gets_lost(payload)` decides for single packets.
    """

    def __init__(self, medium=UNDISTURBED):
        self._medium = medium
        self.taken = []
        self.tried = []
        self.broadcasts = []
        self.switched = []
        self.calls = []
        self.dead = set()
        self.losing = 0
        self.gets_lost = lambda payload: False
        self.powered = True
        self.is_whole = True
        self.periods = 0.0  # its patience
        self.power = lambda: None  # whether it hears power; None: it cannot tell

    @property
    def medium(self):
        return self._medium

    def start_antenna(self, mesh):
        self.calls.append(("start_antenna", mesh))

    def stop_antenna(self):
        self.calls.append(("stop_antenna",))

    def send_message_to(self, payload):
        assert len(payload) == 32
        self.tried.append(payload)
        if self.losing:
            self.losing -= 1
            return False
        if not self.powered or payload[3] in self.dead or self.gets_lost(payload):
            return False
        self.taken.append(payload)
        return True

    def broadcast_message(self, payload):
        assert len(payload) == 32
        if self.powered:
            self.broadcasts.append(payload)

    def debugging_mode(self, info, on):
        self.calls.append(("debugging_mode", info, on))

    def switch_power(self, on):
        self.switched.append(on)

    def on(self):
        return self.powered

    def patience(self):
        return self.periods

    def hears_power(self):
        return self.power()

    def works(self):
        return self.is_whole


class RigEngine(IDroneEngine):
    """A drone that is where the test puts it. `place` None: the position is unknown."""

    def __init__(self):
        self.place = Location(0.0, 0.0, 0.0)
        self.goals = []
        self.grounded = ""  # why it does not fly
        self.kept_by_pilot = ""  # why it does not fly for a repair
        self.ended = ""  # why its last flight ended early

    def why_not_fly(self):
        return self.grounded

    def why_not_repair(self):
        return self.grounded or self.kept_by_pilot

    def why_ended(self):
        return self.ended

    def set_goal(self, latitude, longitude, height):
        check_goal(latitude, longitude, height)
        self.goals.append(Location(latitude, longitude, height))

    def get_location(self):
        if self.place is None:
            raise LocationUnknown("no engine answers")
        return self.place


class RigInternet(IInternetConnection):
    """Keeps the calls."""

    def __init__(self):
        self.calls = []

    def connect(self, commands):
        self.calls.append(("connect", commands))

    def disconnect(self):
        self.calls.append(("disconnect",))


class AlwaysHalf(random.Random):
    """A random source that always gives 0.5: the first check comes after half a period."""

    def random(self):
        return 0.5


class Rig:
    """A started component, its antenna and its drone, and the time they live in."""

    def __init__(
        self,
        node_id=1,
        gateway=False,
        timing=None,
        debug=True,
        routing=None,
        repair=None,
        options=None,
        medium=UNDISTURBED,
        seals=NO_SEALS,
    ):
        self.now_s = 0.0
        self.antenna = RecordingAntenna(medium)
        self.engine = RigEngine()
        self.internet = RigInternet()
        self.routing = routing or ChildTableTree()
        self.events = []
        carried = (self.antenna, self.engine, self.routing)
        settings = NodeSettings(
            timing=timing or MeshTiming(),
            options=options or RepairOptions(),
            observer=self.events.append,
            debug=debug,
            seals=seals,
        )
        if gateway:
            more = (self.internet, AlwaysHalf(), settings)
            self.mesh = MeshnetworkGateway(node_id, *carried, *more)
        else:
            self.mesh = MeshnetworkRouter(node_id, *carried, AlwaysHalf(), repair, settings)
        self.mesh.start(self.now_s)
        self.forget()

    def forget(self):
        """Forget all packets sent so far."""
        self.antenna.taken.clear()
        self.antenna.tried.clear()
        self.antenna.broadcasts.clear()

    def hear(self, *texts):
        """These packets arrive now."""
        for text in texts:
            self.mesh.on_msg(packet(text), self.now_s)

    def wait_until(self, now_s):
        """Time passes; the component is called whenever it is due."""
        while self.mesh.next_tick_s <= now_s:
            self.now_s = max(self.now_s, self.mesh.next_tick_s)
            self.mesh.tick(self.now_s)
        self.now_s = now_s
        self.mesh.tick(now_s)

    def wait(self, seconds):
        """Time passes."""
        self.wait_until(self.now_s + seconds)

    def sent(self, kind=None):
        """Packets that were taken since the last call, or only those of one type."""
        found = [p for p in self.antenna.taken if kind in (None, p[2])]
        self.antenna.taken.clear()
        return found

    def tried(self, kind=None):
        """Packets that were handed to the antenna since the last call, taken or not."""
        found = [p for p in self.antenna.tried if kind in (None, p[2])]
        self.antenna.tried.clear()
        return found

    def broadcasts(self):
        """Packets that were broadcast since the last call."""
        found = list(self.antenna.broadcasts)
        self.antenna.broadcasts.clear()
        return found

    def kinds(self):
        """The names of what was reported."""
        return [event.kind.name for event in self.events]

    def repair_in_words(self):
        """The sentence about the repair that views show."""
        return self.mesh.get_repair_status().in_words(self.now_s)

    # Shorthand for what many tests begin with; the packets are those of gateway 0.

    def know_neighbour(self, *nodes):
        """Hear an unconnected PRESENT of each node, and forget the answers."""
        for node in nodes:
            self.mesh.on_msg(
                bytes((node, node, 0, self.mesh.get_node_id(), 254)).ljust(32, b"\0"), self.now_s
            )
        self.forget()

    def connect_to_gateway(self):
        """Router: gateway 0, a neighbour, answers. The packets that this causes are forgotten."""
        me = self.mesh.get_node_id()
        self.mesh.on_msg(bytes((0, 0, 4, me, me, 1, 0, 0)).ljust(32, b"\0"), self.now_s)
        assert self.mesh.get_connected_to_gateway()
        self.forget()

    def connect_through(self, neighbour, hops=1):
        """Router: a heartbeat of gateway 0 arrives through `neighbour`; then as above."""
        me = self.mesh.get_node_id()
        self.mesh.on_msg(bytes((0, neighbour, 4, me, me, 1, 0, hops)).ljust(32, b"\0"), self.now_s)
        assert self.mesh.get_connected_to_gateway()
        self.forget()
