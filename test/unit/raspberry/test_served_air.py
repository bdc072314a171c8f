"""Which processes can join an emulated air that a gateway serves."""

from __future__ import annotations

import pytest

from drone_mesh.raspberry.emulated_air import EmulatedAir, serving_node
from drone_mesh.raspberry.options import parse_gateway
from drone_mesh.raspberry.program import without_internet


@pytest.mark.parametrize(("address", "warns"), [("0", False), ("0.0.0.0:0", True)])
def test_an_air_is_served_on_this_machine_only_unless_requested_and_then_with_a_warning(
    address, warns, caplog
):
    options = parse_gateway(["--emulated-air-serve", address], {})
    assert options.air.serve is not None
    air = EmulatedAir(options.radio, 1)
    try:
        node = serving_node(options, air, options.air.serve, without_internet)
        node.stop()
    finally:
        air.close()
    assert ("no password" in caplog.text) is warns
