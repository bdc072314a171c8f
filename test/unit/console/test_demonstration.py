"""The demonstration of a repair, on a real mesh under a virtual clock."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import pytest

from drone_mesh.console.controls import OrderRefused
from drone_mesh.console.demonstration import Casting, RepairDemonstration
from drone_mesh.console.relief_demonstration import ReliefDemonstration
from drone_mesh.formations.layouts import Layouts
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.node import event_records
from drone_mesh.state.alarms import AlarmBook
from drone_mesh.state.model import MeshStatus

STATE_PERIOD_S = 0.2  # wall time between two states
DONE = "Everything is put back: power, places and speed"
AT_PLACE_M = 0.5


class Fleet:
    """A MeshControls on a network, whose time runs as ordered."""

    def __init__(
        self, gateways: int = 1, routers: int = 17, repair: str = "thesis", spacing: float = 1.0
    ) -> None:
        self.network = Network(seed=1, repair=repair)
        self.network.add_fleet(gateways, routers, spacing=spacing)
        self.network.run_for(5.0)
        self.alarms = AlarmBook()
        self._told = 0
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
            mesh = self.state()
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

    def state(self) -> MeshStatus:
        """The mesh now; its alarms are noted."""
        mesh = replace(self.network.status(), real_time_factor=self.factor)
        events = self.network.events[self._told :]
        self.alarms.on_events(event_records(events))
        self._told += len(events)
        self.alarms.update(mesh)
        return mesh

    def fly_layout(self, case: int) -> None:
        for drone, goal in sorted(Layouts({}).orders(case), reverse=True):
            self.network.order(drone, goal.longitude, goal.latitude, int(goal.height))
        self.network.run_for(60.0)

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
    assert told[-1] == DONE
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


def test_nodes_that_are_off_because_the_fleet_is_only_starting_are_not_left_off():
    fleet, demonstration = Fleet(routers=5), RepairDemonstration()
    mesh = fleet.state()
    dark = replace(mesh, stamp_s=0.1, nodes=[replace(node, on=False) for node in mesh.nodes])
    assert demonstration.advance(dark) == []
    fleet.watch(demonstration)
    assert (texts(demonstration)[-1], fleet.is_off) == (DONE, set())


@pytest.mark.parametrize("after_s", [0.4, 5.0, 25.0])
def test_it_can_be_ended_at_any_moment_and_puts_everything_back(after_s):
    fleet, demonstration = Fleet(), RepairDemonstration()
    before = fleet.places()
    fleet.watch(demonstration, end_after_s=after_s)
    assert "Not finished: ended by the user" in texts(demonstration)
    assert (fleet.factor, fleet.is_off) == (2.0, set())
    assert fleet.places() == before


class SlowSwitch(Fleet):
    """A fleet whose router 2 needs 20 simulated seconds before it is on again."""

    on_at_s = math.inf

    def power(self, node: int, on: bool) -> str:
        if node == 2 and on:
            self.on_at_s = min(self.on_at_s, self.network.now_s() + 20.0)
            if self.network.now_s() < self.on_at_s:
                return ""
        return super().power(node, on)


def test_a_drone_that_is_slow_to_come_back_is_waited_for_before_anybody_leaves_it():
    fleet, demonstration = SlowSwitch(), RepairDemonstration()
    before = fleet.places()
    fleet.watch(demonstration)
    assert texts(demonstration)[-1] == DONE
    assert (fleet.is_off, fleet.places()) == (set(), before)


class Witness(Fleet):
    """Notes which drones fly home while others, still away, need them as relays."""

    def __init__(self, demonstration: RepairDemonstration, **fleet: Any) -> None:
        super().__init__(**fleet)
        self.demonstration = demonstration
        self.home = self.places()
        self.deserted: list[tuple[int, int]] = []

    def fly(self, node: int, x: float, y: float, z: float, allow_shared_place: bool = False) -> str:
        if self.demonstration.is_leaving:
            there = self.places()
            self.deserted += [
                (node, other.id)
                for other in self.network.status().nodes
                if there[other.id] != self.home[other.id] and node in list(other.route)[1:-1]
            ]
        return super().fly(node, x, y, z, allow_shared_place)


def test_no_drone_flies_home_while_another_one_needs_it_as_a_relay():
    demonstration = RepairDemonstration()
    fleet = Witness(demonstration, spacing=6.0)
    fleet.watch(demonstration)
    assert texts(demonstration)[-1] == DONE
    assert fleet.deserted == []
    lost = demonstration.plan.cast[2:]  # the group whose repair is shown; no others are alarms
    assert [(alarm["nodes"], alarm["over"]) for alarm in fleet.alarms.groups()] == [(lost, True)]


@pytest.mark.parametrize(("spacing", "case"), [(1.0, 0), (8.0, None)])
def test_put_back_is_said_last_and_only_when_it_is_so(spacing, case):
    fleet, demonstration = Fleet(spacing=spacing), RepairDemonstration()
    if case is not None:
        fleet.fly_layout(case)
    before = fleet.state()
    fleet.watch(demonstration)
    told = texts(demonstration)
    assert (told[-1], told.count(DONE)) == (DONE, 1)
    assert any("are connected again" in text for text in told), told
    after = fleet.state()
    assert after.real_time_factor == before.real_time_factor
    for was, now in zip(before.nodes, after.nodes):
        assert now.on == was.on, now.id
        assert now.connected or not was.connected, now.id
        assert math.dist(now.position, was.position) < AT_PLACE_M, now.id


class Stubborn(Fleet):
    """Its drone 4 takes no order to fly home."""

    def fly(self, node: int, x: float, y: float, z: float, allow_shared_place: bool = False) -> str:
        if node == 4 and math.hypot(x, y) < 4.5:
            raise OrderRefused("it does not listen")
        return super().fly(node, x, y, z, allow_shared_place)


def test_what_cannot_be_put_back_is_named_with_what_to_do_about_it():
    fleet, demonstration = Stubborn(), RepairDemonstration()
    fleet.watch(demonstration)
    told = texts(demonstration)
    assert DONE not in told
    assert re.fullmatch(
        r"Not everything is put back after 31\d s: 4 is 1\d m from its place: send it to "
        r"x 3, y 0, z 0 m",
        told[-1],
    ), told[-1]
    assert (fleet.factor, fleet.is_off) == (2.0, set())


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


def test_without_pads_a_relief_is_refused_with_the_command_that_has_them():
    demonstration = ReliefDemonstration()
    fleet = Fleet()
    fleet.watch(demonstration)
    assert texts(demonstration) == [
        "Not finished: this demonstration needs a gateway, and 3 routers on pads with crews: start "
        "it with scripts/run demo:=relief"
    ]


def test_four_routers_are_too_few():
    fleet, demonstration = Fleet(routers=4), RepairDemonstration()
    fleet.watch(demonstration)
    assert texts(demonstration) == [
        "Not finished: this demonstration needs a gateway and 5 routers that can fly"
    ]
