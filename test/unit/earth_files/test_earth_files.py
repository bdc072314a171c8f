"""Places and lines of other programs become metres of the common frame, and back; tracks."""

from __future__ import annotations

import json
from typing import Any

import pytest

from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.earth_files import WRITERS, Path, Placemarks, Point, read_placemarks, tracks_of
from drone_mesh.errors import ConfigurationError

ORIGIN = Origin(52.0907, 5.1214, 3.0)


def features(*these: dict[str, Any]) -> str:
    return json.dumps({"type": "FeatureCollection", "features": these})


def feature(kind: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def kml(*marks: str) -> str:
    inside = "".join(f"<Placemark>{mark}</Placemark>" for mark in marks)
    return f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{inside}</Document></kml>'


def refusal(text: str, name: str, origin: Origin | None = ORIGIN) -> str:
    with pytest.raises(ConfigurationError) as caught:
        read_placemarks(text, name, origin)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("ending", WRITERS)
def test_what_is_written_is_read_again_to_the_centimetre(ending):
    points = [Point(3, Location(120.5, -80.25, 12.0)), Point(4, Location(-999.0, 4000.0, 0.0))]
    paths = [Path(7, [Location(0.0, 0.0, 0.0), Location(55.5, 66.6, 7.0)], [1.0, 20.5])]
    origin = Origin(-33.9, 151.2, 3.2746)
    found = read_placemarks(
        WRITERS[ending](Placemarks(points, paths), origin), f"a.{ending}", origin
    )
    for read, written in zip(found.points, points):
        assert read.drone == written.drone
        assert tuple(read.place) == pytest.approx(tuple(written.place), abs=0.015)
    (path,) = found.paths
    assert path.drone == 7
    assert tuple(path.places[1]) == pytest.approx((55.5, 66.6, 7.0), abs=0.015)


def test_points_of_geojson_are_for_the_drones_that_they_name():
    text = features(
        feature("Point", [5.1214, 52.0907], drone=3),
        feature("Point", [5.1214, 52.0907, 5.5], name="Router 4"),
        feature("MultiPoint", [[5.1214, 52.0907, 99]], name="the old oak", height=12),
        feature("Polygon", [[[5.1, 52.0], [5.2, 52.0], [5.2, 52.1], [5.1, 52.0]]]),
        {"type": "Feature", "properties": None, "geometry": None},
    )
    points = read_placemarks(text, "field.GeoJSON", ORIGIN).points
    assert [(point.drone, point.place.height) for point in points] == [(3, 0), (4, 2.5), (None, 12)]


def test_a_bare_number_in_a_name_names_no_drone():
    """Ground stations, receivers and drawing programs number their points."""
    names = ("0 ", "1 Takeoff", "2", "drone 3", "gateway 0", "Node4")
    marks = (f"<name>{n}</name><Point><coordinates>5.1,52.1</coordinates></Point>" for n in names)
    points = read_placemarks(kml(*marks), "a.kml", ORIGIN).points
    assert [point.drone for point in points] == [None, None, None, 3, 0, 4]
    these = [{"name": "7"}, {"id": 7}, {"id": "7"}, {"id": 7000}, {"id": None, "name": "router 9"}]
    text = features(*(feature("Point", [5.1, 52.1], **properties) for properties in these))
    points = read_placemarks(text, "a.json", ORIGIN).points
    assert [point.drone for point in points] == [None, 7, None, None, 9]


MISSION = [[5.1214, 52.0907, 0], [5.1216, 52.0908, 30], [5.1219, 52.0907, 30]]


def mission_in(ending: str) -> str:
    """What ground stations export: numbered waypoints, and a line through them."""
    if ending == "json":
        points = [feature("Point", at[:2], name=str(n)) for n, at in enumerate(MISSION)]
        return features(*points, feature("LineString", MISSION, height=5))
    texts = [",".join(map(str, at)) for at in MISSION]
    points = [
        f"<name>{n} </name><Point><altitudeMode>absolute</altitudeMode>"
        f"<coordinates>{text.rpartition(',')[0]},33</coordinates></Point>"
        for n, text in enumerate(texts)
    ]
    return kml(*points, f"<LineString><coordinates>{' '.join(texts)}</coordinates></LineString>")


@pytest.mark.parametrize("ending", ["json", "kml"])
def test_a_line_through_its_points_is_a_mission_of_one_drone_and_no_layout(ending):
    found = read_placemarks(mission_in(ending), f"a.{ending}", ORIGIN)
    assert found.is_mission
    assert [len(path.places) for path in found.paths] == [3]
    with pytest.raises(ConfigurationError, match="a mission of one drone, as a line goes through"):
        found.goals({n: Location(0.0, float(n), 0.0) for n in range(8)})


def test_a_line_beside_the_points_or_points_that_name_drones_are_no_mission():
    road = [[5.125, 52.09], [5.126, 52.09]]
    beside = features(feature("Point", MISSION[1][:2]), feature("LineString", road))
    named = [feature("Point", at[:2], drone=n) for n, at in enumerate(MISSION)]
    for text in (beside, features(*named, feature("LineString", MISSION, height=5))):
        assert not read_placemarks(text, "a.json", ORIGIN).is_mission


def test_shapes_in_collections_and_bare_shapes_are_read_too():
    point = {"type": "Point", "coordinates": [5.1214, 52.0907]}
    line = {"type": "LineString", "coordinates": MISSION[:2]}
    inner = {"type": "GeometryCollection", "geometries": [line]}
    both = {"type": "GeometryCollection", "geometries": [point, inner]}
    in_feature = {"type": "Feature", "properties": {"drone": 3, "height": 1}, "geometry": both}
    found = read_placemarks(features(in_feature), "a.json", ORIGIN)
    assert found.points == [Point(3, Location(0.0, 0.0, 1.0))]
    assert [path.drone for path in found.paths] == [3]
    assert len(read_placemarks(json.dumps(point), "a.json", ORIGIN).points) == 1


def test_the_track_of_a_flight_log_is_a_line():
    track = (
        "<name>drone 3</name><gx:Track><altitudeMode>absolute</altitudeMode>"
        "<when>2026-05-01T10:00:00Z</when><when>2026-05-01T10:00:01Z</when>"
        "<gx:coord>5.1214 52.0907 3</gx:coord><gx:coord>5.1216 52.0907 13</gx:coord></gx:Track>"
    )
    text = kml(track).replace("<kml ", '<kml xmlns:gx="http://www.google.com/kml/ext/2.2" ')
    (path,) = read_placemarks(text, "log.kml", ORIGIN).paths
    assert path.drone == 3
    assert [place.height for place in path.places] == [0, 10]


def test_points_without_a_number_are_for_the_nearest_of_the_other_drones():
    east, west, north = Location(0, 9, 0), Location(0, -9, 0), Location(9, 0, 0)
    found = Placemarks([Point(None, east), Point(None, west), Point(1, north)])
    at = {1: east, 2: Location(0, 8, 0), 3: Location(0, 7, 0), 4: Location(0, 0, 0)}
    assert found.goals(at) == {1: north, 2: east, 4: west}
    with pytest.raises(ConfigurationError, match="2 points for any drone, and 1 drones"):
        found.goals({1: east, 2: west})


def test_heights_of_kml_are_as_their_mode_says():
    def mark(mode: str) -> str:
        return f"<Point>{mode}<coordinates>5.1214,52.0907,30</coordinates></Point>"

    text = kml(
        mark(""),
        mark("<altitudeMode>relativeToGround</altitudeMode>"),
        mark("<altitudeMode>absolute</altitudeMode>"),
    )
    points = read_placemarks(text, "field.kml", ORIGIN).points
    assert [point.place.height for point in points] == [0, 30, 27]
    assert {point.drone for point in points} == {None}


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "a.json: not JSON: "),
        ("[" * 100_000, "a.json: nested too deeply"),
        ("[]", "a.json: not GeoJSON: expected a FeatureCollection"),
        (features(), "a.json: has neither points nor lines"),
        ('{"type": "FeatureCollection", "features": [7]}', "feature 1: not a feature: 7"),
        (features(feature("Point", [5.1])), "feature 1: [5.1] is not [longitude, latitude]"),
        (features(feature("Point", [155000.0, 463000.0])), "is not a longitude and a latitude"),
        (features(feature("Point", [float("nan"), 52])), "is not [longitude, latitude]"),
        (features(feature("Point", [5.1214, 52.0907, 0])), "height -3 m is outside 0..500 m"),
        (features(feature("Point", [6, 52])), "in metres from the origin: latitude"),
        (features(feature("Point", [5.1, 52.1], drone="x")), "the property drone is 'x', not"),
        (features(feature("Point", [5.1, 52.1], drone=254)), "drone 254: the largest id is 253"),
        (features(feature("Point", [5.1, 52.1], height="x")), "the property height is 'x', not"),
        (features(feature("LineString", 5)), "feature 1: coordinates 5 are not a list"),
        (features(feature("LineString", [])), "feature 1: a line with 0 places: it needs two"),
        (features(feature("point", [5.1, 52.1])), "feature 1: {'coordinates': "),
        ('{"type": "GeometryCollection"}', "feature 1: geometries None are not a list"),
        (features(*[feature("Point", [5.12, 52.09], drone=1)] * 2), "feature 2: drone 1 has two"),
        (" " * 300_001, "a.json: longer than 300000 characters"),
    ],
)
def test_bad_geojson_is_refused_in_one_line(text, why):
    assert why in refusal(text, "a.json")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("<kml>", "a.kml: not XML: no element found"),
        ("<html/>", "a.kml: not KML: its first element is 'html'"),
        (kml(), "a.kml: has neither points nor lines"),
        (
            '<!DOCTYPE k [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><kml>&b;</kml>',
            "a.kml: declares a document type or entities",
        ),
        (
            kml("<name>Oak</name><Point><coordinates>here</coordinates></Point>"),
            "a.kml: placemark 'Oak': 'here' is not longitude,latitude,height",
        ),
        ("<kml>\ud800</kml>", "a.kml: not XML: "),
        (
            kml("<name>w</name><LineString><coordinates> </coordinates></LineString>"),
            "a.kml: placemark 'w': a line with 0 places: it needs two",
        ),
        (
            kml("<Point><coordinates/></Point>"),
            "a.kml: placemark '': a point with 0 places",
        ),
    ],
)
def test_bad_kml_is_refused_in_one_line(text, why):
    assert why in refusal(text, "a.kml")


def test_what_is_missing_is_said():
    assert refusal("{}", "a.json", None) == (
        "a.json: its places are in degrees: that needs an origin"
    )
    assert refusal("PK", "a.kmz") == "a.kmz: a compressed file: unzip it, and give the KML in it"
    assert refusal("{}", "a.plan").startswith("a.plan: a mission of one drone, and no layout: ")


def test_placemarks_inside_each_other_are_refused_however_many_there_are():
    """Each would have the shapes of all those in it: of 2,000 there would be 2,000,000."""
    point = "<Point><coordinates>5.1214,52.0907</coordinates></Point>"
    text = f"<kml>{'<Placemark>' * 2_000}{point * 2_000}{'</Placemark>' * 2_000}</kml>"
    assert refusal(text, "a.kml") == "a.kml: placemark '': another placemark inside it"


def test_far_more_points_than_drones_are_counted_and_not_compared():
    here = Location(0, 0, 0)
    found = Placemarks([Point(None, here)] * 100_000)
    with pytest.raises(ConfigurationError, match="100000 points for any drone, and 200 drones"):
        found.goals(dict.fromkeys(range(200), here))


@pytest.mark.parametrize("number", ["5_1", "nan", "1e999", "٥", "0x5"])
def test_what_only_python_takes_for_a_number_is_no_coordinate(number):
    point = f"<Point><coordinates>{number},52.0907</coordinates></Point>"
    assert f"'{number},52.0907' is not longitude,latitude" in refusal(kml(point), "a.kml")


def test_a_track_has_a_place_whenever_the_drone_has_moved_half_a_metre():
    still = [(float(t), 1, (5.0, 5.0, 0.0)) for t in range(10)]
    moving = [(float(t), 2, (0.3 * min(t, 4), 0.0, 1.0)) for t in range(10)]
    places = [Location(0.0, x, 1.0) for x in (0.0, 0.6, 1.2)]
    assert tracks_of(sorted(still + moving)).paths == [Path(2, places, [0.0, 2.0, 4.0])]


def test_long_tracks_are_thinned_out_but_keep_both_ends(monkeypatch):
    monkeypatch.setattr("drone_mesh.earth_files.placemarks.MOST_PLACES", 4)
    (path,) = tracks_of((float(t), 2, (float(t), 0.0, 0.0)) for t in range(10)).paths
    assert path.times_s == [0.0, 3.0, 6.0, 9.0]
    assert [place.longitude for place in path.places] == path.times_s
