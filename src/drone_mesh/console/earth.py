"""What the console knows, as files for other programs: places and tracks in degrees."""

from __future__ import annotations

import asyncio
import math
from concurrent.futures import Executor
from typing import Callable, Sequence, TypeVar

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from drone_mesh.console.frames import FrameStore
from drone_mesh.console.history import History, unpacked
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.earth_files import WRITERS, Path, Placemarks, Point
from drone_mesh.state.model import MeshStatus, position_is_known

STEP_M = 0.5  # our choice: a track has a place whenever the drone has moved so far
MOST_STATES = 600  # of the history; our choice: 254 drones then take some seconds
MOST_PLACES = 20_000  # of all tracks
T = TypeVar("T")

_TYPES = {"geojson": "application/geo+json", "kml": "application/vnd.google-earth.kml+xml"}


class EarthFiles:
    """/earth/places.* and /earth/tracks.*; belongs to the server's event loop."""

    def __init__(self, store: FrameStore, history: History, workers: Executor) -> None:
        self._store, self._history, self._workers = store, history, workers
        self.route = Route("/earth/{what}.{ending}", self._answer)

    async def _answer(self, request: Request) -> Response:
        what, ending = request.path_params["what"], request.path_params["ending"]
        if what not in ("places", "tracks") or ending not in WRITERS:
            return PlainTextResponse("no such file\n", 404)
        origin = self._store.origin
        if origin is None:
            return PlainTextResponse("the mesh has no origin on the earth\n", 404)
        if what == "places":
            found = places_of(self._mesh_at(request.query_params.get("t", "")))
        else:
            found = await self._in_worker(tracks_of, self._history.spread(MOST_STATES))
        text = await self._in_worker(WRITERS[ending], found, origin)
        name = {"Content-Disposition": f'attachment; filename="{what}.{ending}"'}
        return Response(text, media_type=_TYPES[ending], headers=name)

    async def _in_worker(self, work: Callable[..., T], *what: object) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._workers, work, *what)

    def _mesh_at(self, moment: str) -> MeshStatus | None:
        """The mesh at this simulated second; now, if the history does not have it."""
        try:
            at_s = float(moment)
        except ValueError:
            at_s = math.nan
        if math.isnan(at_s) or not self._history.times:
            return self._store.mesh
        return self._history.state(self._history.index_at(at_s))


def places_of(mesh: MeshStatus | None) -> Placemarks:
    """Where the routers are: what a layout sends somewhere."""
    found = Placemarks()
    for node in mesh.nodes if mesh else ():
        if node.role == Role.ROUTER and position_is_known(node):
            found.points.append(Point(node.id, Location.from_vector(node.position)))
    return found


def tracks_of(states: Sequence[bytes]) -> Placemarks:
    """Where each node has been; a node that never moved has no track."""
    times: dict[int, list[float]] = {}
    places: dict[int, list[Location]] = {}
    for mesh in map(unpacked, states):
        for node in mesh.nodes:
            if not position_is_known(node):
                continue
            track = places.setdefault(node.id, [])
            place = Location.from_vector(node.position)
            if not track or place.distance_m(track[-1]) >= STEP_M:
                track.append(place)
                times.setdefault(node.id, []).append(round(mesh.stamp_s, 2))
    total = sum(len(track) for track in places.values() if len(track) > 1)
    step = max(1, math.ceil(total / MOST_PLACES))
    return Placemarks(
        paths=[
            Path(node, [*track[:-1:step], track[-1]], [*times[node][:-1:step], times[node][-1]])
            for node, track in sorted(places.items())
            if len(track) > 1
        ]
    )
