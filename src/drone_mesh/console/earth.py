"""What the console knows, as files for other programs: places and tracks in degrees."""

from __future__ import annotations

import asyncio
import math
from concurrent.futures import Executor
from typing import Callable, Sequence, TypeVar

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.history import History, unpacked
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.earth_files import WRITERS, Placemarks, Point, tracks_of
from drone_mesh.state.model import MeshStatus, known_positions, position_is_known

MOST_STATES = 600  # of the history; 254 drones then take some seconds
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
            found = await self._in_worker(_tracks_in, self._history.spread(MOST_STATES))
        text = await self._in_worker(WRITERS[ending], found, origin)
        name = {"Content-Disposition": f'attachment; filename="{what}.{ending}"'}
        return Response(text, media_type=_TYPES[ending], headers=name)

    async def _in_worker(self, work: Callable[..., T], *what: object) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._workers, work, *what)

    def _mesh_at(self, moment: str) -> MeshStatus | None:
        """The mesh at this simulated second; the present one if the history does not have it."""
        try:
            at_s = float(moment)
        except ValueError:
            at_s = math.nan
        if math.isnan(at_s) or not self._history.times:
            return self._store.mesh
        return self._history.state(self._history.index_at(at_s))


def places_of(mesh: MeshStatus | None) -> Placemarks:
    """The places of the routers, as points of a layout."""
    found = Placemarks()
    for node in mesh.nodes if mesh else ():
        if node.role == Role.ROUTER and position_is_known(node):
            found.points.append(Point(node.id, Location.from_vector(node.position)))
    return found


def _tracks_in(states: Sequence[bytes]) -> Placemarks:
    return tracks_of(known_positions(map(unpacked, states)))
