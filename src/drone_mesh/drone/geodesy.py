"""The position of the mesh's common frame on the earth: degrees to metres and back.

East is the longitude axis and north the latitude axis, in metres at the height of the origin;
heights are differences of altitude, so straight up changes neither east nor north. pymap3d does the
mathematics: it is pure Python without dependencies, so it installs on every Raspberry Pi; pyproj is
30 MB of compiled PROJ for the same result, and serves as an independent reference in the tests.
"""

from __future__ import annotations

import functools
import hashlib
import math
import struct
from dataclasses import dataclass
from typing import Any, NamedTuple, Sequence

from drone_mesh.arguments import finite
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError

MAX_LATITUDE_DEG = 85.0  # closer to a pole, east and north become meaningless
ALTITUDE_RANGE_M = (-500.0, 9000.0)  # of the earth's surface, rounded outwards
_DIGEST_BYTES = 2
_RESOLUTION_DEG = 1e7  # origins are equal if they agree within MAVLink's 1e-7 degrees
_EARTH_M = 6_371_000.0  # its mean radius (IUGG)
_STEPS = 6  # each divides the error by 60 at 85 degrees, elsewhere by more; five reach micrometres


class EarthPlace(NamedTuple):
    """A position on the earth (WGS84)."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float  # above mean sea level, as autopilots report it


@dataclass(frozen=True)
class Origin:
    """The origin of the common frame. Every node of a mesh needs the same one."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float  # above mean sea level

    def __post_init__(self) -> None:
        """Raise ConfigurationError for a position that cannot be an origin."""
        lowest, highest = ALTITUDE_RANGE_M
        bounds = (
            ("latitude", self.latitude_deg, -MAX_LATITUDE_DEG, MAX_LATITUDE_DEG),
            ("longitude", self.longitude_deg, -180.0, 180.0),
            ("altitude", self.altitude_m, lowest, highest),
        )
        for name, value, low, high in bounds:
            if not low <= value <= high:  # false for NaN too
                raise ConfigurationError(f"origin: {name} {value:g} is outside {low:g}..{high:g}")

    @classmethod
    def parse(cls, text: str) -> Origin:
        """From "LAT,LON,ALT": degrees, degrees, metres. Raises ConfigurationError."""
        try:
            latitude_deg, longitude_deg, altitude_m = (finite(part) for part in text.split(","))
        except ValueError:
            raise ConfigurationError(
                f"invalid origin {text!r}: use LAT,LON,ALT, as in 52.0907,5.1214,3"
            ) from None
        return cls(latitude_deg, longitude_deg, altitude_m)

    @property
    def digest(self) -> int:
        """A number 1..65535 that differs for different origins, except for 1 pair in 65535."""
        exact = struct.pack(
            "<qqq",
            round(self.latitude_deg * _RESOLUTION_DEG),
            round(self.longitude_deg * _RESOLUTION_DEG),
            round(self.altitude_m * 100.0),
        )
        digest = hashlib.sha256(exact).digest()[:_DIGEST_BYTES]
        return int.from_bytes(digest, "little") or 1  # 0 means: no origin

    @functools.cached_property
    def _on_earth(self) -> tuple[Any, Sequence[float]]:
        """The shape of the earth (WGS84), and the origin in metres from its centre."""
        import pymap3d

        shape = pymap3d.Ellipsoid.from_name("wgs84")
        place = self.latitude_deg, self.longitude_deg, self.altitude_m
        return shape, pymap3d.geodetic2ecef(*place, shape)

    def to_frame(self, place: EarthPlace) -> Location:
        """The position in metres of the common frame."""
        import pymap3d  # with numpy, most of a second on a Pi; only frames on the earth need it

        # geodetic2enu in its parts: it computes the place of the origin again for each place.
        shape, origin = self._on_earth
        at = pymap3d.geodetic2ecef(place.latitude_deg, place.longitude_deg, self.altitude_m, shape)
        x, y, z = (there - here for there, here in zip(at, origin))
        east, north, _ = pymap3d.uvw2enu(x, y, z, self.latitude_deg, self.longitude_deg)
        return Location(float(north), float(east), place.altitude_m - self.altitude_m)

    def to_earth(self, location: Location) -> EarthPlace:
        """The position on the earth that `to_frame` puts there.

        pymap3d has no inverse along the surface, which curves away below the plane of the frame.
        """
        latitude_deg, longitude_deg = self.latitude_deg, self.longitude_deg
        for _ in range(_STEPS):
            at = self.to_frame(EarthPlace(latitude_deg, longitude_deg, self.altitude_m))
            latitude_deg += math.degrees((location.latitude - at.latitude) / _EARTH_M)
            around_m = _EARTH_M * math.cos(math.radians(latitude_deg))
            longitude_deg += math.degrees((location.longitude - at.longitude) / around_m)
        longitude_deg = math.remainder(longitude_deg, 360.0)  # beyond the date line, too
        return EarthPlace(latitude_deg, longitude_deg, self.altitude_m + location.height)
