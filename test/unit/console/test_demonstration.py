"""The demonstration of a repair, on a real mesh under a virtual clock."""

from __future__ import annotations

import pytest

from drone_mesh.console.controls import OrderRefused
from drone_mesh.console.demonstration import RepairDemonstration
from drone_mesh.inprocess import Network

STATE_PERIOD_S = 0.2  # wall time between two states


class Fleet:
    """A MeshControls on a network, whose time runs as ordered."""

    def __init__(self, gateways: int = 1, routers: int = 17, repair: str = "thesis") -> None:
        self.network = Network(seed=1, repair=repair)
        self.network.add_fleet(gateways, routers, spacing=1.0)
        self.network.run_for(5.0)
        self.factor = 2.0
        self.is_off: set[int] = set()
        self.wall_s = 0.0

    def power(self, node: int, on: bool) -> str:
        self.network.power(node, on)
        self.is_off = self.is_off - {node} if on else self.is_off | {node}
        return ""

    def fly(self, node: int, x: float, y: float, z: float, allow_shared_place: bool = False) -> str:
        if not self.network.order(node, x, y, round(z)):
            raise OrderRefused(f"no gateway has a route to drone {node}")
        return ""

    def layout(self, case: int) -> str:
        raise NotImplementedError

    def speed(self, paused: bool, factor: float) -> str:
        assert not paused
        self.factor = factor
        return ""

    def watch(self, demonstration: RepairDemonstration) -> None:
        while not demonstration.is_over:
            mesh = self.network.status()
            mesh = type(mesh)(**{**vars(mesh), "real_time_factor": self.factor})
            for order in demonstration.advance(mesh):
                order(self)
            self.network.run_for(STATE_PERIOD_S * self.factor)
            self.wall_s += STATE_PERIOD_S
        for order in demonstration.leave():
            order(self)


def texts(demonstration: RepairDemonstration) -> list[str]:
    return [step.text for step in demonstration.story.steps]


def test_it_arranges_five_drones_and_follows_their_repair():
    fleet, demonstration = Fleet(), RepairDemonstration()
    fleet.watch(demonstration)
    told = texts(demonstration)
    assert told[0].startswith("12 other drones could provide another route")
    assert any("3 bids 18.0 m, 4 bids 15.5 m, 5 bids 15.3 m" in text for text in told)
    assert "3, 4 and 5 are connected again" in told[-1]
    assert 20.0 < fleet.wall_s < 60.0


def test_afterwards_the_speed_and_the_other_drones_are_as_before():
    fleet, demonstration = Fleet(), RepairDemonstration()
    fleet.watch(demonstration)
    assert fleet.factor == 2.0
    assert fleet.is_off == {2}


def test_with_two_gateways_the_second_one_takes_no_part():
    fleet, demonstration = Fleet(gateways=2, routers=5), RepairDemonstration()
    fleet.watch(demonstration)
    told = texts(demonstration)
    assert told[0].startswith("1 other drone could provide another route, and is switched off")
    assert "4, 5 and 6 are connected again" in told[-1]


def test_a_strategy_that_never_flies_ends_it_with_the_reason():
    fleet, demonstration = Fleet(routers=5, repair="stay"), RepairDemonstration()
    with pytest.raises(OrderRefused, match="3, 4 and 5 have no gateway, and none flew after 240 s"):
        fleet.watch(demonstration)


def test_four_routers_are_too_few():
    fleet, demonstration = Fleet(routers=4), RepairDemonstration()
    with pytest.raises(OrderRefused, match="this demonstration needs a gateway and 5 routers"):
        fleet.watch(demonstration)
