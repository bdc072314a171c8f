"""GeoJSON (RFC 7946). The third coordinate is metres above sea level, as autopilots report it."""

from __future__ import annotations

import json
import reprlib
from typing import Any, Iterator, Mapping

from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.earth_files.placemarks import Path, Placemarks, drone_named, on_earth, place_on
from drone_mesh.errors import ConfigurationError


def read_geojson(text: str, origin: Origin) -> Placemarks:
    """Points and lines; their properties `drone` or `name` name the drone, `height` its height.

    `height`: metres above the origin. Without it and a third coordinate: 0. Other shapes are left
    out. Raises ConfigurationError.
    """
    try:
        content = json.loads(text)
    except RecursionError:
        raise ConfigurationError("nested too deeply") from None
    except ValueError as error:
        raise ConfigurationError(f"not JSON: {error}") from error
    found = Placemarks()
    for number, feature in enumerate(_features(content), start=1):
        try:
            _add(found, feature, origin)
        except ConfigurationError as error:
            raise ConfigurationError(f"feature {number}: {error}") from error
    return found


def geojson_of(found: Placemarks, origin: Origin) -> str:
    """A FeatureCollection; the `times_s` of a line are simulated seconds, one per place."""
    features = [
        _feature(point.drone, "Point", on_earth(origin, point.place), {}) for point in found.points
    ]
    for path in found.paths:
        places = [on_earth(origin, place) for place in path.places]
        features.append(_feature(path.drone, "LineString", places, {"times_s": list(path.times_s)}))
    lines = ",\n".join(json.dumps(feature) for feature in features)
    return f'{{"type": "FeatureCollection", "features": [\n{lines}\n]}}\n'


def _feature(drone: int | None, kind: str, coordinates: object, more: Mapping[str, object]) -> Any:
    return {
        "type": "Feature",
        "properties": {"drone": drone, "name": f"drone {drone}", **more},
        "geometry": {"type": kind, "coordinates": coordinates},
    }


def _features(content: Any) -> Iterator[Any]:
    kind = content.get("type") if isinstance(content, dict) else None
    if kind == "FeatureCollection" and isinstance(content.get("features"), list):
        yield from content["features"]
    elif kind == "Feature":
        yield content
    else:
        raise ConfigurationError("not GeoJSON: expected a FeatureCollection")


def _add(found: Placemarks, feature: Any, origin: Origin) -> None:
    if not isinstance(feature, dict):
        raise ConfigurationError(f"not a feature: {reprlib.repr(feature)}")
    properties, geometry = feature.get("properties") or {}, feature.get("geometry") or {}
    if not isinstance(properties, dict) or not isinstance(geometry, dict):
        raise ConfigurationError("expected properties and a geometry")
    named = properties.get("drone")
    drone = drone_named(str(properties.get("name") or "") if named is None else str(named))
    if named is not None and drone is None:
        raise ConfigurationError(f"the property drone is {reprlib.repr(named)}, not an id")
    height = properties.get("height")
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    if kind == "Point":
        found.add_point(drone, _place(coordinates, height, origin))
    elif kind == "MultiPoint":
        for position in _list(coordinates):
            found.add_point(drone, _place(position, height, origin))
    elif kind in ("LineString", "MultiLineString"):
        lines = [coordinates] if kind == "LineString" else _list(coordinates)
        for line in lines:
            places = [_place(position, height, origin) for position in _list(line)]
            found.paths.append(Path(drone, places))


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise ConfigurationError(f"coordinates {reprlib.repr(value)} are not a list")
    return value


def _place(position: Any, height: Any, origin: Origin) -> Location:
    if not isinstance(position, list) or len(position) < 2 or not _are_numbers(position[:3]):
        raise ConfigurationError(f"{reprlib.repr(position)} is not [longitude, latitude]")
    if height is None:
        height = position[2] - origin.altitude_m if len(position) > 2 else 0.0
    elif not _are_numbers([height]):
        raise ConfigurationError(f"the property height is {reprlib.repr(height)}, not metres")
    return place_on(origin, float(position[1]), float(position[0]), float(height))


def _are_numbers(values: list[Any]) -> bool:
    return all(type(value) in (int, float) and abs(value) < 1e9 for value in values)
