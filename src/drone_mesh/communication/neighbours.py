"""What a node knows of the nodes in direct reach: when it heard them, where they are, who moves.

The table belongs to the control plane, which makes it; the parts of a node write here, too.
"""

from __future__ import annotations

import itertools
import math
from typing import Final, Iterable, Iterator

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.timing import Medium
from drone_mesh.drone.location import Location, metres_between

STEP: Final = 0.1  # of the range: positions of satellites err by far less
REPORTS: Final = 3.0  # one may be lost
FLIGHT_S: Final = 10.0  # a repair flight asks for places each second, and some are lost


class _Track:
    """What one node's reports show."""

    __slots__ = ("before", "moves_s", "place", "stepped_s")

    def __init__(
        self,
        place: Location,
        before: Location | None = None,
        stepped_s: float = -math.inf,
        moves_s: float = -math.inf,
    ) -> None:
        self.place = place  # from where its next step counts
        self.before = before  # its last step
        self.stepped_s = stepped_s
        self.moves_s = moves_s  # when it was last at a third place


class SeenMotion:
    """Tells motion from flights for the mesh by the places that the nodes report.

    A flight for the mesh is reported with its goal, so it is one step from one place to another. A
    node that takes a second one within `within_s`, to a third place, moves by itself.
    """

    def __init__(self, range_m: float, asked_s: float) -> None:
        """`asked_s`: a connected router asks its next hop for its place so often."""
        self._step_m = STEP * range_m
        self.within_s = REPORTS * asked_s
        self._tracks: dict[int, _Track] = {}
        self._moved_s = -math.inf  # no node was seen to move later
        self._flew_s: dict[int, float] = {}  # for a repair

    def reported(self, node: int, place: Location, now_s: float) -> None:
        """`node` is at `place`, or flies there."""
        track = self._tracks.get(node)
        flew_s = self._flew_s  # mostly empty
        if track is None or (flew_s and now_s - flew_s.get(node, -math.inf) < FLIGHT_S):
            self._tracks[node] = _Track(place)
            return
        step_m = self._step_m
        if metres_between(place, track.place) <= step_m:
            return
        before = track.before
        is_third = before is not None and metres_between(place, before) > step_m
        moves = is_third and now_s - track.stepped_s <= self.within_s
        moves_s = track.moves_s
        if moves:
            moves_s = self._moved_s = now_s
        self._tracks[node] = _Track(place, track.place, now_s, moves_s)

    def flies_for_repair(self, node: int, now_s: float) -> None:
        """`node` asks for places on its flight."""
        self._flew_s[node] = now_s

    def forget(self, node: int) -> None:
        """`node` flies for the mesh from where it was."""
        self._tracks.pop(node, None)

    def moved_since(self, since_s: float) -> bool:
        """Whether any node was seen to move by itself since then."""
        if self._moved_s < since_s:  # mostly, while drones stand
            return False
        return any(track.moves_s >= since_s for track in self._tracks.values())


NAMED_AFTER_DEATH_S: Final = 60.0  # lists of six hops had a dead node for up to 59 s


class HeardPlace:
    """The place that a node reported."""

    __slots__ = ("heard_s", "place")

    def __init__(self, place: Location, heard_s: float) -> None:
        self.place, self.heard_s = place, heard_s


class Neighbours:
    """When each neighbour was last heard, which gateway it uses, and the places of nodes.

    The gateway and place of a node are kept when it is no longer a neighbour.
    """

    def __init__(self, medium: Medium, check_period_s: float, range_m: float) -> None:
        """Neighbours that fall silent within a check period do so together.

        Where a loss may be noticed several checks later, the time of a neighbour's last packet
        says more. `range_m`: of the radio, as far as the node knows.
        """
        self._check_period_s = check_period_s
        self._noticed_late = medium.policy.losses_noticed_late
        self.motion = SeenMotion(range_m, check_period_s * max(1.0, medium.place_periods))
        self._heard_s: dict[int, float] = {}
        self._deaf: set[int] = set()  # heard, but no neighbours: they do not hear this node
        self._fell_silent_s: dict[int, float] = {}  # when each of those lost did so
        self._out_of_reach: set[int] = set()  # of these
        self._stands_since_s = -math.inf  # infinity: this node flies
        self._gateways: dict[int, int] = {}
        self._hops: dict[int, int] = {}
        self.places: dict[int, HeardPlace] = {}  # reported, by node; changes only here
        self._goals_s: dict[int, float] = {}  # when those in flight told their goal, their place
        self._rested_m: dict[int, float] = {}  # how high each was when it was seen at rest last
        self._left: dict[int, Location | None] = {}  # where each was before its latest flight
        self._seen: dict[int, HeardPlace] = {}  # where these were seen since, perhaps for good
        self.silent = False  # all neighbours (2 or more) fell silent together; none heard since

    def heard(self, node: int, now_s: float) -> bool:
        """A packet arrived from `node`. Returns whether it is a new neighbour."""
        is_new = node not in self._heard_s
        if is_new and node in self._deaf:
            return False
        self._heard_s[node] = now_s
        if is_new:
            self._fell_silent_s.pop(node, None)
            self._out_of_reach.discard(node)
            self.silent = False
        return is_new

    def lost(self, node: int, now_s: float) -> bool:
        """`node` is out of reach. Returns whether it was a neighbour."""
        self._deaf.discard(node)
        heard_s = self._heard_s.pop(node, None)
        if heard_s is None:
            return False
        if heard_s >= self._stands_since_s:  # otherwise this node flew away from it
            self._fell_silent_s[node] = heard_s if self._noticed_late else now_s
        if not self._heard_s and self._fell_silent_s:
            since_s = max(self._fell_silent_s.values()) - self._check_period_s
            self.silent = sum(at_s > since_s for at_s in self._fell_silent_s.values()) >= 2
        return True

    def forget(self, node: int) -> None:
        """Remove `node` from the neighbours, without counting it as fallen silent."""
        self._heard_s.pop(node, None)

    def is_deaf(self, node: int) -> bool:
        """Mark `node` as deaf to this node until `hears` is called; it does not count as silent.

        Returns whether it was a neighbour.
        """
        self._deaf.add(node)
        return self._heard_s.pop(node, None) is not None

    def hears(self, node: int) -> None:
        """`node` hears this one."""
        self._deaf.discard(node)

    def deaf(self) -> frozenset[int]:
        """The nodes that are heard and do not hear this one."""
        return frozenset(self._deaf)

    def takes_off(self, by_order: bool) -> None:
        """This node flies away, so that neighbours it stops hearing do not count as silent.

        A repair flight does not end a silence that was before.
        """
        self._stands_since_s = math.inf
        self._fell_silent_s.clear()
        self._out_of_reach.clear()
        self.silent = self.silent and not by_order

    def stands(self, now_s: float) -> None:
        """This node no longer flies."""
        self._stands_since_s = now_s

    def forget_all(self) -> None:
        """This node moved and may have other neighbours."""
        self._heard_s.clear()
        self._deaf.clear()
        self._fell_silent_s.clear()
        self._out_of_reach.clear()

    def ids(self) -> frozenset[int]:
        return frozenset(self._heard_s)

    def note_known_elsewhere(self, nodes: Iterable[int], now_s: float) -> None:
        """Another node knows these: one that fell silent long ago lives, its link here failed."""
        for node in nodes if self._fell_silent_s else ():
            if now_s - self._fell_silent_s.get(node, math.inf) > NAMED_AFTER_DEATH_S:
                self._out_of_reach.add(node)

    def out_of_reach(self) -> frozenset[int]:
        """Former neighbours that live, but no longer have a link to this node where it stands.

        While it hears none, nobody tells it who died: all that fell silent.
        """
        return frozenset(self._out_of_reach if self._heard_s else self._fell_silent_s)

    def heard_s(self) -> dict[int, float]:
        """A copy: for each neighbour the time of its last packet, in seconds."""
        return dict(self._heard_s)

    def last_heard_s(self, node: int, otherwise: float) -> float:
        """When `node` was last heard; `otherwise` if it is not a neighbour."""
        return self._heard_s.get(node, otherwise)

    # Reported by the nodes themselves--------------------------------------------------------

    def set_gateway(self, node: int, gateway: int) -> None:
        """`node` is connected to `gateway`."""
        self._gateways[node] = gateway

    def gateway_of(self, node: int) -> int:
        """The gateway that `node` reported last, or NO_ROUTE."""
        return self._gateways.get(node, NO_ROUTE)

    def set_hops(self, node: int, hops: int) -> None:
        """`node` introduced itself with `hops` to its gateway; 255: it has none."""
        self._hops[node] = hops

    def hops_of(self, node: int) -> int:
        """The hops that `node` reported last; 255: none."""
        return self._hops.get(node, NO_ROUTE)

    def set_place(self, node: int, place: Location, heard_s: float, is_goal: bool = False) -> None:
        """`node`, a neighbour or not, was at `place` at `heard_s`; older information is ignored.

        Or, if `is_goal`, it flies there: that counts as its place from then on.
        """
        known = self.places.get(node)
        if known is None or heard_s >= known.heard_s:
            told_s = self._goals_s.pop(node, None) if self._goals_s else None
            if self._seen:
                self._seen.pop(node, None)
            if is_goal:
                self._goals_s[node] = heard_s
                flies_on = told_s is not None and (
                    heard_s - told_s < FLIGHT_S or known is None or known.place == place
                )
                if not flies_on:  # a landing may be unheard
                    self._left[node] = None if known is None else known.place
            self.places[node] = HeardPlace(place, heard_s)
            if known is None or known.place != place:  # most nodes stand
                self.motion.reported(node, place, heard_s)

    def passes(self, node: int, place: Location, heard_s: float) -> None:
        """Note that `node` was at `place`; while it flies, its announced goal counts, too.

        It may have ended its flight there, and fallen silent. What others heard shortly before this
        node saw it may be the goal of that flight, which they do not pass on as such.
        """
        told_s = self._goals_s.get(node) if self._goals_s else None
        known = self.places.get(node)
        if told_s is None and known is not None and 0.0 < known.heard_s - heard_s < FLIGHT_S:
            self._seen[node] = HeardPlace(place, heard_s)
        elif told_s is None or heard_s - told_s > FLIGHT_S:
            self.set_place(node, place, heard_s)
        elif heard_s > told_s:
            self._seen[node] = HeardPlace(place, heard_s)

    def at_rest(self, node: int, place: Location, flies: bool) -> Location:
        """Where to look for `node`, seen at `place`: in flight, as high as it was at rest last."""
        if not flies:
            self._rested_m[node] = place.height
            return place
        height_m = self._rested_m.get(node, place.height)
        return place if height_m == place.height else place._replace(height=height_m)

    def place_of(self, node: int) -> HeardPlace | None:
        """The last reported place of `node`."""
        return self.places.get(node)

    def goal_of(self, node: int, now_s: float) -> Location | None:
        """Where `node` flies, if it told so a moment ago."""
        told_s = self._goals_s.get(node, -math.inf)
        return self.places[node].place if now_s - told_s < FLIGHT_S else None

    def flies_m(self, node: int) -> float:
        """How far `node` flies from where it stood to the goal that it told; infinity: unknown."""
        left = self._left.get(node)
        return math.inf if left is None else left.distance_m(self.places[node].place)

    def under_way(self, now_s: float) -> Iterator[tuple[int, Location | None, Location]]:
        """Who told its goal a moment ago, from where it flies (None: unknown), and to where."""
        for node, told_s in self._goals_s.items():
            if now_s - told_s < FLIGHT_S:
                yield node, self._left[node], self.places[node].place

    def taken(self) -> Iterator[tuple[int, HeardPlace]]:
        """Where each node may be: its reported place, and where it was seen on the way there."""
        return itertools.chain(self.places.items(), self._seen.items())
