"""What a node makes of others' words about the place of its gateway."""

from __future__ import annotations

import pytest

from drone_mesh.communication.control.places import KnownPlaces
from drone_mesh.drone.location import Location


@pytest.mark.parametrize(("off_m", "disputed"), [(0.4, False), (0.6, True)])
def test_a_rounded_place_of_the_gateway_is_no_other_place(off_m: float, disputed: bool) -> None:
    """Heights travel in whole metres."""
    places = KnownPlaces()
    places.update_gateway(Location(0.0, 0.0, 0.0), 1.0)
    places.hear_of_gateway(Location(0.0, 0.0, off_m), 2.0, connected=True)
    assert places.gateway_disputed is disputed
    assert places.gateway_seen_s == (1.0 if disputed else 2.0)
