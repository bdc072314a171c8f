"""Emulated radios and simulated MAVLink vehicles together: the whole way of a flight."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path
from typing import Callable, Iterator

import pytest

from drone_mesh.drone.interfaces import Location
from drone_mesh.layouts import Layouts
from drone_mesh.raspberry.emulated_air import EmulatedAir
from drone_mesh.raspberry.emulated_fleet import EmulatedFleet
from drone_mesh.raspberry.node import RadioNode
from drone_mesh.raspberry.options import parse_router
from drone_mesh.raspberry.program import without_internet

PATIENCE_S = 100.0
SCALE = 11.0  # the range of an emulated radio is that many times the 9 m of the layout's
GATEWAY = Location(latitude=0.0, longitude=-1.0, height=0.0)
LAYOUT_202 = {
    0: GATEWAY,
    **dict(Layouts.load(Path(__file__).parents[3] / "config" / "casus.yaml").orders(202)),
}
OPTIONS = "--emulated 6 --drones mavlink --check-period 2 --connection-lost-after 4 --speed 15"


class LayoutAir(EmulatedAir):
    """The nodes stand as in layout 202."""

    def place(self, node_id: int) -> Location:
        place = LAYOUT_202[node_id]
        return Location(SCALE * place.latitude, SCALE * place.longitude, float(place.height))


@pytest.fixture
def mesh() -> Iterator[tuple[EmulatedFleet, dict[int, RadioNode]]]:
    """Layout 202 without hardware: driver, mesh software and engine are the real ones."""
    options = parse_router(OPTIONS.split(), {})
    with contextlib.ExitStack() as stack:
        air = LayoutAir(options.radio, options.emulated)
        stack.callback(air.close)
        fleet = EmulatedFleet(options.fleet, options.flight, air)
        stack.callback(fleet.close)
        nodes = {}
        for node_id in LAYOUT_202:
            internet = None if node_id else without_internet
            radio = air.radio(node_id, options.radio)
            node = RadioNode(radio, fleet.engine(node_id), options, internet)
            stack.callback(node.stop)
            nodes[node_id] = node
        for vehicle in fleet.vehicles:
            vehicle.body.speed_m_s = 20.0
        yield fleet, nodes


def test_layout_202_without_node_1_is_repaired_by_a_drone_that_really_flies(mesh) -> None:
    fleet, nodes = mesh

    def wait_for(what: str, holds: Callable[[], bool]) -> None:
        deadline = time.monotonic() + PATIENCE_S
        while not holds():
            assert time.monotonic() < deadline, f"not within {PATIENCE_S:g} s: {what}"
            fleet.move_radios()
            time.sleep(0.2)

    def connected(*node_ids: int) -> bool:
        return all(nodes[node_id].component.get_connected_to_gateway() for node_id in node_ids)

    for node in nodes.values():
        node.start()
    wait_for("all can fly", lambda: all(node.engine.can_fly() for node in nodes.values()))
    wait_for("all are connected", lambda: connected(*nodes))
    wait_for(
        "each knows where to step back to",
        lambda: all(
            nodes[n].component.get_last_good_known_location_id() in nodes for n in (2, 3, 4, 5)
        ),
    )
    nodes[1].stop()
    wait_for("2 has lost its connection", lambda: not connected(2))
    wait_for("2, 3, 4 and 5 are connected again", lambda: connected(2, 3, 4, 5))
    wait_for("2 has arrived", lambda: not nodes[2].engine.is_flying())
    place = nodes[2].engine.get_location()
    goal = LAYOUT_202[1]
    assert place.latitude == pytest.approx(SCALE * goal.latitude, abs=1.5)
    assert place.longitude == pytest.approx(SCALE * goal.longitude, abs=1.5)
    assert place.height > 5.0  # it hovers; nobody ordered it to land
