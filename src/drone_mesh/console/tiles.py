"""The tiles of a map under the drones: from a file, which the console serves, or from a server.

A file is MBTiles (1.3) with pictures; the page draws no vector tiles. Leaflet, which draws them in
the page, comes from npm and is no part of this project: `scripts/map_library` puts it beside this
module.
"""

from __future__ import annotations

import html
import logging
import re
import sqlite3
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Callable, Mapping, Sequence
from urllib.parse import urlsplit

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles

from drone_mesh.arguments import finite, is_up_to
from drone_mesh.errors import ConfigurationError

_log = logging.getLogger(__name__)

LEAFLET = Path(__file__).resolve().parent / "leaflet"
KEPT_BY_BROWSER_S = 3600
MOST_ZOOM = 22
MOST_TILE_BYTES = 4_000_000  # far above what pictures of 512 pixels need
MOST_WORDS = 2_000  # characters
MOST_ROWS = 1_000  # of metadata
MOST_QUERY_S = 5.0
STEPS = 10_000  # of the database, between two looks at the time
_OWN_URL = "/tiles/{z}/{x}/{y}"
_PICTURES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp"}
_IS_TILE = f"typeof(tile_data) = 'blob' AND length(tile_data) <= {MOST_TILE_BYTES}"
_URL = re.compile(r"https?://([A-Za-z0-9.-]|\{s\})+(:\d+)?/[^\s'\";]*")

ReadTile = Callable[[int, int, int], "bytes | None"]
"""The tile at zoom, column and row, counted from the north-west; any thread."""


@dataclass(frozen=True)
class MapOffer:
    """The description of a map for a page."""

    url: str
    min_zoom: int
    max_zoom: int
    credit: str  # who made it, in words
    bounds: Sequence[float] = ()  # degrees: west, south, east, north; empty: not known


class Tiles:
    """The map of a console."""

    def __init__(self, offer: MapOffer, read: ReadTile | None) -> None:
        """`read` reads a tile from a file; None: the page asks another server."""
        self._read = read
        self.offer = offer

    def for_page(self) -> dict[str, object]:
        """The offer as JSON values."""
        return asdict(self.offer)

    @property
    def image_sources(self) -> str:
        """The sources of pictures that the page's content security policy allows."""
        if self._read is not None:
            return "'self' data:"
        parts = urlsplit(self.offer.url.replace("{s}", "*"))
        return f"'self' data: {parts.scheme}://{parts.netloc}"

    @property
    def routes(self) -> list[BaseRoute]:
        """Where the console serves the library, and the tiles of a file."""
        library: list[BaseRoute] = [Mount("/leaflet", StaticFiles(directory=LEAFLET))]
        tiles = [Route("/tiles/{z}/{x}/{y}", self._tile)] if self._read else []
        return [*library, *tiles]

    def _tile(self, request: Request) -> Response:
        """Not async, so Starlette calls it in a thread of its own."""
        z, x, y = (request.path_params[name] for name in "zxy")
        picture = None
        side = 2 ** int(z) if is_up_to(z, MOST_ZOOM) else 0
        if self._read is not None and is_up_to(x, side - 1) and is_up_to(y, side - 1):
            picture = self._read(int(z), int(x), int(y))
        kept = {"Cache-Control": f"private, max-age={KEPT_BY_BROWSER_S}"}
        kind = None if picture is None else _picture_type(picture)
        if kind is None:
            return Response(status_code=204, headers=kept)  # the map ends here
        return Response(picture, media_type=kind, headers=kept)


def open_tiles(given: str) -> Tiles:
    """The tiles of a file or an address. Raises ConfigurationError, one line.

    `given`: the path of an .mbtiles file, or an address with {z}, {x} and {y}; words
    behind a # name its author.
    """
    tiles = _of_server(given) if "://" in given else _of_file(Path(given).expanduser())
    if not (LEAFLET / "leaflet-src.esm.js").is_file():
        raise ConfigurationError(
            "maps need Leaflet beside the console: scripts/map_library of the checkout fetches it "
            "(needs npm)"
        )
    return tiles


def _of_server(given: str) -> Tiles:
    url, _, credit = given.partition("#")
    if not _URL.fullmatch(url) or not all(part in url for part in ("{z}", "{x}", "{y}")):
        raise ConfigurationError(
            f"invalid address {given!r}: use http(s)://HOST/... with {{z}}, {{x}} and {{y}}"
        )
    host = urlsplit(url).netloc.replace("{s}.", "")
    return Tiles(MapOffer(url, 0, 19, credit or host), None)


def _of_file(path: Path) -> Tiles:
    if path.suffix.lower() != ".mbtiles":
        raise ConfigurationError(
            f"{path}: expected an .mbtiles file, or an address with {{z}}, {{x}}, {{y}}"
        )
    try:
        path.open("rb").close()
        return _open_mbtiles(path)
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror}") from error
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error


def _open_mbtiles(path: Path) -> Tiles:
    lock = threading.Lock()  # of the connection
    until_s = 0.0
    uri = f"{path.resolve().as_uri()}?mode=ro&immutable=1"
    database = sqlite3.connect(uri, uri=True, check_same_thread=False)
    # The tables may be views, whose queries need not end.
    database.set_progress_handler(lambda: time.monotonic() > until_s, STEPS)

    def find(query: str, values: Sequence[int] = ()) -> list[Any]:
        nonlocal until_s
        with lock:
            until_s = time.monotonic() + MOST_QUERY_S
            try:
                return database.execute(query, values).fetchmany(MOST_ROWS)
            except UnicodeDecodeError as error:  # of what SQLite says about the damage
                raise sqlite3.DatabaseError("damaged") from error

    def read(z: int, x: int, y: int) -> bytes | None:
        try:  # the rows of MBTiles count from the south
            rows = find(
                f"SELECT tile_data FROM tiles WHERE zoom_level=? AND tile_column=? AND tile_row=? "
                f"AND {_IS_TILE}",
                (z, x, 2**z - 1 - y),
            )
        except sqlite3.Error as error:
            _log.warning("the tile %d/%d/%d of %s is damaged: %s", z, x, y, path, error)
            return None
        return rows[0][0] if rows else None

    try:
        about = dict(find(f"SELECT name, substr(value, 1, {MOST_WORDS}) FROM metadata"))
        ((low,),) = find("SELECT min(zoom_level) FROM tiles")
        ((high,),) = find("SELECT max(zoom_level) FROM tiles")
        some = find(f"SELECT tile_data FROM tiles WHERE {_IS_TILE} LIMIT 1")
    except sqlite3.Error as error:
        reason = str(error) or "damaged"  # Python 3.8 has no words for what it cannot decode
        raise ConfigurationError(f"not an MBTiles file: {reason}") from error
    if not some:
        raise ConfigurationError("has no tiles")
    if _picture_type(some[0][0]) is None:
        raise ConfigurationError(
            "its tiles are not pictures (PNG, JPEG or WebP): the page draws no vector tiles"
        )
    if not (isinstance(low, int) and isinstance(high, int) and 0 <= low <= high):
        raise ConfigurationError(f"zoom levels {low!r:.20} to {high!r:.20}")
    bounds = _bounds(str(about.get("bounds", "")).split(","))
    return Tiles(MapOffer(_OWN_URL, low, min(high, MOST_ZOOM), _credit(about), bounds), read)


def _picture_type(data: bytes) -> str | None:
    return next((kind for start, kind in _PICTURES.items() if data.startswith(start)), None)


def _credit(about: Mapping[str, Any]) -> str:
    """The attribution as plain text; files have HTML there."""
    words = re.sub(r"<[^<>]*>", "", str(about.get("attribution") or about.get("name") or ""))
    return html.unescape(words).strip()[:200]


def _bounds(values: Sequence[str]) -> Sequence[float]:
    """Degrees, or empty if they are not the corners of an area."""
    try:
        west, south, east, north = map(finite, values)
    except ValueError:
        return ()
    is_area = -360 <= west < east <= 360 and -90 <= south < north <= 90
    return (west, south, east, north) if is_area else ()
