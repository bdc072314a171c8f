"""GeoJSON (RFC 7946). The third coordinate is metres above sea level, as autopilots report it."""

from __future__ import annotations

import json
import reprlib
from typing import Any, Iterator, Mapping

from drone_mesh.drone.fleet import MAX_DRONES
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.earth_files.placemarks import (
    Placemarks,
    drone_named,
    drone_with,
    on_earth,
    place_on,
)
from drone_mesh.errors import ConfigurationError

_LINES_AND_POINTS = ("Point", "MultiPoint", "LineString", "MultiLineString")
_SHAPES = (*_LINES_AND_POINTS, "Polygon", "MultiPolygon", "GeometryCollection")


def read_geojson(text: str, origin: Origin) -> Placemarks:
    """Points and lines; the properties `drone` (or `id`) or `name` name the drone.

    `height`: metres above the origin. Without it and a third coordinate: 0. Areas are left out.
    Raises ConfigurationError.
    """
    content = read_json(text)
    found = Placemarks()
    for number, feature in enumerate(features_of(content), start=1):
        try:
            _add(found, feature, origin)
        except ConfigurationError as error:
            raise ConfigurationError(f"feature {number}: {error}") from error
    return found


def read_json(text: str) -> Any:
    """What a stranger's JSON says. Raises ConfigurationError, one line."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ConfigurationError("nested too deeply") from None
    except ValueError as error:
        raise ConfigurationError(f"not JSON: {error}") from error


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


def features_of(content: Any) -> Iterator[Any]:
    """The features of a file, or its one geometry as a feature. Raises ConfigurationError."""
    kind = content.get("type") if isinstance(content, dict) else None
    if kind == "FeatureCollection" and isinstance(content.get("features"), list):
        yield from content["features"]
    elif kind == "Feature":
        yield content
    elif kind in _SHAPES:
        yield {"geometry": content}
    else:
        raise ConfigurationError("not GeoJSON: expected a FeatureCollection")


def _add(found: Placemarks, feature: Any, origin: Origin) -> None:
    if not isinstance(feature, dict):
        raise ConfigurationError(f"not a feature: {reprlib.repr(feature)}")
    properties, geometry = feature.get("properties") or {}, feature.get("geometry") or {}
    if not isinstance(properties, dict) or not isinstance(geometry, dict):
        raise ConfigurationError("expected properties and a geometry")
    drone, height = _drone(properties), properties.get("height")
    for kind, coordinates in shapes_in(geometry):
        if kind not in _LINES_AND_POINTS:
            continue
        parts = list_in(coordinates) if kind.startswith("Multi") else [coordinates]
        for part in parts:
            if kind.endswith("Point"):
                found.add_point(drone, _place(part, height, origin))
            else:
                places = [_place(position, height, origin) for position in list_in(part)]
                found.add_path(drone, places)


def _drone(properties: Mapping[str, Any]) -> int | None:
    drone_id = properties.get("drone")
    if drone_id is not None:
        drone = drone_with(str(drone_id))
        if drone is None:
            raise ConfigurationError(f"the property drone is {reprlib.repr(drone_id)}, not an id")
        return drone
    number = properties.get("id")  # other programs keep words and large numbers in it, too
    if type(number) is int and 0 <= number < MAX_DRONES:
        return number
    return drone_named(str(properties.get("name") or ""))


def shapes_in(geometry: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """The parts of a geometry, those in collections included: their types and coordinates.

    Raises ConfigurationError.
    """
    waiting = [geometry] if geometry else []
    while waiting:
        shape = waiting.pop()
        kind = shape.get("type") if isinstance(shape, dict) else None
        if kind not in _SHAPES:
            raise ConfigurationError(f"{reprlib.repr(shape)} is not a geometry")
        if kind == "GeometryCollection":
            waiting += reversed(list_in(shape.get("geometries"), "geometries"))
        else:
            yield kind, shape.get("coordinates")


def list_in(value: Any, what: str = "coordinates") -> list[Any]:
    """This part of a stranger's JSON, `what`. Raises ConfigurationError unless it is a list."""
    if not isinstance(value, list):
        raise ConfigurationError(f"{what} {reprlib.repr(value)} are not a list")
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
