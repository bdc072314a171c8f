"""The tiles of a map under the drones: from a file, which the console serves, or from a server.

A file is MBTiles (1.3) or PMTiles (3) with pictures; the page draws no vector tiles. Leaflet, which
draws them in the page, comes from npm and is no part of this project: `scripts/map_library` puts it
beside this module.
"""

from __future__ import annotations

import html
import re
import sqlite3
import threading
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Callable, Mapping, Sequence
from urllib.parse import urlsplit

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles

from drone_mesh.errors import ConfigurationError

LEAFLET = Path(__file__).resolve().parent / "leaflet"
KEPT_BY_BROWSER_S = 3600  # our choice
MOST_ZOOM = 22
_OWN_URL = "/tiles/{z}/{x}/{y}"
_PICTURES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp"}
_URL = re.compile(r"https?://([A-Za-z0-9.-]|\{s\})+(:\d+)?/[^\s'\";]*")

ReadTile = Callable[[int, int, int], "bytes | None"]
"""The tile at zoom, column and row, counted from the north-west; any thread."""


@dataclass(frozen=True)
class MapOffer:
    """What a page must know of a map."""

    url: str
    min_zoom: int
    max_zoom: int
    credit: str  # who made it, in words
    bounds: Sequence[float] = ()  # degrees: west, south, east, north; empty: not known


class Tiles:
    """The map of a console."""

    def __init__(self, offer: MapOffer, read: ReadTile | None) -> None:
        """`read`: of a file; None: the page asks another server."""
        self._read = read
        self.offer = offer

    def for_page(self) -> dict[str, object]:
        """The offer as JSON values."""
        return asdict(self.offer)

    @property
    def image_sources(self) -> str:
        """For the page's content security policy: Leaflet clears pictures with a data URL."""
        if self._read is not None:
            return "'self' data:"
        parts = urlsplit(self.offer.url.replace("{s}", "*"))
        return f"'self' data: {parts.scheme}://{parts.netloc}"

    @property
    def routes(self) -> list[BaseRoute]:
        """Where the console serves the library, and the tiles of a file."""
        library: list[BaseRoute] = [Mount("/leaflet", StaticFiles(directory=LEAFLET))]
        tiles = [Route("/tiles/{z:int}/{x:int}/{y:int}", self._tile)] if self._read else []
        return [*library, *tiles]

    def _tile(self, request: Request) -> Response:
        """Not async, so Starlette calls it in a thread of its own."""
        z, x, y = (request.path_params[name] for name in "zxy")
        picture = None
        if self._read is not None and z <= MOST_ZOOM and max(x, y) < 2**z:
            picture = self._read(z, x, y)
        kept = {"Cache-Control": f"private, max-age={KEPT_BY_BROWSER_S}"}
        kind = None if picture is None else _picture_type(picture)
        if kind is None:
            return Response(status_code=204, headers=kept)  # the map ends here
        return Response(picture, media_type=kind, headers=kept)


def open_tiles(given: str) -> Tiles:
    """The tiles of a file or an address. Raises ConfigurationError, one line.

    `given`: the path of an .mbtiles or .pmtiles file, or an address with {z}, {x} and {y}; words
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
    openers = {".mbtiles": _open_mbtiles, ".pmtiles": _open_pmtiles}
    if path.suffix.lower() not in openers:
        raise ConfigurationError(
            f"{path}: expected an .mbtiles or .pmtiles file, or an address with {{z}}, {{x}}, {{y}}"
        )
    try:
        with path.open("rb"):
            pass
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror}") from error
    try:
        return openers[path.suffix.lower()](path)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error


def _open_mbtiles(path: Path) -> Tiles:
    lock = threading.Lock()  # of the connection
    uri = f"{path.resolve().as_uri()}?mode=ro&immutable=1"
    database = sqlite3.connect(uri, uri=True, check_same_thread=False)
    find = "SELECT tile_data FROM tiles WHERE zoom_level=? AND tile_column=? AND tile_row=?"

    def read(z: int, x: int, y: int) -> bytes | None:
        with lock:  # the rows of MBTiles count from the south
            row = database.execute(find, (z, x, 2**z - 1 - y)).fetchone()
        return None if row is None else bytes(row[0])

    try:
        about = dict(database.execute("SELECT name, value FROM metadata"))
        low, high = database.execute(
            "SELECT min(zoom_level), max(zoom_level) FROM tiles"
        ).fetchone()
        if low is None:
            raise ConfigurationError("has no tiles")
        (some,) = database.execute("SELECT tile_data FROM tiles LIMIT 1").fetchone()
    except sqlite3.Error as error:
        raise ConfigurationError(f"not an MBTiles file: {error}") from error
    _check_picture(bytes(some))
    bounds = _bounds(str(about.get("bounds", "")).split(","))
    return Tiles(MapOffer(_OWN_URL, low, high, _credit(about), bounds), read)


def _open_pmtiles(path: Path) -> Tiles:
    try:
        from pmtiles.reader import MmapSource, Reader, all_tiles
    except ImportError as error:
        raise ConfigurationError("needs the Python package pmtiles: pip install pmtiles") from error
    try:
        with path.open("rb") as file:
            source = MmapSource(file)  # a mapping of its own: the file may be closed
        reader = Reader(source)
        header, about = reader.header(), reader.metadata()
        _position, some = next(iter(all_tiles(source)))
    except StopIteration:
        raise ConfigurationError("has no tiles") from None
    except Exception as error:  # of the package and of all that it reads with
        reason = str(error) or type(error).__name__
        raise ConfigurationError(f"not a PMTiles file of version 3: {reason}") from error
    _check_picture(some)
    names = ("min_lon_e7", "min_lat_e7", "max_lon_e7", "max_lat_e7")
    bounds = _bounds([header[name] / 1e7 for name in names])
    zooms = header["min_zoom"], header["max_zoom"]
    return Tiles(MapOffer(_OWN_URL, *zooms, _credit(about), bounds), reader.get)


def _picture_type(data: bytes) -> str | None:
    return next((kind for start, kind in _PICTURES.items() if data.startswith(start)), None)


def _check_picture(data: bytes) -> None:
    if _picture_type(data) is None:
        raise ConfigurationError(
            "its tiles are not pictures (PNG, JPEG or WebP): the page draws no vector tiles"
        )


def _credit(about: Mapping[str, Any]) -> str:
    """The attribution as plain text; files have HTML there."""
    words = re.sub(r"<[^>]*>", "", str(about.get("attribution") or about.get("name") or ""))
    return html.unescape(words).strip()[:200]


def _bounds(values: Sequence[Any]) -> Sequence[float]:
    """Degrees, or empty if they are not the corners of an area."""
    try:
        west, south, east, north = map(float, values)
    except ValueError:
        return ()
    return (west, south, east, north) if west < east and south < north else ()
