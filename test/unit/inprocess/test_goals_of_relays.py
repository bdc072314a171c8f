"""Where a relay flies to is not where the drone behind it goes when it loses it."""

from __future__ import annotations

import pytest
from scenarios import placed

from drone_mesh.drone.location import Location


@pytest.mark.parametrize("radio", ["disc", "shared"])
def test_a_drone_whose_relay_was_ordered_away_steps_to_where_that_stood(radio):
    network = placed([(0.0, 0.0), (0.0, 6.0), (0.0, 12.0)], seed=1, radio=radio)
    assert network.run_until(network.all_connected, within_s=120.0)
    network.run_for(60.0)
    network.order(1, 15.0, 6.0)
    network.run_for(8.0)
    places = network.nodes[2].component.places
    assert places.good == Location(6.0, 0.0, 0.0)
    assert network.run_until(lambda: network.connected(2), within_s=60.0)
