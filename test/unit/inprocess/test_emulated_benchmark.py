"""The benchmark of the emulator runs the mesh that its options describe."""

from __future__ import annotations

import pytest

from drone_mesh.inprocess import emulated_benchmark


@pytest.mark.parametrize("rate", ["250k", "1M", "2M"])
def test_with_power_that_falls_with_distance_the_range_is_the_same_at_every_rate(rate, capsys):
    """The nodes stand 6 m apart; the edge is at 9 m."""
    options = ["--nodes", "3", "--seconds", "3", "--links", "distance", "--rate", rate]
    assert emulated_benchmark.main(options) == 0
    connected = next(line for line in capsys.readouterr().out.splitlines() if "connected" in line)
    assert connected.endswith(" s"), connected
