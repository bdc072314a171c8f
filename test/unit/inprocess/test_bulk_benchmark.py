"""The benchmark of throughput."""

from __future__ import annotations

import pytest

from drone_mesh.inprocess import bulk_benchmark


@pytest.mark.slow
def test_two_hops_carry_about_half_of_what_one_carries():
    one, two = (bulk_benchmark.emulated(hops, 2.0) for hops in (1, 2))
    assert 0.4 < two / one < 0.6
