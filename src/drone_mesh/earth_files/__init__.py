"""Places and tracks as GeoJSON and KML, for other programs; docs/observing.md, "On the earth".

In the files places are in degrees (WGS84), in this package in metres of the common frame.
"""

from __future__ import annotations

from drone_mesh.drone.geodesy import Origin
from drone_mesh.earth_files.geojson import geojson_of, read_geojson
from drone_mesh.earth_files.kml import kml_of, read_kml
from drone_mesh.earth_files.placemarks import Path, Placemarks, Point, tracks_of
from drone_mesh.errors import ConfigurationError

__all__ = [
    "MAX_CHARACTERS",
    "WRITERS",
    "Placemarks",
    "Path",
    "Point",
    "is_earth_file",
    "read_placemarks",
    "tracks_of",
]

MAX_CHARACTERS = 300_000  # 254 places of a program that writes a style for each
WRITERS = {"geojson": geojson_of, "kml": kml_of}
_READERS = {".geojson": read_geojson, ".json": read_geojson, ".kml": read_kml}
_MISSION = "a mission of one drone, and no layout: rosrun drone_mesh mission flies it"
_OTHERS = {  # what drone programs save beside these
    ".kmz": "a compressed file: unzip it, and give the KML in it",
    ".plan": _MISSION,
    ".waypoints": _MISSION,
}


def is_earth_file(name: str) -> bool:
    """Whether a file of this name is for `read_placemarks`, which refuses some by name."""
    return name.lower().endswith((*_READERS, *_OTHERS))


def read_placemarks(text: str, name: str, origin: Origin | None) -> Placemarks:
    """The points and lines in this text of a file.

    Raises ConfigurationError, one line that begins with `name`.
    """
    ending = name[name.rfind(".") :].lower()
    if ending in _OTHERS:
        raise ConfigurationError(f"{name}: {_OTHERS[ending]}")
    if origin is None:
        raise ConfigurationError(f"{name}: its places are in degrees: that needs an origin")
    if len(text) > MAX_CHARACTERS:
        raise ConfigurationError(f"{name}: longer than {MAX_CHARACTERS} characters")
    try:
        found = _READERS[ending](text, origin)
    except ConfigurationError as error:
        raise ConfigurationError(f"{name}: {error}") from error
    if not found.points and not found.paths:
        raise ConfigurationError(f"{name}: has neither points nor lines")
    return found
