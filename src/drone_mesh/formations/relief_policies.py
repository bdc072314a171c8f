"""Which drone relieves which, and when: the policies of Relief (docs/endurance.md)."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import Callable, Mapping, NamedTuple, Sequence

from drone_mesh.air.graph import Graph, within
from drone_mesh.errors import ConfigurationError


class Pair(NamedTuple):
    """One drone is to take the place of another one."""

    old: int
    new: int


@dataclass(frozen=True)
class ReliefView:
    """What a policy decides on."""

    left_s: Mapping[int, float]  # by drone on a post: until its relief must begin; least first
    ready: Sequence[int]  # drones with full batteries on the ground, by id
    spares: Sequence[int]  # all drones without a post, these included, by id
    interval_s: float  # between two reliefs that the spares and the pads can keep up
    places: Mapping[int, Sequence[float]]  # of all drones that are on, and of the gateways
    gateways: Sequence[int]
    range_m: float
    can_fly: Callable[[int, int], bool]  # whether a drone's way to another one's post is clear

    def with_one_of(self, old: int, drones: Sequence[int]) -> Pair | None:
        """This drone and the first of these that can fly to it."""
        return next((Pair(old, new) for new in drones if self.can_fly(new, old)), None)


class IReliefPolicy(abc.ABC):
    """Decides which drone is relieved next, and by which. Relief carries it out."""

    @abc.abstractmethod
    def choose(self, view: ReliefView) -> Pair | None:
        """The next relief that must begin now; None: there is none."""


class SpareFirst(IReliefPolicy):
    """The drone with the least time left, as soon as a later begin would let reliefs pile up.

    All start with full batteries and would have to go together. With k drones that have to be
    relieved within t, spares and pads must manage k reliefs in t: the test of deadlines that are
    served earliest first. Ramesh and Thomas (arXiv 2604.15890) show what becomes of fleets that
    are only large enough on the mean. One more than these fits in, should one relief fail.
    """

    def choose(self, view: ReliefView) -> Pair | None:
        in_time = all(
            left_s > count * view.interval_s for count, left_s in enumerate(view.left_s.values(), 2)
        )
        if in_time or not view.ready:
            return None
        pairs = (view.with_one_of(old, view.ready) for old in view.left_s)
        return next((pair for pair in pairs if pair), None)


class NamedBackup(IReliefPolicy):
    """Each spare is the backup of some drones, and relieves only these.

    After PADRA (Akkaya et al. 2010), which names a backup for each drone that the mesh needs. Named
    are they when the first one is needed: before, all stand on the ground.
    """

    def __init__(self) -> None:
        self._group: dict[int, int] = {}  # drone -> the first spare of its group

    def choose(self, view: ReliefView) -> Pair | None:
        late = [old for old, left_s in view.left_s.items() if left_s <= 0.0]
        if late and view.spares:
            for spare in view.spares:
                self._group.setdefault(spare, spare)
            for count, drone in enumerate(sorted(view.left_s.keys() - self._group.keys())):
                self._group[drone] = view.spares[count % len(view.spares)]
        for old in late:
            backups = [d for d in view.ready if self._group.get(d) == self._group.get(old)]
            pair = view.with_one_of(old, backups)
            if pair:
                return pair
        return None


class Rotate(IReliefPolicy):
    """Without spares: a neighbour that the mesh does not need takes the place for a while.

    After C3R (Tamboli and Younis 2010), whose neighbours of a dead node take turns at its place.
    What the neighbour leaves is filled by the next drone that has a full battery.
    """

    def choose(self, view: ReliefView) -> Pair | None:
        old = next(iter(view.left_s), None)
        if old is None or view.left_s[old] > 0.0:
            return None
        graph = Graph(within(view.places, view.range_m))
        needed = {*graph.cut_vertices(view.gateways)}
        near = [d for d in graph.near.get(old, ()) if view.left_s.get(d, 0.0) > 0.0]
        free = [drone for drone in near if drone not in needed]
        return view.with_one_of(old, sorted(free, key=lambda drone: -view.left_s[drone]))


POLICIES: dict[str, Callable[[], IReliefPolicy | None]] = {
    "none": lambda: None,
    "spare_first": SpareFirst,
    "named_backup": NamedBackup,
    "rotate": Rotate,
}


def relief_policy(name: str) -> IReliefPolicy | None:
    """The policy of this name; None: nobody is relieved. Raises ConfigurationError."""
    if name not in POLICIES:
        raise ConfigurationError(f"unknown relief {name}: use {', '.join(POLICIES)}")
    return POLICIES[name]()
