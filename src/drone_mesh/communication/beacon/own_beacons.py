"""OwnBeacons: what the next beacon of this node says (docs/beacons.md, "Beacons")."""

from __future__ import annotations

from drone_mesh.communication.beacon.nodes_below import NodesBelow
from drone_mesh.communication.beacon.packets import Beacon, Motion
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.control.places import CommonFrame
from drone_mesh.communication.interfaces import NO_ROUTE, IMeshSeals
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location

GATEWAY_PLACE_EVERY = 4  # beacons: one of so many carries the gateway's place
DIGEST_EVERY = 4  # beacons: one of so many carries the digest of the origin
SEALED_ROOM = 20  # bytes of a beacon with a seal


class OwnBeacons:
    """Composes the beacons of one node: what does not fit one takes turns."""

    def __init__(
        self,
        seals: IMeshSeals,
        frame: CommonFrame,
        routes: BeaconRoutes,
        below: NodesBelow,
        step_m: float,
    ) -> None:
        """A node within `step_m` of where it is expected is there, and so is a gateway."""
        self._frame, self._routes, self._below, self._step_m = frame, routes, below, step_m
        self.room = messages.BODY_BYTES - seals.reserved_bytes(MessageType.BEACON)
        self.asks = True  # whether the next one asks for those of the neighbours
        self._told_place: Location | None = None  # what this node's beacons have said
        self._sent = 0
        self._shown: tuple[float, Motion] | None = None  # what the others expect of this drone

    def next_body(self, interval_s: float) -> bytes:
        """Its `room` bytes, now that it is due; the one after it comes in about `interval_s`."""
        routes = self._routes
        self._sent += 1
        if routes.is_root:
            routes.next_number()
        gateway, hops, offline = routes.shown
        beacon = Beacon(
            gateway,
            routes.number,
            hops,
            routes.parent,
            routes.ancestors,
            interval_s,
            routes.motion,
            self._next_gateway_place(),
            self._frame.digest if self.asks or self._is_digests_turn() else 0,
            self.asks or hops == NO_ROUTE,
            offline=offline,
        )
        self.asks = False
        below, is_sealed = self._below, self.room <= SEALED_ROOM  # a seal leaves room for less
        room, turn = beacon.room_below(self.room), self._sent % 2 == 0
        if room < 0 or (is_sealed and turn and room < len(below.ids())):
            beacon = beacon._replace(motion=None)
        beacon = beacon._replace(below=below.to_announce(beacon.room_below(self.room)))
        beacon = beacon._replace(near=below.to_show(beacon.room_near(self.room)))
        if beacon.motion is not None:
            self._shown = routes.now_s, beacon.motion
        return beacon.to_body(self.room)

    def mislead(self, motion: Motion) -> bool:
        """Whether the others expect this drone elsewhere, after the latest; reported once."""
        if self._shown is None:
            return False
        shown_s, shown = self._shown
        if shown.apart_m(self._routes.now_s - shown_s, motion, 0.0) <= self._step_m:
            return False
        self._shown = None
        return True

    def _is_digests_turn(self) -> bool:
        """With a seal, a beacon has room for it and the gateway's place, or for its own place."""
        turn = 0 if self.room <= SEALED_ROOM else 1
        return self._sent % DIGEST_EVERY == turn

    def _next_gateway_place(self) -> Location | None:
        """The gateway's place, if it is this beacon's turn to spread it."""
        place, told = self._routes.gateway_place, self._told_place
        if self._routes.is_root or place is None:
            return None
        every = GATEWAY_PLACE_EVERY
        if told is None or told.distance_m(place) > self._step_m:
            every = 2 if self.room <= SEALED_ROOM else 1  # with a seal, instead of its own
        if self._sent % every:
            return None
        self._told_place = place
        return place
