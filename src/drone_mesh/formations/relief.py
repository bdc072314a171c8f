"""Relief: a drone whose battery runs low is replaced before it must go (docs/endurance.md).

Whoever hovers holds a post. The one that relieves it flies to the place beside; once it has been
connected there for a while the other one flies home, where its battery is swapped. The orders are
standing orders: Departures lets drones set out one after the other, clear of each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Iterable, Mapping, NamedTuple, Sequence

from drone_mesh.drone.battery import LAND_AT_PERCENT, READY_PERCENT, PowerModel
from drone_mesh.drone.flight_path import SPEED_M_S
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.formations.airspace import Airspace
from drone_mesh.formations.departures import AT_PLACE_M, FlightRules
from drone_mesh.formations.relief_policies import IReliefPolicy, ReliefView
from drone_mesh.formations.standing_orders import StandingOrders
from drone_mesh.state.model import MeshStatus, NodeStatus, position_is_known

BESIDE_M = 1.5  # between the two places of a post: the clearance, and what physics moves a drone
CARRIES_S = 5.0  # connected for so long, the new one carries the traffic of the old one
WAIT_S = 30.0  # chosen here: for other flights, before both flights of a relief
MARGIN_PERCENT = 2.0  # above LAND_AT_PERCENT when it is home
GIVE_UP_S = 90.0  # a drone that has not set out, or has not come, is replaced by another one
MOST_AT_ONCE = 8  # more flights wait for each other
LEAST_USE_PERCENT = 2.0  # less says nothing: reports carry whole percents
IN_AIR_M = 0.3
_MOST_PLACES = 255  # of posts, in an Airspace
_WAYS = 8  # directions in which the place beside is searched


class ReliefRules(NamedTuple):
    """What the pads of this mesh can do, and its batteries."""

    swap_s: float = 60.0
    at_once: int = 1  # drones that all pads serve together
    hover_s: float = PowerModel.hover_s  # with a full battery, until the use of a drone is known


@dataclass
class _Use:
    """How fast a drone in the air empties its battery: from its take-off on."""

    begin_s: float
    begin_percent: float
    percent: float
    now_s: float

    def per_s(self, usual: float) -> float:
        used, passed_s = self.begin_percent - self.percent, self.now_s - self.begin_s
        return used / passed_s if used >= LEAST_USE_PERCENT and passed_s > 0.0 else usual


@dataclass
class _Turn:
    """One drone relieves another one, or takes an empty post."""

    places: Sequence[Location]  # of the post
    old: int | None
    new: int
    to: Location
    begin_s: float
    number: int = 0  # of its standing order
    arrived: bool = False  # it has been there
    there_s: float | None = None  # since when it is connected there


class Relief:
    """Watches the batteries of a mesh and orders reliefs. Not thread-safe."""

    def __init__(
        self,
        policy: IReliefPolicy,
        rules: ReliefRules = ReliefRules(),  # noqa: B008 (immutable)
        homes: Mapping[int, Location] | None = None,
    ) -> None:
        """`homes`: where drones stand on their pads; others where they are first seen standing."""
        self._policy, self._rules = policy, rules
        self._homes = dict(homes or {})
        self._posts: dict[int, Sequence[Location]] = {}  # by holder: its place and the one beside
        self._empty: list[Sequence[Location]] = []  # posts without a holder
        self._left: dict[int, Sequence[Location]] = {}  # by drone that fell silent at its post
        self._turns: list[_Turn] = []
        self._homing: dict[int, int | None] = {}  # ordered home, by which order
        self._uses: dict[int, _Use] = {}
        self.is_active = policy.is_active
        self.reliefs = 0  # drones that left when another one carried their traffic

    def update(
        self,
        mesh: MeshStatus,
        orders: StandingOrders,
        rules: FlightRules = FlightRules(),  # noqa: B008 (immutable)
    ) -> None:
        """Compare the charges with the state of the mesh, and give or withdraw orders.

        Of `orders` it needs the lock only for moments: to look for ways takes long.
        """
        if not self.is_active:
            return
        known = {node.id: node for node in mesh.nodes if position_is_known(node)}
        nodes = {n: node for n, node in known.items() if node.role != Role.GATEWAY}
        self._look(nodes, mesh, orders, rules)
        for turn in list(self._turns):
            self._go_on(turn, nodes, orders, mesh.stamp_s)
        for drone in [d for d in self._posts.keys() & nodes.keys() if self._must_go(nodes[d])]:
            post, turns = self._posts.pop(drone), [t for t in self._turns if t.old == drone]
            for turn in turns:
                turn.old = None  # it cannot wait for the other one
            self._empty += [] if turns else [post]
            self._send_home(drone, orders, mesh.stamp_s)
        while len(self._turns) < MOST_AT_ONCE and self._begin(known, orders, mesh, rules):
            pass

    # What the drones do ----------------------------------------------------------------------

    def _busy(self) -> set[int]:
        drones = {drone for turn in self._turns for drone in (turn.old, turn.new)}
        return {drone for drone in drones if drone is not None}

    def _look(
        self,
        nodes: Mapping[int, NodeStatus],
        mesh: MeshStatus,
        orders: StandingOrders,
        rules: FlightRules,
    ) -> None:
        """Learn homes, use and posts."""
        busy = self._busy()
        for drone in self._posts.keys() - nodes.keys() - busy:
            self._left[drone] = self._posts.pop(drone)
            self._empty.append(self._left[drone])
        for drone, node in nodes.items():
            here, flies = Location.from_vector(node.position), bool(len(node.path))
            in_air = flies or here.height > IN_AIR_M
            self._note_use(node, in_air, mesh.stamp_s)
            if len(node.home):
                self._homes[drone] = Location.from_vector(node.home)
            if not in_air:
                self._homes.setdefault(drone, here)
                self._left.pop(drone, None)
            if not in_air or self._is_called_away(node, orders):
                self._homing.pop(drone, None)
            if drone in busy or drone in self._homing or flies:
                continue
            if node.on and in_air and not node.crashed and not len(node.heading):
                if _is_at_one(node, self._posts.get(drone, ())):
                    continue
                if _is_at_one(node, self._left.get(drone, ())):
                    self._come_back(drone, orders, mesh.stamp_s)
                else:
                    self._posts[drone] = self._post_at(here, drone, mesh, rules)
            elif drone in self._posts:
                post = self._posts.pop(drone)
                if not node.on or node.crashed or self._is_low(node):  # nobody ordered it down
                    self._empty.append(post)
                    self._left[drone] = post

    def _come_back(self, drone: int, orders: StandingOrders, now_s: float) -> None:
        """It was silent at its post: nobody came, somebody is coming, or holds it meanwhile."""
        post = self._left.pop(drone)
        coming = next((turn for turn in self._turns if turn.places == post), None)
        if post in self._empty:
            self._empty.remove(post)
        elif coming is None or coming.old is not None:
            self._send_home(drone, orders, now_s)
            return
        else:
            coming.old = drone
        self._posts[drone] = post

    def _is_called_away(self, node: NodeStatus, orders: StandingOrders) -> bool:
        """Whether somebody else has sent it elsewhere on its way home."""
        number = self._homing.get(node.id)
        is_over = number is not None and not orders.stands(number)
        return is_over and not _leads_to(node, [self._homes[node.id]])

    def _note_use(self, node: NodeStatus, in_air: bool, now_s: float) -> None:
        use = self._uses.get(node.id)
        if not in_air:
            self._uses.pop(node.id, None)
        elif use is None or node.battery > use.percent:
            self._uses[node.id] = _Use(now_s, node.battery, node.battery, now_s)
        else:
            use.percent, use.now_s = node.battery, now_s

    def _post_at(
        self, here: Location, drone: int, mesh: MeshStatus, rules: FlightRules
    ) -> Sequence[Location]:
        """This place and one beside it that keeps as many links as possible.

        It is not on the way home.
        """
        others = [
            Location.from_vector(node.position)
            for node in mesh.nodes
            if node.id != drone and node.on and position_is_known(node)
        ]
        taken = [p for post in [*self._posts.values(), *self._empty] for p in post if p != here]
        near = [other for other in others if other.distance_m(here) < mesh.max_distance]
        home = self._homes.get(drone)
        best, most = None, (-1, -math.inf)
        for way in range(_WAYS):
            angle = 2.0 * math.pi * way / _WAYS
            north_m, east_m = BESIDE_M * math.sin(angle), BESIDE_M * math.cos(angle)
            place = Location(here.latitude + north_m, here.longitude + east_m, here.height)
            beside = Airspace(rules.sway_m, rules.clearance_m)
            beside.add_resting(0, place.to_vector())
            if any(place.distance_m(other) < BESIDE_M for other in [*others, *taken]) or (
                home is not None and self._met(beside, here, home, rules)
            ):
                continue
            away_m = [place.distance_m(other) for other in near]
            kept = sum(metres < mesh.max_distance for metres in away_m), -max(away_m, default=0.0)
            if kept > most:
                best, most = place, kept
        return (here,) if best is None else (here, best)

    def _left_s(self, node: NodeStatus) -> float:
        """Until it must set out for home; infinity: its charge is not known."""
        if math.isnan(node.battery):
            return math.inf
        usual = 100.0 / self._rules.hover_s
        use = self._uses.get(node.id)
        percent = node.battery - LAND_AT_PERCENT - MARGIN_PERCENT
        return percent / (use.per_s(usual) if use else usual) - self._flight_s(node.id, node)

    def _flight_s(self, drone: int, node: NodeStatus) -> float:
        """From the home of a drone to where this one is."""
        home = self._homes.get(drone)
        here = Location.from_vector(node.position)
        return 0.0 if home is None else home.distance_m(here) / SPEED_M_S

    def _is_low(self, node: NodeStatus) -> bool:
        return node.battery <= LAND_AT_PERCENT + MARGIN_PERCENT

    def _must_go(self, node: NodeStatus) -> bool:
        return node.id in self._homes and node.on and not len(node.path) and self._left_s(node) <= 0

    def _is_ready(self, node: NodeStatus) -> bool:
        is_home = node.id in self._homes and _is_at(node, self._homes[node.id])
        can_fly = node.on and node.connected and not node.crashed and not node.why_not_fly
        return is_home and can_fly and node.battery >= READY_PERCENT

    # Orders ----------------------------------------------------------------------------------

    def _begin(
        self,
        known: Mapping[int, NodeStatus],
        orders: StandingOrders,
        mesh: MeshStatus,
        rules: FlightRules,
    ) -> bool:
        """Begin the next relief; returns whether there was one to begin."""
        busy = self._busy() | self._homing.keys()
        spares = sorted(self._homes.keys() & known.keys() - self._posts.keys())
        ready = [
            drone
            for drone in spares
            if drone not in busy
            and self._is_ready(known[drone])
            and not orders.is_bound(drone, self._homes[drone], mesh.stamp_s)
        ]
        places = [p for post in [*self._posts.values(), *self._empty] for p in post]
        fixed = Airspace(rules.sway_m, rules.clearance_m)
        for count, place in enumerate(places[:_MOST_PLACES]):
            fixed.add_resting(count, place.to_vector())
        taken = [Location.from_vector(node.position) for node in known.values()]

        def way_to(new: int, post: Sequence[Location]) -> Location | None:
            """The place of a post that is free, and to which the way from its home is clear.

            It flies home on the same way.
            """
            for place in post:
                if all(place.distance_m(other) > BESIDE_M / 2 for other in taken):
                    met = self._met(fixed, self._homes[new], place, rules)
                    if all(count < len(places) and places[count] == place for count in met):
                        return place
            return None

        for post in self._empty:
            for new in ready:
                to = way_to(new, post)
                if to is not None:
                    self._empty.remove(post)
                    self._send(_Turn(post, None, new, to, mesh.stamp_s), orders)
                    return True

        held = self._posts.keys() & known.keys()
        waits_s = {d: WAIT_S + CARRIES_S + self._flight_s(d, known[d]) for d in held}
        left_s = {d: self._left_s(known[d]) - waits_s[d] for d in waits_s.keys() - busy}
        flight_s = sum(waits_s.values()) / max(1, len(waits_s))
        cycle_s = 2.0 * flight_s + self._rules.swap_s
        view = ReliefView(
            left_s=dict(sorted(left_s.items(), key=lambda item: (item[1], item[0]))),
            ready=ready,
            spares=spares,
            interval_s=max(self._rules.swap_s / self._rules.at_once, cycle_s / max(1, len(spares))),
            places={n: node.position for n, node in known.items() if node.on},
            gateways=[n for n, node in known.items() if node.role == Role.GATEWAY],
            range_m=mesh.max_distance,
            can_fly=lambda new, old: way_to(new, self._posts[old]) is not None,
        )
        pair = self._policy.choose(view)
        to = None if pair is None else way_to(pair.new, self._posts[pair.old])
        if pair is None or to is None:
            return False
        if pair.new in self._posts:
            self._empty.append(self._posts.pop(pair.new))
        self._send(_Turn(self._posts[pair.old], pair.old, pair.new, to, mesh.stamp_s), orders)
        return True

    def _met(
        self, airspace: Airspace, start: Location, goal: Location, rules: FlightRules
    ) -> Sequence[int]:
        """Those in the airspace to which a flight would come too near; it may not be possible."""
        path = rules.plan_flight(start.to_vector(), goal.to_vector(), 0.0, SPEED_M_S)
        return [_MOST_PLACES] if path is None else airspace.in_the_way(_MOST_PLACES, path)

    def _send(self, turn: _Turn, orders: StandingOrders) -> None:
        what = "fills a gap" if turn.old is None else f"relieves drone {turn.old}"
        name, goals = f"drone {turn.new} {what}", {turn.new: turn.to}
        turn.number = orders.give(name, goals, turn.begin_s, relieves=turn.old)
        self._turns.append(turn)

    def _go_on(
        self, turn: _Turn, nodes: Mapping[int, NodeStatus], orders: StandingOrders, now_s: float
    ) -> None:
        new, old = nodes.get(turn.new), nodes.get(-1 if turn.old is None else turn.old)
        if new is None or not new.on or new.crashed:
            self._give_up(turn, orders)
            self._left[turn.new] = turn.places
        elif self._is_off(turn, new, orders):
            self._give_up(turn, orders)
        elif (old and self._has_left(turn, old)) or now_s - turn.begin_s > GIVE_UP_S:
            self._give_up(turn, orders)
            if not self._is_home(new):
                self._send_home(turn.new, orders, now_s)
        elif not (_is_at(new, turn.to) and not len(new.path)):
            turn.there_s = None
        else:
            turn.arrived = True
            since_s = now_s if turn.there_s is None else turn.there_s
            turn.there_s = since_s if new.connected else None
            if new.connected and now_s - since_s >= CARRIES_S:
                self._take_over(turn, old, orders, now_s)

    def _is_off(self, turn: _Turn, new: NodeStatus, orders: StandingOrders) -> bool:
        """Whether somebody else has sent the new one elsewhere, or a repair took it there."""
        is_ours = not turn.arrived and orders.stands(turn.number)
        return not is_ours and not _leads_to(new, [turn.to])

    def _has_left(self, turn: _Turn, old: NodeStatus) -> bool:
        """Whether the old one was sent elsewhere: it takes its post along.

        One that has failed, or comes down by itself, leaves it behind.
        """
        can_stay = old.on and not old.crashed and not self._is_low(old)
        return can_stay and not _leads_to(old, turn.places)

    def _give_up(self, turn: _Turn, orders: StandingOrders) -> None:
        self._turns.remove(turn)
        orders.end(turn.number)
        if turn.old is None:
            self._empty.append(turn.places)

    def _take_over(
        self, turn: _Turn, old: NodeStatus | None, orders: StandingOrders, now_s: float
    ) -> None:
        self._turns.remove(turn)
        orders.end(turn.number)
        self._posts[turn.new] = turn.places
        if turn.old is not None:
            self._posts.pop(turn.old, None)
            self.reliefs += 1
            if old is not None and old.on and not old.crashed:
                self._send_home(turn.old, orders, now_s)
            else:
                self._left[turn.old] = turn.places

    def _is_home(self, node: NodeStatus) -> bool:
        return node.id in self._homes and _is_at(node, self._homes[node.id])

    def _send_home(self, drone: int, orders: StandingOrders, now_s: float) -> None:
        home, number = self._homes.get(drone), None
        if home is not None:
            number = orders.give(f"drone {drone} goes home", {drone: home}, now_s)
        self._homing[drone] = number  # without a known home too: it holds no post any more

    # For a restart ---------------------------------------------------------------------------

    def saved(self) -> dict[str, Any]:
        """Its posts and reliefs, as plain values that `restore` reads."""
        return {
            "posts": list(self._posts.items()),
            "empty": list(self._empty),
            "left": list(self._left.items()),
            "homing": list(self._homing.items()),
            "turns": [dict(vars(turn)) for turn in self._turns],
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on with what `saved` returned. Raises KeyError, TypeError or ValueError."""
        self._posts = {int(drone): _places(post) for drone, post in saved["posts"]}
        self._empty = [_places(post) for post in saved["empty"]]
        self._left = {int(drone): _places(post) for drone, post in saved["left"]}
        self._homing = dict(saved["homing"])
        self._turns = [
            _Turn(**{**turn, "places": _places(turn["places"]), "to": Location(*turn["to"])})
            for turn in saved["turns"]
        ]


def _places(post: Iterable[Iterable[float]]) -> Sequence[Location]:
    return tuple(Location(*place) for place in post)


def _leads_to(node: NodeStatus, places: Iterable[Location]) -> bool:
    """Whether it flies to one of these places, or is about there."""
    end = Location.from_vector(node.path[-3:] if len(node.path) else node.position)
    return any(end.distance_m(place) <= BESIDE_M / 2 for place in places)


def _is_at_one(node: NodeStatus, post: Sequence[Location]) -> bool:
    return any(_is_at(node, place) for place in post)


def _is_at(node: NodeStatus, place: Location, within_m: float = AT_PLACE_M) -> bool:
    return Location.from_vector(node.position).distance_m(place) <= within_m
