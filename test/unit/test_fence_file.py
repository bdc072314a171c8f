"""Files of fences: YAML in metres, GeoJSON, and plans of QGroundControl."""

from __future__ import annotations

import json

import pytest
import yaml

from drone_mesh.drone.fence import CIRCLE_CORNERS
from drone_mesh.drone.geodesy import EarthPlace, Origin
from drone_mesh.errors import ConfigurationError
from drone_mesh.fence_file import (
    areas_in,
    areas_json,
    changed_rows,
    fence_of,
    read_fence,
    rows_of_text,
)

ORIGIN = Origin(52.0907, 5.1214, 3.0)
DATE_LINE = Origin(-17.0, 179.9999, 0.0)
YARD = """areas:
- {name: yard, polygon: [[0, 0], [20, 0], [20, 20], [0, 20]], max_height: 8}
- {name: tower, inclusion: false, center: [10, 10], radius: 2}
"""


def degrees(x, y, origin=ORIGIN):
    place = origin.to_earth(
        origin.to_frame(EarthPlace(*_origin(origin)))._replace(latitude=y, longitude=x)
    )
    return [place.latitude_deg, place.longitude_deg]


def _origin(origin):
    return origin.latitude_deg, origin.longitude_deg, origin.altitude_m


def plan(origin=ORIGIN, rally=(), **changes):
    square = [degrees(*corner, origin) for corner in ((-20, -20), (20, -20), (20, 20), (-20, 20))]
    fence = {
        "version": 2,
        "polygons": [{"polygon": square, "inclusion": True, "version": 1}],
        "circles": [
            {
                "circle": {"center": degrees(10, 10, origin), "radius": 2.0},
                "inclusion": False,
                "version": 1,
            }
        ],
        **changes,
    }
    return {
        "fileType": "Plan",
        "geoFence": fence,
        "groundStation": "QGroundControl",
        "mission": {"items": []},
        "rallyPoints": {"points": [[*degrees(*one, origin), 10.0] for one in rally], "version": 2},
        "version": 1,
    }


def geojson(origin=ORIGIN):
    ring = [
        degrees(*corner, origin)[::-1] for corner in ((-20, -20), (20, -20), (20, 20), (-20, 20))
    ]
    hole = [degrees(*corner, origin)[::-1] for corner in ((8, 8), (12, 8), (12, 12), (8, 12))]
    return {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "properties": {"name": "yard", "max_height": 8, "stroke": "red"},
                "geometry": {
                    "type": "Polygon",
                    "coordinates": [[*ring, ring[0]], [*hole, hole[0]]],
                },
            },
            {
                "type": "Feature",
                "properties": {"name": "mast", "inclusion": False, "radius": 2},
                "geometry": {"type": "Point", "coordinates": degrees(-10, 0, origin)[::-1]},
            },
            {
                "type": "Feature",
                "properties": None,
                "geometry": {"type": "LineString", "coordinates": [ring[0], ring[1]]},
            },
        ],
    }


def written(tmp_path, name, content):
    path = tmp_path / name
    path.write_text(content if isinstance(content, str) else json.dumps(content), "utf-8")
    return path


@pytest.mark.parametrize(
    ("name", "content", "origin", "why_not"),
    [
        ("yard.yaml", YARD, None, {(1, 1, 0): "", (10, 9, 0): "inside fence tower",
         (1, 1, 9): "above"}),
        ("yard.plan", plan(), ORIGIN, {(1, 1, 0): "", (10, 9, 90): "inside fence circle 1",
         (21, 1, 0): "outside fence polygon 1"}),
        ("yard.plan", plan(DATE_LINE), DATE_LINE, {(15, 1, 0): "", (-15, 1, 0): "",
         (25, 1, 0): "outside"}),
        ("yard.plan", plan(rally=[(1, 1)]), ORIGIN, {(1, 1, 0): ""}),
        ("yard.geojson", geojson(), ORIGIN, {(1, 1, 0): "", (10, 10, 0): "outside fence yard",
         (-10, 1, 0): "inside fence mast", (1, 1, 9): "above"}),
    ],
)  # fmt: skip
def test_the_areas_of_each_kind_of_file_are_in_the_metres_of_the_mesh(
    tmp_path, name, content, origin, why_not
):
    fence = read_fence(written(tmp_path, name, content), origin)
    for place, begin in why_not.items():
        assert fence.why_not(place).startswith(begin), place
        assert bool(fence.why_not(place)) == bool(begin), place


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.plan", plan(version=1), "version 2"),
        ("a.plan", plan(polygons=[], circles=[]), "0 areas"),
        ("a.plan", plan(polygons=[{"polygon": [[52, 5]]}]), "has no inclusion"),
        (
            "a.plan",
            plan(polygons=[{"polygon": [[5, 95]] * 3, "inclusion": True}]),
            "km from the origin",
        ),
        ("a.plan", plan(circles=[{"circle": {"center": [52, 5]}, "inclusion": True}]), "radius"),
        ("a.plan", plan(rally=[(30, 0)]), "rally point 1 is outside fence polygon 1"),
        ("a.plan", plan(rally=[(10, 10)]), "rally point 1 is inside fence circle 1"),
        ("a.plan", {**plan(), "rallyPoints": {"points": 3}}, "3 is not a list"),
        ("a.plan", {**plan(), "fileType": "Mission"}, "its fileType is not Plan"),
        ("a.plan", "{", "not JSON"),
        ("a.geojson", "[" * 100_000, "nested too deeply"),
        ("a.geojson", " " * 2_000_000, "larger than"),
        ("a.geojson", {"type": "FeatureCollection", "features": []}, "0 areas"),
        ("a.yaml", "areas: 3", "line 1: expected 'areas:'"),
        (
            "a.yaml",
            "areas: [{name: x, polygon: [[0, 0], [9, 9], [9, 0], [0, 9]]}]",
            "area 1: its edges",
        ),
        ("a.yaml", "areas: [{polygon: [[0, 0], [9, .nan], [9, 0]]}]", "y nan is not"),
        ("a.yaml", "areas: [{polygon: [[0, 0], [9, 1], [9, 0]], inclusion: 1}]", "true or false"),
        (
            "a.yaml",
            "areas: [{polygon: [[0, 0], [9, 1], [9, 0]], radius: 1}]",
            "a center and a radius",
        ),
        ("a.yaml", "areas: [{points: []}]", "expected keys name"),
        (
            "a.yaml",
            "areas: [{polygon: [[0, 0], [9, 0], [0, 9]], holes: [[[20, 0], [29, 0], [20, 9]]]}]",
            "area 1: hole 1 is outside its polygon",
        ),
    ],
)
def test_a_file_that_is_no_fence_is_refused_with_one_line_that_names_it(
    tmp_path, name, content, words
):
    path = written(tmp_path, name, content)
    with pytest.raises(ConfigurationError) as refused:
        read_fence(path, ORIGIN)
    assert words in str(refused.value)
    assert str(refused.value).startswith(str(path))
    assert str(refused.value).count(str(path)) == 1
    assert "\n" not in str(refused.value)


def test_degrees_need_an_origin(tmp_path):
    with pytest.raises(ConfigurationError, match="needs an origin"):
        read_fence(written(tmp_path, "a.plan", plan()))


def test_an_area_without_a_name_has_its_number():
    rows = [{"polygon": [[0, 0], [9, 0], [9, 9]]}]
    assert fence_of(rows).why_not((20, 0, 0)) == "outside fence area 1"


def test_the_areas_of_a_geojson_collection_count_and_what_is_no_geometry_is_refused(tmp_path):
    yard, mast, line = (one["geometry"] for one in geojson()["features"])
    shapes = {"type": "GeometryCollection", "geometries": [line, yard, mast]}
    nested = {"type": "GeometryCollection", "geometries": [shapes]}
    text = written(tmp_path, "a.json", {"type": "Feature", "properties": {}, "geometry": nested})
    assert read_fence(text, ORIGIN).why_not((10, 10, 0)) == "outside fence area 1"
    wrong = geojson()
    wrong["features"][1]["geometry"]["type"] = "polygon"
    with pytest.raises(ConfigurationError, match="feature 2: .* is not a geometry"):
        read_fence(written(tmp_path, "b.json", wrong), ORIGIN)


@pytest.mark.parametrize("text", [YARD, json.dumps(yaml.safe_load(YARD)), json.dumps(plan())])
def test_a_text_without_a_name_is_read_as_what_it_looks_like(text):
    assert len(fence_of(rows_of_text(text, "text", ORIGIN)).zones) == 2


def test_areas_with_too_many_corners_together_are_refused(monkeypatch):
    monkeypatch.setattr("drone_mesh.fence_file.MOST_CORNERS", 2 * CIRCLE_CORNERS)
    ponds = [{"center": [9 * n, 0], "radius": 2, "inclusion": False} for n in range(3)]
    assert len(fence_of(ponds[:2]).zones) == 2
    with pytest.raises(ConfigurationError, match="area 3: more than 128 corners in all areas"):
        fence_of(ponds)


def test_what_is_told_of_a_fence_can_be_given_back():
    """Also what YAML reads otherwise: small numbers, names beyond 16 bits, the name of a key."""
    corners = [[0.00001, 0], [9, 0], [0, 9]]
    for name in ("type", "fileType", "\N{DUCK}", 'it\'s: a "pond"'):
        told = areas_json([{"name": name, "polygon": corners, "inclusion": False}])
        assert rows_of_text(f"{told}\n", "text", None) == areas_in(told)
        assert fence_of(areas_in(told)).names == name


def test_areas_change_by_their_names_and_those_of_one_name_stay_together():
    """A MultiPolygon, and the areas that a ground station calls all the same."""

    def area(size, **more):
        return {**more, "polygon": [[0, 0], [size, 0], [0, size]]}

    def sizes(rows):
        return [(row["name"], row["polygon"][1][0]) for row in rows]

    trees = [area(1, name="trees"), area(2, name="trees"), area(3)]
    assert sizes(changed_rows(trees, [area(4, name="pond")], [])) == [
        ("trees", 1), ("trees", 2), ("area 3", 3), ("pond", 4),
    ]  # fmt: skip
    new = [area(4, name="trees"), area(5, name="trees")]
    assert sizes(changed_rows(trees, new, ["area 3"])) == [("trees", 4), ("trees", 5)]
    unnamed = changed_rows([area(1), area(2)], [area(3)], ["area 1"])
    assert sizes(unnamed) == [("area 2", 2), ("area 3", 3)]
    assert sizes(changed_rows(unnamed, [area(4)], [])) == [
        ("area 2", 2), ("area 3", 3), ("area 1", 4),
    ]  # fmt: skip
    with pytest.raises(ConfigurationError, match="no area sea"):
        changed_rows(trees, [], ["sea"])
