"""Reach: which drones have a path to a gateway, over which others."""

from __future__ import annotations

from typing import Collection, Iterable, Mapping, Sequence

import numpy as np


class Reach:
    """The links that positions allow; obstacles are not considered."""

    def __init__(
        self, places: Mapping[int, Sequence[float]], gateways: Iterable[int], range_m: float
    ) -> None:
        """`places` of all nodes that are on, in metres."""
        self._gateways = list(gateways)
        ids: np.ndarray = np.fromiter(places, int, len(places))
        points: np.ndarray = np.array(list(places.values()), dtype=float).reshape(-1, 3)
        away = points[:, None] - points[None]
        near = (away * away).sum(axis=-1) < range_m**2
        self._near = {int(one): set(ids[near[row]].tolist()) for row, one in enumerate(ids)}

    def over(self, relays: Collection[int]) -> set[int]:
        """The drones, without gateways, that have a path to a gateway over these drones."""
        return self.hops(relays).keys() - set(self._gateways)

    def hops(self, relays: Collection[int]) -> dict[int, int]:
        """The hops of each of them and of the gateways."""
        allowed = set(relays) | set(self._gateways)
        reached = dict.fromkeys(self._gateways, 0)
        left, frontier, count = allowed - reached.keys(), set(reached), 0
        while frontier:
            count += 1
            near: set[int] = set().union(*(self._near[node] for node in frontier))
            frontier = near & left
            left -= frontier
            reached.update(dict.fromkeys(frontier, count))
        return reached
