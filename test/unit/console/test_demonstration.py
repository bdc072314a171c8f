"""The demonstration of a repair, on a real mesh under a virtual clock."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from drone_mesh.console.controls import OrderRefused
from drone_mesh.console.demonstration import Casting, RepairDemonstration
from drone_mesh.formations.layouts import Layouts
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

    def watch(self, demonstration: RepairDemonstration, end_after_s: float = math.inf) -> None:
        """As the stage does; from `end_after_s` (wall) on it shall end."""
        while not demonstration.is_over:
            mesh = replace(self.network.status(), real_time_factor=self.factor)
            if self.wall_s >= end_after_s and not demonstration.is_leaving:
                demonstration.leave("ended by the user", mesh.stamp_s)
            try:
                for order in demonstration.advance(mesh):
                    order(self)
            except OrderRefused as error:
                assert not demonstration.is_leaving
                demonstration.leave(str(error), mesh.stamp_s)
            self.network.run_for(STATE_PERIOD_S * self.factor)
            self.wall_s += STATE_PERIOD_S

    def places(self) -> dict[int, tuple[int, int]]:
        """x and y in whole metres, by node."""
        nodes = self.network.status().nodes
        return {node.id: (round(node.position[0]), round(node.position[1])) for node in nodes}


def texts(demonstration: RepairDemonstration) -> list[str]:
    return [step.text for step in demonstration.story.steps]


def test_it_arranges_five_drones_and_follows_their_repair():
    fleet, demonstration = Fleet(), RepairDemonstration()
    fleet.watch(demonstration)
    told = texts(demonstration)
    assert told[0].startswith("The gateway sends five drones out: 1 and 2 as a chain, 3, 4 and 5")
    assert told[1].startswith("12 other drones could provide another route")
    assert any("3 bids 18.0 m, 4 bids 15.5 m, 5 bids 15.3 m" in text for text in told)
    assert any("3, 4 and 5 are connected again" in text for text in told)
    assert told[-1] == "All drones are where they were"
    assert 20.0 < fleet.wall_s < 90.0


def test_afterwards_speed_power_and_places_are_as_before():
    fleet, demonstration = Fleet(), RepairDemonstration()
    before = fleet.places()
    for node in (0, 17):
        fleet.power(node, False)
    fleet.watch(demonstration)
    assert any("are connected again" in text for text in texts(demonstration))
    assert fleet.factor == 2.0
    assert fleet.is_off == {0, 17}
    assert fleet.places() == before


def test_it_begins_with_drones_that_stand_anywhere():
    fleet, demonstration = Fleet(), RepairDemonstration()
    for drone, goal in sorted(Layouts({}).orders(0), reverse=True):
        fleet.network.order(drone, goal.longitude, goal.latitude, int(goal.height))
    fleet.network.run_for(60.0)
    before = fleet.places()
    fleet.watch(demonstration)
    told = texts(demonstration)
    assert any("are connected again" in text for text in told), told
    assert fleet.is_off == set()
    assert fleet.places() == before


@pytest.mark.parametrize("after_s", [0.4, 5.0, 25.0])
def test_it_can_be_ended_at_any_moment_and_puts_everything_back(after_s):
    fleet, demonstration = Fleet(), RepairDemonstration()
    before = fleet.places()
    fleet.watch(demonstration, end_after_s=after_s)
    assert "Not finished: ended by the user" in texts(demonstration)
    assert (fleet.factor, fleet.is_off) == (2.0, set())
    assert fleet.places() == before


def test_it_asks_with_what_it_will_do():
    words = Casting.choose(Fleet().network.status()).in_words()
    assert words.startswith("This sends drones 1, 2, 3, 4 and 5 to places beside gateway 0, and")
    assert "switches 12 others off. Then it switches 2 off" in words


def test_its_places_are_where_no_other_drone_stands():
    fleet = Fleet(routers=6)
    fleet.network.order(6, -1.0, 4.0, 0)
    fleet.network.run_for(20.0)
    plan = Casting.choose(fleet.network.status())
    assert all(y <= 0.0 for _x, y, _z in plan.places.values())


def test_with_two_gateways_the_second_one_takes_no_part():
    fleet, demonstration = Fleet(gateways=2, routers=5), RepairDemonstration()
    fleet.watch(demonstration)
    told = texts(demonstration)
    assert told[1].startswith("1 other drone could provide another route, and is switched off")
    assert any("4, 5 and 6 are connected again" in text for text in told)


def test_a_strategy_that_never_flies_ends_it_with_the_reason():
    fleet, demonstration = Fleet(routers=5, repair="stay"), RepairDemonstration()
    fleet.watch(demonstration)
    why = "Not finished: 3, 4 and 5 have no gateway, and none flew after 240 s"
    assert any(text.startswith(why) for text in texts(demonstration))
    assert fleet.is_off == set()


def test_four_routers_are_too_few():
    fleet, demonstration = Fleet(routers=4), RepairDemonstration()
    fleet.watch(demonstration)
    assert texts(demonstration) == [
        "Not finished: this demonstration needs a gateway and 5 routers that can fly"
    ]
