"""The ways of drones, from the positions that were reported of them."""

from __future__ import annotations

import math
from typing import Iterable, Sequence

from drone_mesh.drone.location import Location
from drone_mesh.earth_files.placemarks import Path, Placemarks

STEP_M = 0.5  # our choice: a track has a place whenever the drone has moved so far
MOST_PLACES = 20_000  # of all tracks


def tracks_of(positions: Iterable[tuple[float, int, Sequence[float]]]) -> Placemarks:
    """Where each node has been; a node that never moved has no track.

    `positions`: seconds, the node, and x, y, z in metres, by rising time.
    """
    times: dict[int, list[float]] = {}
    places: dict[int, list[Location]] = {}
    for at_s, node, position in positions:
        track = places.setdefault(node, [])
        place = Location.from_vector(position)
        if not track or place.distance_m(track[-1]) >= STEP_M:
            track.append(place)
            times.setdefault(node, []).append(round(at_s, 2))
    total = sum(len(track) for track in places.values() if len(track) > 1)
    step = max(1, math.ceil(total / MOST_PLACES))
    return Placemarks(
        paths=[
            Path(node, [*track[:-1:step], track[-1]], [*times[node][:-1:step], times[node][-1]])
            for node, track in sorted(places.items())
            if len(track) > 1
        ]
    )
