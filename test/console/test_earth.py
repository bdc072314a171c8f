"""A mesh with an origin on the earth: degrees, and files of other programs, in and out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from conftest import Visit, page_of
from test_page import PLACES, X, Y

from drone_mesh.drone.geodesy import EarthPlace, Origin
from drone_mesh.drone.location import Location

AT = "52.0907,5.1214,3"
ORIGIN = Origin.parse(AT)


def degrees(x: float, y: float) -> list[float]:
    place = ORIGIN.to_earth(Location(y, x, 0.0))
    return [place.longitude_deg, place.latitude_deg]


def geojson(*features: tuple[str, object, dict[str, object]]) -> str:
    return json.dumps(
        {
            "type": "FeatureCollection",
            "features": [
                {
                    "type": "Feature",
                    "properties": properties,
                    "geometry": {"type": kind, "coordinates": coordinates},
                }
                for kind, coordinates, properties in features
            ],
        }
    )


page = page_of("--skip", "25", "--origin", AT)


def load(page: Visit, path: Path, text: str) -> None:
    path.write_text(text)
    page.page.click("#files-button")
    page.page.set_input_files("#load-places", str(path))


def test_a_drawn_layout_is_flown_by_the_drones_it_names_and_the_nearest_others(page, tmp_path):
    drawn = geojson(
        ("Point", degrees(3.0, 15.0), {"drone": 17}),
        ("Point", degrees(-3.0, -3.0), {"name": "the gate"}),
    )
    page.answer_held("#held-now")
    load(page, tmp_path / "field.geojson", "\ufeff" + drawn)
    assert page.wait_for_held() == "field.geojson: 2 drones will leave"
    page.page.wait_for_selector("#toasts :text('ordered 2 of 2 drones')")
    page.wait_for("17 is there", lambda: (page.row(17, X), page.row(17, Y)) == ("3.0", "15.0"))
    page.wait_for("1 is the nearest", lambda: (page.row(1, X), page.row(1, Y)) == ("-3.0", "-3.0"))


def test_a_line_becomes_the_mission_of_the_selected_drone(page, tmp_path):
    page.page.click("#nodes tr[data-id='3']")
    line = [[*degrees(x, 4.0), 8.0] for x in (1.0, 5.0, 9.0)]
    load(page, tmp_path / "way.json", geojson(("LineString", line, {})))
    page.wait_for("the mission", lambda: page.page.is_visible("#mission-form"))
    assert page.page.inner_text("#mission-text") == "3 waypoints, drone 3"
    assert page.page.input_value("#mission-height") == "5"


def test_a_line_through_its_points_is_offered_as_a_mission_and_moves_nobody(page, tmp_path):
    page.page.click("#nodes tr[data-id='3']")
    line = [degrees(x, 4.0) for x in (1.0, 5.0, 9.0)]
    points = [("Point", at, {"name": f"{n} "}) for n, at in enumerate(line)]
    load(page, tmp_path / "way.json", geojson(*points, ("LineString", line, {})))
    page.page.wait_for_selector("#toasts :text('way.json is a mission of one drone')")
    assert page.page.inner_text("#mission-text") == "3 waypoints, drone 3"
    assert not page.page.is_visible("#held")


def test_a_gateway_moves_only_after_a_question(page, tmp_path):
    drawn = geojson(
        ("Point", degrees(-1.0, -6.0), {"name": "gateway 0"}),
        ("Point", degrees(-3.0, -3.0), {"drone": 1}),
    )
    load(page, tmp_path / "field.geojson", drawn)
    page.page.wait_for_selector("#confirm-text:text('Gateway 0 would fly')")
    page.page.click("#confirm [value='']")
    page.page.wait_for_timeout(300)
    assert not page.page.is_visible("#held")
    page.answer_held("#held-now")
    load(page, tmp_path / "field.geojson", drawn)
    page.page.click("#confirm [value=yes]")
    page.wait_for_held()
    page.page.wait_for_selector("#toasts :text('ordered 2 of 2 drones')")


def test_a_bad_file_is_refused_with_the_reason(page, tmp_path):
    for name, text, why in (
        ("a.kml", "<kml>", "a.kml: not XML: no element found"),
        ("a.geojson", "{}", "a.geojson: not GeoJSON: expected a FeatureCollection"),
        ("a.kmz", "PK", "a.kmz: a compressed file"),
        ("a.kml", "<!DOCTYPE x><kml/>", "a.kml: declares a document type"),
    ):
        load(page, tmp_path / name, text)
        page.page.wait_for_selector(f"#toasts .bad :text('{why}')")


def test_places_and_tracks_are_saved_in_degrees(page):
    page.page.click("#nodes tr[data-id='3']")
    page.page.fill("#fly-x", "14")
    page.page.press("#fly-x", "Enter")
    page.page.click("#held-now")
    page.wait_for("it is there", lambda: page.row(3, X) == "14.0")
    page.page.click("#files-button")
    saved = {}
    for name in ("places.geojson", "tracks.geojson", "places.kml", "tracks.kml"):
        with page.page.expect_download() as download:
            page.page.click(f"[data-save='{name}']")
        assert download.value.suggested_filename == name
        saved[name] = Path(download.value.path()).read_text()
    assert saved["places.kml"].count("<Point>") == len(PLACES) - 1  # all routers
    assert saved["tracks.kml"].count("<LineString>") == 1
    (track,) = json.loads(saved["tracks.geojson"])["features"]
    assert track["properties"]["drone"] == 3
    flown = track["geometry"]["coordinates"]
    assert len(track["properties"]["times_s"]) == len(flown)
    assert flown[0][0] < flown[-1][0], "to the east"
    places = json.loads(saved["places.geojson"])["features"]
    (three,) = (place for place in places if place["properties"]["drone"] == 3)
    longitude, latitude, altitude = three["geometry"]["coordinates"]
    there = ORIGIN.to_frame(EarthPlace(latitude, longitude, altitude))
    assert there.longitude == pytest.approx(14, abs=0.1)


def test_positions_are_shown_and_typed_in_degrees_on_wish(page):
    page.page.click("#nodes tr[data-id='3']")
    assert "Latitude" not in page.page.inner_text("#node-facts")
    page.page.check("#degrees")
    x, y = (float(page.row(3, column)) for column in (X, Y))
    longitude, latitude = degrees(x, y)
    assert f"{latitude:.5f}" in page.page.inner_text("#node-facts")
    assert float(page.page.input_value("#fly-x")) == pytest.approx(latitude, abs=2e-6)
    longitude, latitude = degrees(10.0, 11.0)
    page.page.fill("#fly-x", f"{latitude:.7f}")
    page.page.fill("#fly-y", f"{longitude:.7f}")
    page.page.press("#fly-y", "Enter")
    page.wait_for("the goal", lambda: "to 10, 11" in page.page.inner_text("#held-text"))
    page.page.click("#held-undo")
    page.page.fill("#fly-x", "53")
    page.page.press("#fly-y", "Enter")
    page.wait_for("why not", lambda: "5000 m" in page.page.inner_text("#fly-error"))
    page.page.uncheck("#degrees")
    assert page.page.input_value("#fly-x") == f"{x:g}"


def test_without_an_origin_nothing_of_the_earth_is_offered(start_console, visit):
    page = visit(start_console().url)
    page.wait_for_drones(len(PLACES))
    assert page.page.locator("[data-earth]").count() > 2
    assert page.page.locator("[data-earth]:visible").count() == 0
    assert page.page.request.get(f"{page.page.url}earth/places.kml").status == 404
