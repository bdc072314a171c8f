"""Relief: a drone whose battery runs low is replaced before it must go (docs/endurance.md).

Whoever hovers holds a post. The one that relieves it flies to the place beside; once it has been
connected there for a while the other one flies home, where its battery is swapped. The orders are
standing orders: Departures lets drones set out one after the other, clear of each other.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Collection, Mapping, NamedTuple

from drone_mesh.drone.battery import READY_PERCENT, PowerModel
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.formations.departures import AT_PLACE_M, FlightRules
from drone_mesh.formations.posts import NEAR_M, Post, Turn, Ways, is_at, is_cut_off, leads_to
from drone_mesh.formations.relief_policies import IReliefPolicy, ReliefView
from drone_mesh.formations.reserves import Reserves, is_in_air, is_low, place_of, repairs
from drone_mesh.formations.standing_orders import StandingOrders
from drone_mesh.state.model import MeshStatus, NodeStatus, position_is_known

CARRIES_S = 5.0  # connected for so long, the new one carries the traffic of the old one
WAIT_S = 30.0  # chosen here: the most that a flight waits for others; among 50 drones 1 to 6 s
GIVE_UP_S = 90.0  # and the time of its flight: who has not come by then is replaced
SILENT_S = 10.0  # chosen here: a mesh has found other routes by then
UNHEARD_S = 1.0  # chosen here: who heard it has missed several packets before
MOST_AT_ONCE = 8  # more flights wait for each other


class ReliefRules(NamedTuple):
    """What the pads of this mesh can do, and its batteries."""

    swap_s: float = 60.0
    at_once: int = 1  # drones that all pads serve together
    hover_s: float = PowerModel.hover_s  # with a full battery, until the use of a drone is known


class _Look(NamedTuple):
    """What one update works on."""

    mesh: MeshStatus
    known: Mapping[int, NodeStatus]  # those whose places are known
    heard: Collection[int]  # who is a neighbour of anybody who is connected; empty: not known
    orders: StandingOrders
    rules: FlightRules


class _Leg(NamedTuple):
    """A flight on the way home."""

    number: int  # of its standing order
    to: Location


class Relief:
    """Watches the batteries of a mesh and orders reliefs. Not thread-safe."""

    def __init__(
        self,
        policy: IReliefPolicy | None,
        rules: ReliefRules = ReliefRules(),  # noqa: B008 (immutable)
        homes: Mapping[int, Location] | None = None,
    ) -> None:
        """`policy` None: it sends nobody anywhere.

        `homes`: where drones stand on their pads; others where they are first seen standing.
        """
        self._policy, self._rules = policy, rules
        self._reserves = Reserves(rules.hover_s, homes or {})
        self._posts: list[Post] = []
        self._homing: dict[int, _Leg | None] = {}  # ordered home; None: it is not known where
        self._silent: set[int] = set()  # they fell silent at a post, or on the way to one
        self._away: set[int] = set()  # a repair took them where they are
        self._fence = Fence()
        self.is_active = policy is not None
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
        heard: set[int] = set().union(*(node.neighbours for node in mesh.nodes if node.connected))
        look = _Look(mesh, known, heard, orders, rules)
        nodes = [node for node in known.values() if node.role != Role.GATEWAY]
        for node in nodes:
            self._reserves.look(node, mesh.stamp_s)
            leg, rests = self._homing.get(node.id), not len(node.path)
            if not is_in_air(node) or (leg and _is_off(node, leg.to, leg.number, orders)):
                self._homing.pop(node.id, None)
            elif leg and rests and self._way_home(node, look).distance_m(leg.to) > AT_PLACE_M:
                self._send_home(node.id, look)
        for post in list(self._posts):
            self._watch_holder(post, look)
        busy = {*self._homing, *(post.holder for post in self._posts)}
        busy.update(post.turn.new for post in self._posts if post.turn is not None)
        for node in nodes:
            if node.id not in busy:
                self._settle(node, look)
        self._fence = rules.fence
        for post in list(self._posts):
            if post.turn is not None:
                self._go_on(post, post.turn, look)
            holder = known.get(-1 if post.holder is None else post.holder)
            if holder is not None and self._must_go(holder):
                self._leave(post)  # it cannot wait for another one
                self._send_home(holder.id, look)
        while sum(post.turn is not None for post in self._posts) < MOST_AT_ONCE:
            if not self._begin(look):
                break

    # What the drones do ----------------------------------------------------------------------

    def _watch_holder(self, post: Post, look: _Look) -> None:
        """Whether it is still there; who was sent elsewhere takes its post along.

        Who flies for a repair leaves it behind: another drone's place is what it flies to.
        """
        if post.holder is None:
            return
        node = look.known.get(post.holder)
        flies = node is not None and len(node.path) > 0
        is_there = node is not None and leads_to(node, post.places) and not len(node.heading)
        if node is not None and (
            _is_connected(node, look)
            or (post.heard_s is not None and not self._is_in_reach(node, look))
        ):
            post.heard_s = look.mesh.stamp_s
        is_unheard = node is not None and is_there and is_cut_off(node, look.heard)
        patience_s = UNHEARD_S if is_unheard else SILENT_S
        is_mute = post.heard_s is not None and look.mesh.stamp_s - post.heard_s > patience_s
        is_lost = node is None or not node.on or node.crashed or is_mute or repairs(node)
        if node is None or is_lost or (is_low(node) and not is_there):
            if node is None or not repairs(node):
                self._silent.add(post.holder)
            self._leave(post)
        elif not is_there or not is_in_air(node):
            self._call_back(post, look)
            if not flies:
                self._posts.remove(post)  # unless it hovers: _settle
        elif not flies and (not is_at(node, *post.places) or look.rules.fence != self._fence):
            post.places = self._places_at(node, look)

    def _settle(self, node: NodeStatus, look: _Look) -> None:
        """Who hovers holds a post; who was silent does if its post is free, or goes home.

        So does who flew for a repair, but it goes home only when all posts are held.
        """
        moves = len(node.path) > 0 or not is_in_air(node)
        if repairs(node):
            self._away.add(node.id)
        elif moves and not any(leads_to(node, post.places) for post in self._posts):
            self._silent.discard(node.id)
            self._away.discard(node.id)
        if moves or not node.on or node.crashed or len(node.heading):
            return
        free = [p for p in self._posts if p.holder is None and leads_to(node, p.places, NEAR_M)]
        is_silent = node.id in self._silent - self._away
        if not free and node.id not in self._silent | self._away:
            self._posts.append(Post(self._places_at(node, look), node.id))
        elif not _is_connected(node, look):
            return
        elif free:
            free[0].holder = node.id
        elif is_silent or self._must_go(node) or all(p.holder is not None for p in self._posts):
            self._send_home(node.id, look)
        else:
            return
        self._silent.discard(node.id)
        self._away.discard(node.id)

    def _is_in_reach(self, node: NodeStatus, look: _Look) -> bool:
        """Whether somebody who is connected could hear it."""
        here, range_m = place_of(node), look.mesh.max_distance
        others = [n for n in look.known.values() if n.on and n.connected and n is not node]
        return any(place_of(other).distance_m(here) < range_m for other in others)

    def _places_at(self, node: NodeStatus, look: _Look) -> list[Location]:
        home = self._reserves.homes.get(node.id)
        return self._ways(look).places_at(node, home, look.mesh.max_distance)

    def _ways(self, look: _Look) -> Ways:
        return Ways(self._posts, look.known.values(), look.rules)

    def _must_go(self, node: NodeStatus) -> bool:
        can_go = node.id in self._reserves.homes and node.on and not len(node.path)
        return can_go and self._reserves.left_s(node) <= 0.0

    def _is_home(self, node: NodeStatus) -> bool:
        home = self._reserves.homes.get(node.id)
        return home is not None and is_at(node, home)

    def _is_ready(self, node: NodeStatus, look: _Look) -> bool:
        is_well = node.on and _is_connected(node, look) and not node.crashed
        can_fly = is_well and not node.why_not_fly
        if not can_fly or node.battery < READY_PERCENT or not self._is_home(node):
            return False
        home = self._reserves.homes[node.id]
        return not look.orders.is_bound(node.id, home, look.mesh.stamp_s)

    # Orders ----------------------------------------------------------------------------------

    def _begin(self, look: _Look) -> bool:
        """Begin the next relief; returns whether there was one to begin."""
        known, homes, ways = look.known, self._reserves.homes, self._ways(look)
        held = {p.holder: p for p in self._posts if p.holder is not None}
        busy = {*self._homing, *(post.turn.new for post in self._posts if post.turn is not None)}
        spares = sorted(homes.keys() & known.keys() - held.keys())
        ready = [d for d in spares if d not in busy and self._is_ready(known[d], look)]

        free = [post for post in self._posts if post.holder is None and post.turn is None]
        for post in free:
            for new in sorted(ready, key=lambda d: homes[d].distance_m(post.places[0])):
                to = ways.to(homes[new], post)
                if to is not None:
                    self._send(post, new, to, look)
                    return True

        at_rest = [d for d in held.keys() & known.keys() if not len(known[d].path)]
        flights_s = {d: self._reserves.flight_s(d, place_of(known[d])) for d in at_rest}
        due = [d for d in at_rest if held[d].turn is None]
        waits_s = WAIT_S + CARRIES_S
        left_s = {d: self._reserves.left_s(known[d]) - flights_s[d] - waits_s for d in due}
        # Out and home, with one wait: reckoned too long, no spare would ever stay full in reserve.
        flight_s = sum(flights_s.values()) / max(1, len(flights_s))
        away_s = WAIT_S + 2.0 * (CARRIES_S + flight_s) + self._rules.swap_s
        view = ReliefView(
            left_s=dict(sorted(left_s.items(), key=lambda item: (item[1], item[0]))),
            ready=ready,
            spares=spares,
            interval_s=max(self._rules.swap_s / self._rules.at_once, away_s / max(1, len(spares))),
            places={n: node.position for n, node in known.items() if node.on},
            gateways=[n for n, node in known.items() if node.role == Role.GATEWAY],
            range_m=look.mesh.max_distance,
            can_fly=lambda new, old: new in homes and ways.to(homes[new], held[old]) is not None,
        )
        pair = self._policy.choose(view) if self._policy else None
        to = None if pair is None else ways.to(homes[pair.new], held[pair.old])
        if pair is None or to is None:
            return False
        if pair.new in held:
            self._leave(held[pair.new])
        self._send(held[pair.old], pair.new, to, look)
        return True

    def _send(self, post: Post, new: int, to: Location, look: _Look) -> None:
        what = "fills a gap" if post.holder is None else f"relieves drone {post.holder}"
        now_s = look.mesh.stamp_s
        number = look.orders.give(f"drone {new} {what}", {new: to}, now_s, relieves=post.holder)
        post.turn = Turn(new, to, now_s, number)

    def _go_on(self, post: Post, turn: Turn, look: _Look) -> None:
        new, now_s = look.known.get(turn.new), look.mesh.stamp_s
        if new is None or not new.on or new.crashed:
            self._end(post, look)
            self._silent.add(turn.new)
        elif _is_off(new, turn.to, None if turn.arrived else turn.number, look.orders):
            self._end(post, look)
        elif now_s - turn.begin_s > GIVE_UP_S + self._reserves.flight_s(turn.new, turn.to):
            self._call_back(post, look)
        elif not is_at(new, turn.to):
            turn.there_s = None
        else:
            turn.arrived = True
            since_s = now_s if turn.there_s is None else turn.there_s
            is_connected = _is_connected(new, look)
            turn.there_s = since_s if is_connected else None
            if is_connected and now_s - since_s >= CARRIES_S:
                self._end(post, look)
                old, post.holder, post.heard_s = post.holder, turn.new, now_s
                if old is not None:
                    self.reliefs += 1
                    self._send_home(old, look)

    def _leave(self, post: Post) -> None:
        """Nobody holds it (yet). Which is free for the longest comes first."""
        post.holder = post.heard_s = None
        self._posts.remove(post)
        self._posts.append(post)

    def _end(self, post: Post, look: _Look) -> None:
        if post.turn is not None:
            look.orders.end(post.turn.number)
            post.turn = None
        if post.holder is None:
            self._leave(post)

    def _call_back(self, post: Post, look: _Look) -> None:
        """Nobody has to come to this post."""
        new = None if post.turn is None else look.known.get(post.turn.new)
        self._end(post, look)
        if new is not None and not self._is_home(new):
            self._send_home(new.id, look)

    def _send_home(self, drone: int, look: _Look) -> None:
        leg = None
        if drone in self._reserves.homes:
            to = self._way_home(look.known[drone], look)
            name = f"drone {drone} goes home"
            leg = _Leg(look.orders.give(name, {drone: to}, look.mesh.stamp_s), to)
        self._homing[drone] = leg  # without a known home too: it holds no post any more

    def _way_home(self, node: NodeStatus, look: _Look) -> Location:
        home = self._reserves.homes[node.id]
        return home if len(node.path) else self._ways(look).home(node, home, look.mesh.max_distance)

    # For a restart ---------------------------------------------------------------------------

    def saved(self) -> dict[str, Any]:
        """Its posts and reliefs, as plain values that `restore` reads."""
        return {
            "posts": list(map(asdict, self._posts)),
            "homing": list(self._homing.items()),
            "silent": sorted(self._silent),
            "away": sorted(self._away),
            "homes": list(self._reserves.homes.items()),
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on with what `saved` returned. Raises KeyError, TypeError or ValueError."""
        posts = [Post.restored(post) for post in saved["posts"]]
        self._homing = {
            int(drone): leg and _Leg(int(leg[0]), Location(*leg[1]))
            for drone, leg in saved["homing"]
        }
        self._reserves.homes.update({int(n): Location(*home) for n, home in saved["homes"]})
        self._posts, self._silent, self._away = posts, set(saved["silent"]), set(saved["away"])


def _is_connected(node: NodeStatus, look: _Look) -> bool:
    return node.connected and not is_cut_off(node, look.heard)


def _is_off(node: NodeStatus, to: Location, number: int | None, orders: StandingOrders) -> bool:
    """Whether somebody else has sent it elsewhere, or a repair took it there.

    `number`: the order that sends it there; None: it has been there.
    """
    is_ours = number is not None and orders.stands(number)
    return not is_ours and not leads_to(node, [to])
