"""The common frame on the earth, checked against PROJ."""

from __future__ import annotations

import math
import random

import pytest

from drone_mesh.drone.geodesy import EarthPlace, Origin
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError

pyproj = pytest.importorskip("pyproj")

UTRECHT = Origin(52.0907, 5.1214, 0.0)
ORIGINS = (
    UTRECHT,
    Origin(-33.8688, 151.2093, 20.0),
    Origin(0.0, 0.0, 0.0),
    Origin(69.6492, 18.9553, 5.0),
    Origin(-16.5, -68.15, 3640.0),
    Origin(52.0, 179.99, 0.0),
)


def _places(seed: int, count: int = 300) -> list[Location]:
    rng = random.Random(seed)
    places = [Location(y, x, 0.0) for x in (-5000.0, 0.0, 5000.0) for y in (-5000.0, 5000.0)]
    while len(places) < count:
        x, y = rng.uniform(-5000, 5000), rng.uniform(-5000, 5000)
        places.append(Location(y, x, rng.uniform(0.0, 500.0)))
    return places


@pytest.mark.parametrize("origin", ORIGINS, ids=str)
def test_a_place_comes_back_from_the_earth_within_a_tenth_of_a_millimetre(origin: Origin) -> None:
    for place in _places(1):
        assert origin.to_frame(origin.to_earth(place)).distance_m(place) < 1e-4


@pytest.mark.parametrize("origin", ORIGINS, ids=str)
def test_distances_over_5_km_agree_with_proj_within_a_centimetre(origin: Origin) -> None:
    to_ecef = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)

    def ecef(place: Location) -> tuple[float, float, float]:
        earth = origin.to_earth(place._replace(height=0.0))
        x, y, z = to_ecef.transform(earth.longitude_deg, earth.latitude_deg, origin.altitude_m)
        return (x, y, z)

    here = ecef(Location(0.0, 0.0, 0.0))
    for place in _places(2):
        horizontal = math.hypot(place.latitude, place.longitude)
        if horizontal <= 5000.0:
            assert math.dist(here, ecef(place)) == pytest.approx(horizontal, abs=0.01)


def test_north_and_east_are_those_of_the_geodesic() -> None:
    geod = pyproj.Geod(ellps="WGS84")
    for azimuth_deg, north, east in ((0.0, 5000.0, 0.0), (90.0, 0.0, 5000.0)):
        longitude, latitude, _ = geod.fwd(
            UTRECHT.longitude_deg, UTRECHT.latitude_deg, azimuth_deg, 5000.0
        )
        place = UTRECHT.to_frame(EarthPlace(latitude, longitude, 12.5))
        assert place.latitude == pytest.approx(north, abs=0.01)
        assert place.longitude == pytest.approx(east, abs=0.01)
        assert place.height == 12.5


def test_straight_up_changes_neither_east_nor_north() -> None:
    low, high = (UTRECHT.to_earth(Location(4000.0, -3000.0, h)) for h in (0.0, 500.0))
    assert low[:2] == high[:2]
    assert high.altitude_m - low.altitude_m == 500.0


def test_the_digest_of_an_origin_is_the_same_everywhere_and_never_zero() -> None:
    assert UTRECHT.digest == 0x09A4
    assert Origin(52.0907, 5.1214, 0.004).digest == UTRECHT.digest
    rng = random.Random(3)
    origins = {
        Origin(rng.uniform(-80, 80), rng.uniform(-180, 180), rng.uniform(0, 100))
        for _ in range(1000)
    }
    digests = {origin.digest for origin in origins}
    assert 0 not in digests
    assert len(digests) > 980  # of 65535 values, about 8 pairs of 1000 meet


def test_an_origin_is_read_from_three_numbers() -> None:
    assert Origin.parse("52.0907, 5.1214,0") == UTRECHT


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("52.1,5.1", "LAT,LON,ALT"),
        ("52.1,5.1,high", "LAT,LON,ALT"),
        ("91,5.1,0", "latitude 91 is outside"),
        ("nan,5.1,0", "LAT,LON,ALT"),
        ("52,181,0", "longitude 181 is outside"),
        ("52,5,inf", "LAT,LON,ALT"),
    ],
)
def test_a_bad_origin_is_refused_with_a_reason(text: str, why: str) -> None:
    with pytest.raises(ConfigurationError, match=why):
        Origin.parse(text)
