"""A component as a routing technique sees it: it keeps what the technique asks of it."""

from __future__ import annotations

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.interfaces import IRoutingEssentials


class RecordingEssentials(IRoutingEssentials):
    """Node 1 with gateway 0. Neighbours in `gone` take no packet; `technique` gets the result."""

    def __init__(self, node_id=1, gateway=0, technique=None, gone=()):
        self.node_id = node_id
        self.gateway = gateway
        self.technique = technique
        self.gone = set(gone)
        self.connected = True
        self.time_s = 0.0
        self.wake_s = None
        self.asked = []
        self.packets = []
        self.broadcasts = []

    def get_node_id(self):
        return self.node_id

    def get_preferred_gateway(self):
        return self.gateway

    def get_connected_to_gateway(self):
        return self.connected

    def now_s(self):
        return self.time_s

    def wake_at(self, at_s):
        self.wake_s = at_s

    def search_other_nodes_in_range(self):
        self.asked.append("search")

    def send_heartbeat(self, other):
        self.asked.append(other)
        return self._taken(other)

    def send_packet(self, kind, neighbour, body):
        self.packets.append((kind, neighbour, body))
        return self._taken(neighbour)

    def broadcast_packet(self, kind, body):
        self.broadcasts.append((kind, body))

    def own_place(self):
        return None

    def place_of(self, node):
        return None

    def _taken(self, node):
        if node in self.gone:
            for lost in self.gone:
                self.technique.cant_communicate_with_node(lost)
            return False
        return True


def present(neighbour, extension="", hops=1):
    """A PRESENT that `neighbour` broadcasts, with these extension bytes (hex)."""
    header = bytes((neighbour, neighbour, 3, 254, 254, hops, 1))
    return (header + bytes.fromhex(extension)).ljust(32, b"\0")


def hear(technique, payload):
    """The component hands a packet to the technique."""
    return technique.learn(payload[0], payload[1], payload[2], payload)


def started(technique, **essentials):
    """The technique, started; what it asks for is in `.essentials`."""
    technique.essentials = RecordingEssentials(technique=technique, **essentials)
    technique.start_routing(technique.essentials)
    return technique


def next_hop(technique, node=0):
    """The next hop, None while there is none."""
    to = technique.get_direction_to_node(node)
    return None if to == NO_ROUTE else to
