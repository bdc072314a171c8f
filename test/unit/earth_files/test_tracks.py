"""Tracks: where drones have been."""

from __future__ import annotations

from drone_mesh.drone.location import Location
from drone_mesh.earth_files import Path, tracks_of


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
