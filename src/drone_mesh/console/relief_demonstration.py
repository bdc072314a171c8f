"""ReliefDemonstration: one drone takes the place of another whose battery runs low.

Two routers hover as a chain, the others stay on their pads as spares. The drone manager relieves
whom it chooses; this only sends the two up, watches, and says why.
"""

from __future__ import annotations

import math
from typing import Callable, ClassVar, Iterator, NamedTuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.console.controls import OrderRefused
from drone_mesh.console.demonstration import Casting, Demonstration, free_places
from drone_mesh.console.put_back import FAST, FleetBefore, Script, rounded
from drone_mesh.drone.battery import LAND_AT_PERCENT, READY_PERCENT
from drone_mesh.drone.interfaces import ON_GROUND_M
from drone_mesh.drone.roles import Role
from drone_mesh.formations.posts import BESIDE_M
from drone_mesh.formations.relief import CARRIES_S
from drone_mesh.state.model import MeshStatus, NodeStatus, position_is_known
from drone_mesh.state.repair_story import and_

_POSTS = ((0.0, 6 / 9), (0.0, 12 / 9))  # x, y from the gateway, in ranges: a chain
_UP_M = 4.0  # above the gateway: well above those on their pads
_AT_PAD_M = 0.5


class ReliefCasting(Casting):
    """Two routers with high ids hover; all others are spares."""

    @classmethod
    def choose(cls, mesh: MeshStatus) -> Casting:
        """Choose who hovers. Raises OrderRefused if nobody could relieve them."""
        known = [node for node in mesh.nodes if position_is_known(node)]
        gateways = [node for node in known if node.role == Role.GATEWAY and node.on]
        able = [n for n in known if len(n.home) and n.on and not (n.why_not_fly or n.crashed)]
        able = [n for n in able if n.role == Role.ROUTER and n.position[2] < ON_GROUND_M]
        if not gateways or len(able) < 3:
            raise OrderRefused(
                "this demonstration needs a gateway, and 3 routers on pads with crews: start "
                "it with scripts/run demo:=relief"
            )
        cast = [node.id for node in able]
        others = [node for node in known if node.id not in cast[-2:]]
        posts = free_places(gateways[0], mesh.max_distance, others, _POSTS, _UP_M)
        places = [*(rounded(node.home) for node in able[:-2]), *posts]
        before = FleetBefore.of(mesh, able)
        return cls(gateways[0].id, cast, dict(zip(cast, places)), (), before)

    def in_words(self) -> str:
        return (
            f"This sends drones {and_(self.cast[-2:])} into the air, as a chain, and waits until "
            f"one of {and_(self.cast[:-2])} relieves one of them. You can end it at any moment: "
            "it sends all drones back."
        )


class _Scene(NamedTuple):
    """One sentence, and what ends it, by who comes and who goes. Simulated seconds."""

    text: str
    ends: Callable[[NodeStatus, NodeStatus], bool]
    pace: float = 1.0  # per second
    lasts_s: float = math.inf  # for the bar of the page; inf: none


_SCENES = (
    _Scene(
        "{new.id} relieves {old.id}, which has {old.battery:.0f} % left, and {new.id} "
        f"{{new.battery:.0f}} %. It flies to a free place {BESIDE_M:g} m beside, clear of others",
        lambda new, _old: new.position[2] > ON_GROUND_M and not len(new.path),
    ),
    _Scene(
        f"{{new.id}} hovers beside {{old.id}}, which stays: only after {CARRIES_S:g} s with a "
        "connection is {new.id} sure to carry its traffic",
        lambda new, _old: new.relieves == NO_ROUTE,
        lasts_s=CARRIES_S,
    ),
    _Scene(
        "{new.id} holds the post now. {old.id} flies home to its pad, with enough left for the way",
        lambda _new, old: not len(old.path) and math.dist(old.position, old.home) < _AT_PAD_M,
        2.0,
    ),
    _Scene(
        "{old.id} stands on its pad, where the crew swaps its battery",
        lambda _new, old: old.battery >= READY_PERCENT,
        FAST,
    ),
    _Scene(
        "{old.id} has a full battery again and is a spare: it can relieve the next one. In this "
        "way the chain stays in the air as long as there are batteries",
        lambda _new, _old: True,
    ),
)


class ReliefDemonstration(Demonstration):
    """A relief: a spare comes, takes over, and the other one gets a new battery."""

    casting: ClassVar[type[Casting]] = ReliefCasting

    def _play(self, mesh: MeshStatus, plan: Casting) -> Script:
        near, far = plan.cast[-2:]
        self.story.add(
            f"The gateway sends {near} and {far} into the air, where they stay: {far} is out of "
            f"its range and reaches it only over {near}. {and_(plan.cast[:-2])} on the pads: "
            "spares, whose batteries stay full",
            mesh.stamp_s,
        )
        mesh = yield self._at_pace(FAST)
        for drone in (near, far):
            mesh = yield from self._bring(mesh, {drone: plan.places[drone]})
        left_s = min(node.time_left for node in mesh.nodes if node.id in (near, far))
        self.story.add(
            f"{near} and {far} hover. The first would come down in {left_s:.0f} s, at "
            f"{LAND_AT_PERCENT:.0f} % of its battery. Both started together and would have to "
            "leave together: so the first relief begins early",
            mesh.stamp_s,
        )
        mesh = yield from self._until(mesh, "nobody was relieved", lambda m: any(_reliefs(m)))
        new, old = next(_reliefs(mesh))
        for scene in _SCENES:

            def ends(mesh: MeshStatus, scene: _Scene = scene) -> bool:
                nodes = {node.id: node for node in mesh.nodes}
                return scene.ends(nodes[new], nodes[old])

            nodes = {node.id: node for node in mesh.nodes}
            words, until_s = {"new": nodes[new], "old": nodes[old]}, mesh.stamp_s + scene.lasts_s
            self.story.add(scene.text.format(**words), mesh.stamp_s, until_s)
            mesh = yield self._at_pace(scene.pace)
            mesh = yield from self._until(mesh, "this did not end", ends)


def _reliefs(mesh: MeshStatus) -> Iterator[tuple[int, int]]:
    """Who comes, and whom it relieves."""
    return ((node.id, node.relieves) for node in mesh.nodes if node.relieves != NO_ROUTE)
