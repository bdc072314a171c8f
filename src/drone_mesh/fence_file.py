"""Reads a fence: areas as YAML in metres, as GeoJSON, or as a plan of QGroundControl."""

from __future__ import annotations

import contextlib
import functools
import itertools
import json
import math
import reprlib
from pathlib import Path
from typing import Any, Iterable, Iterator, Mapping, Sequence

from drone_mesh.drone.fence import Fence, Zone
from drone_mesh.drone.flight_path import Point
from drone_mesh.drone.geodesy import EarthPlace, Origin
from drone_mesh.earth_files.geojson import features_of, read_json, shapes_in
from drone_mesh.earth_files.plan import MAX_PLAN_CHARACTERS, Plan, read_plan
from drone_mesh.errors import ConfigurationError
from drone_mesh.yaml_file import MAX_FILE_BYTES, is_number, read_mapping_text, read_text

MOST_AREAS = 100
MOST_CORNERS = 10_000  # of all areas
MOST_M = 100_000.0  # from x 0, y 0; farther away, the plane is not the earth
KEYS = ("name", "inclusion", "polygon", "holes", "center", "radius", "min_height", "max_height")
MAX_NAME = 40
IN_DEGREES = (".plan", ".geojson", ".json")  # the ends of the names of such files

Row = Mapping[str, Any]


def read_fence(path: str | Path, origin: Origin | None = None) -> Fence:
    """The fence in this file; GeoJSON and plans need the `origin` of the common frame.

    Raises ConfigurationError: one line with the file, the area and what is wrong.
    """
    return fence_in(areas_json(rows_of_file(path, origin)))


def rows_of_file(path: str | Path, origin: Origin | None = None) -> list[Row]:
    """Its areas in metres, as `fence_of` takes them. Raises ConfigurationError."""
    kind = Path(path).suffix.lower()
    most_bytes = MAX_PLAN_CHARACTERS if kind in IN_DEGREES else MAX_FILE_BYTES
    return rows_of_text(read_text(path, most_bytes=most_bytes), str(path), origin, kind)


def rows_of_text(text: str, path: str, origin: Origin | None, kind: str = "") -> list[Row]:
    """The same of the text of a file, by the end of its name or, without `kind`, by its content."""
    if not kind:
        with contextlib.suppress(ValueError, LookupError, TypeError, RecursionError):
            if areas_json(areas_in(text)) == text.strip():  # YAML misreads its 1e-05 and names
                return areas_in(text)
        kind = ".plan" if '"fileType"' in text else ".json" if '"type"' in text else ".yaml"
    rows: list[Row]
    if kind not in IN_DEGREES:
        file = read_mapping_text(text, path)
        rows = file.content.get("areas", [])
        if set(file.content) != {"areas"} or not isinstance(rows, list):
            raise ConfigurationError(f"{file.where('areas')}: expected 'areas:' with a list")
    try:
        if kind in IN_DEGREES:
            if origin is None:
                raise ConfigurationError("its places are in degrees: that needs an origin")
            rows = _in_degrees(text, kind, origin)
        if not fence_of(rows):
            raise ConfigurationError("0 areas")
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error
    return rows


def _in_degrees(text: str, kind: str, origin: Origin) -> list[Row]:
    if kind != ".plan":
        return list(_of_geojson(read_json(text), origin))
    plan = read_plan(text)
    rows = list(_of_plan(plan.geo_fence, origin))
    _check_rally_points(plan, fence_of(rows), origin)
    return rows


def changed_rows(rows: Sequence[Row], new: Sequence[Row], remove: Iterable[str]) -> list[Row]:
    """The first, without those to `remove` and those with the names of new ones; and these.

    Several areas may have one name. A new one without a name has one of its own.
    """
    rows = _named(rows, ())
    new = _named(new, [row["name"] for row in rows])
    unknown = set(remove) - {row["name"] for row in rows}
    if unknown:
        raise ConfigurationError(f"the fence has no area {min(unknown)}")
    gone = {*remove, *(row["name"] for row in new)}
    return [*(row for row in rows if row["name"] not in gone), *new]


def _named(rows: Sequence[Row], taken: Sequence[str]) -> list[Row]:
    names = (name for name in map("area {}".format, itertools.count(1)) if name not in taken)
    return [{"name": name, **row} for name, row in zip(names, rows)]


def areas_json(rows: Sequence[Any]) -> str:
    """These areas as the text of a file, as `fence_in` takes them and ROS tells them."""
    return json.dumps({"areas": rows})


def areas_in(areas: str) -> list[Row]:
    """The areas in this JSON."""
    rows: list[Row] = json.loads(areas)["areas"]
    return rows


@functools.lru_cache(maxsize=4)
def fence_in(areas: str) -> Fence:
    """The fence with the areas in this JSON, built once. Raises ConfigurationError."""
    return fence_of(areas_in(areas))


def fence_of(rows: Sequence[Any]) -> Fence:
    """The fence with these areas: KEYS, a polygon or a center and a radius, in metres.

    Raises ConfigurationError, which names the area.
    """
    zones: dict[bool, list[Zone]] = {True: [], False: []}
    corners = 0
    if len(rows) > MOST_AREAS:
        raise ConfigurationError(f"{len(rows)} areas: expected at most {MOST_AREAS}")
    for number, row in enumerate(rows, start=1):
        try:
            name, inside = _name_and_side(row, number)
            zones[inside].append(_zone(row, name, inside))
            corners += len(zones[inside][-1].edges)
            if corners > MOST_CORNERS:
                raise ConfigurationError(f"more than {MOST_CORNERS} corners in all areas")
        except ConfigurationError as error:
            raise ConfigurationError(f"area {number}: {error}") from None
    return Fence.of(zones[True], zones[False])


def _name_and_side(row: Any, number: int) -> tuple[str, bool]:
    if not isinstance(row, dict) or not set(row) <= set(KEYS):
        raise ConfigurationError(f"expected keys {', '.join(KEYS)}, not {reprlib.repr(row)}")
    name, inside = row.get("name", f"area {number}"), row.get("inclusion", True)
    if not (isinstance(name, str) and name.isprintable() and 0 < len(name) <= MAX_NAME):
        raise ConfigurationError(f"name {reprlib.repr(name)} is not 1..{MAX_NAME} characters")
    if not isinstance(inside, bool):
        raise ConfigurationError(f"inclusion {reprlib.repr(inside)} is not true or false")
    return name, inside


def _zone(row: Row, name: str, inside: bool) -> Zone:
    low, high = row.get("min_height"), row.get("max_height")
    heights = (
        -math.inf if low is None else _number(low, "min_height"),
        math.inf if high is None else _number(high, "max_height"),
    )
    if ("polygon" in row) == ("center" in row) or ("radius" in row) != ("center" in row):
        raise ConfigurationError("expected a polygon, or a center and a radius")
    if "center" in row:
        radius_m = _number(row["radius"], "radius")
        return Zone.circle(name, _point(row["center"]), radius_m, inside, heights)
    outer, *holes = (
        tuple(map(_point, _list(ring))) for ring in (row["polygon"], *_list(row.get("holes", [])))
    )
    alone = Zone(name, (outer,), *heights)
    for number, hole in enumerate(holes, start=1):
        if not any(alone.surrounds((*corner, 0.0)) for corner in hole):
            raise ConfigurationError(f"hole {number} is outside its polygon")
    return Zone(name, (outer, *holes), *heights) if holes else alone


def _number(value: Any, what: str) -> float:
    if not (is_number(value) and abs(value) <= MOST_M):
        raise ConfigurationError(f"{what} {reprlib.repr(value)} is not -{MOST_M:g}..{MOST_M:g} m")
    return float(value)


def _point(value: Any) -> Point:
    if not isinstance(value, (list, tuple)) or len(value) != 2:
        raise ConfigurationError(f"{reprlib.repr(value)} is not [x, y] in metres")
    return _number(value[0], "x"), _number(value[1], "y")


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise ConfigurationError(f"{reprlib.repr(value)} is not a list")
    return value


def _metres(latitude: Any, longitude: Any, origin: Origin) -> list[float]:
    """x and y of a place in degrees; on both sides of the date line as well."""
    if not (is_number(latitude) and abs(latitude) <= 90 and is_number(longitude)) or not (
        abs(longitude) <= 180
    ):
        raise ConfigurationError(f"{longitude}, {latitude} is not a longitude and a latitude")
    here = origin.to_frame(EarthPlace(latitude, longitude, origin.altitude_m))
    away_m = max(abs(here.longitude), abs(here.latitude))
    if not away_m <= MOST_M:
        raise ConfigurationError(
            f"{latitude:.6f}, {longitude:.6f} is more than {MOST_M / 1000:g} km from the origin"
        )
    return [round(here.longitude, 2), round(here.latitude, 2)]


def _of_geojson(content: Any, origin: Origin) -> Iterator[Row]:
    """Polygons, and points with a property `radius`; the other properties are KEYS."""
    for number, feature in enumerate(features_of(content), start=1):
        try:
            yield from _of_feature(feature, origin)
        except ConfigurationError as error:
            raise ConfigurationError(f"feature {number}: {error}") from error


def _of_feature(feature: Any, origin: Origin) -> Iterator[Row]:
    geometry, properties = _key(feature, "geometry") or {}, feature.get("properties") or {}
    if not isinstance(properties, dict) or not isinstance(geometry, dict):
        raise ConfigurationError("expected properties and a geometry")
    told = {k: v for k, v in properties.items() if k in KEYS and v is not None}
    for kind, coordinates in shapes_in(geometry):
        if kind == "Point" and "radius" in told:
            yield {**told, "center": _places([coordinates], origin)[0]}
        elif kind in ("Polygon", "MultiPolygon"):
            shapes = _list(coordinates)
            for rings in shapes if kind == "MultiPolygon" else [shapes]:
                outer, *holes = [_places(ring, origin) for ring in _list(rings)] or [[]]
                yield {**told, "polygon": outer, **({"holes": holes} if holes else {})}


def _places(ring: Any, origin: Origin) -> list[list[float]]:
    places = []
    for position in _list(ring):
        if not isinstance(position, list) or len(position) < 2:
            raise ConfigurationError(f"{reprlib.repr(position)} is not [longitude, latitude]")
        places.append(_metres(position[1], position[0], origin))
    return places


def _of_plan(fence: Row, origin: Origin) -> Iterator[Row]:
    """The geofence of a plan, version 2. It has no names and no heights."""
    if fence.get("version") != 2:
        raise ConfigurationError("not a plan with a geofence of version 2: save it in a newer QGC")
    for number, polygon in enumerate(_list(fence.get("polygons", [])), start=1):
        corners = [_metres(*_pair(place), origin) for place in _list(_key(polygon, "polygon"))]
        side = _key(polygon, "inclusion")
        yield {"name": f"polygon {number}", "inclusion": side, "polygon": corners}
    for number, one in enumerate(_list(fence.get("circles", [])), start=1):
        circle, side = _key(one, "circle"), _key(one, "inclusion")
        center, radius = _metres(*_pair(_key(circle, "center")), origin), _key(circle, "radius")
        name = f"circle {number}"
        yield {"name": name, "inclusion": side, "center": center, "radius": radius}


def _check_rally_points(plan: Plan, fence: Fence, origin: Origin) -> None:
    """An autopilot that flew to one outside would break the fence, and land where it is then."""
    for number, place in enumerate(_list(plan.rally_points.get("points", [])), start=1):
        x, y = _metres(*_pair(place), origin)
        why_not = fence.why_not((x, y, 0.0))
        if why_not:
            raise ConfigurationError(f"rally point {number} is {why_not}")


def _key(value: Any, key: str) -> Any:
    if not isinstance(value, dict) or key not in value:
        raise ConfigurationError(f"{reprlib.repr(value)} has no {key}")
    return value[key]


def _pair(place: Any) -> tuple[Any, Any]:
    if not isinstance(place, list) or len(place) < 2:
        raise ConfigurationError(f"{reprlib.repr(place)} is not [latitude, longitude]")
    return place[0], place[1]
