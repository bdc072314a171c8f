"""NodeParts: shared by the objects that make up one mesh component."""

from __future__ import annotations

import random
from dataclasses import dataclass

from drone_mesh.communication.control.delivery import IDelivery, IRoutes
from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.events.observer import Reporter
from drone_mesh.communication.interfaces import IMeshSeals, IWirelessCommunication
from drone_mesh.communication.neighbours.common_frame import CommonFrame
from drone_mesh.communication.neighbours.known_places import KnownPlaces
from drone_mesh.communication.neighbours.neighbour_table import Neighbours
from drone_mesh.communication.timing.deadlines import Deadlines
from drone_mesh.communication.timing.mesh_timing import MeshTiming
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location


@dataclass(frozen=True)
class NodeBasics:
    """What one node has before its control plane. All belongs to its component's thread."""

    node_id: int
    timing: MeshTiming
    deadlines: Deadlines
    report: Reporter
    neighbours: Neighbours
    places: KnownPlaces
    engine: IDroneEngine
    pilot: Pilot  # flies it
    antenna: IWirelessCommunication
    seals: IMeshSeals
    complaints: Complaints
    frame: CommonFrame
    rng: random.Random  # spreads simultaneous actions of many nodes
    range_m: float  # of the radio, as far as the node knows

    @property
    def now_s(self) -> float:
        """The time of the component's latest call."""
        return self.deadlines.now_s

    @property
    def has_key(self) -> bool:
        """Whether its mesh has a key."""
        return self.seals.reserved_bytes(MessageType.HEARTBEAT) > 0

    def heard_origin(self, neighbour: int, digest: int) -> None:
        """A neighbour tells the digest of its origin; complains if it is not this node's."""
        is_common = self.frame.heard(neighbour, digest)
        # The digest of a neighbour with a key, at a node without one, is part of a seal.
        if not is_common and not self.complaints.foreign_neighbour(self.now_s):
            self.complaints.add("a neighbour has another origin", f"node {neighbour}", self.now_s)

    def may_be_at(self, place: Location, gateway: bool, says_so: bool) -> bool:
        """Whether the gateway, or else the next hop, can be at `place`; counts it if not.

        `says_so`: that node itself says that it is there now. Complains if it goes on to do so.
        """
        possible = self.places.is_possible(place, self.range_m, gateway)
        is_wrong = says_so and self.places.is_still_wrong(gateway, not possible, self.now_s)
        if not possible:
            reason = f"a place where the {'gateway' if gateway else 'next hop'} cannot be"
            if is_wrong:
                self.complaints.add(reason, place.in_words(), self.now_s)
            else:
                self.complaints.counts[reason] += 1
        return possible


@dataclass(frozen=True)
class NodeParts(NodeBasics):
    """The parts of one node."""

    routing: IRoutes
    delivery: IDelivery
