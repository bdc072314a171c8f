"""No line in the log of a mesh in which nothing is wrong."""

from __future__ import annotations

import logging

import pytest
from scenarios import LAYOUTS

from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.inprocess import Network
from drone_mesh.layouts import GRID_CASE, Layouts

KEY = MeshKey(bytes(range(16)))
ALL = sorted({*LAYOUTS.cases, *Layouts({}).cases})
LARGE = [case for case in ALL if len(LAYOUTS.orders(case)) > 1]


def fly_to(layout, seed, **options):
    """The factory's fleet, as the default run starts it, flies to a layout."""
    network = Network(seed=seed, **options)
    orders = LAYOUTS.orders(layout)
    network.add_fleet(1, max(17, *(order.node_id for order in orders)), 6, 1.0)
    network.run_for(20.0)
    for drone, goal in orders:
        network.order(
            drone, goal.longitude, goal.latitude, int(goal.height), allow_shared_place=True
        )
    network.run_for(100.0)


def assert_quiet(caplog):
    lines = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
    assert lines == []


@pytest.mark.parametrize("key", [None, KEY], ids=["no key", "key"])
@pytest.mark.parametrize("routing", ["child_table_tree", "beacon"])
@pytest.mark.parametrize("radio", ["disc", "shared"])
def test_the_default_run_has_a_quiet_log(radio, routing, key, caplog):
    fly_to(0, seed=2, radio=radio, routing=routing, key=key)
    assert_quiet(caplog)


def test_no_relay_is_suspected_because_the_gateway_answers_along_an_old_way(caplog):
    fly_to(0, seed=9, radio="shared", key=KEY)
    assert_quiet(caplog)


@pytest.mark.slow
@pytest.mark.parametrize("layout", [case for case in ALL if case != GRID_CASE])
@pytest.mark.parametrize(("radio", "key"), [("disc", None), ("disc", KEY), ("shared", None)])
def test_every_layout_has_a_quiet_log(radio, key, layout, caplog):
    for seed in range(4 if layout in LARGE else 1):
        fly_to(layout, seed=seed, radio=radio, key=key)
    assert_quiet(caplog)
