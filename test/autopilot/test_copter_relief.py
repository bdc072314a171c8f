"""One relief of three copters of ArduPilot on the simulator's own batteries, ten times as fast.

Two hold posts, one stands by with a full battery. Relief and StandingOrders decide as they do for
the simulation of ROS; no packets: all count as connected to each other.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import time
from pathlib import Path
from typing import Callable, Iterator

import pytest
from copter_rig import WORKER, CopterRig

from drone_mesh.drone.flight_path import SPEED_M_S
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.limits import FlightLimits
from drone_mesh.drone.roles import Role
from drone_mesh.formations.relief import Relief, ReliefRules
from drone_mesh.formations.relief_policies import SpareFirst
from drone_mesh.formations.standing_orders import StandingOrders
from drone_mesh.state.model import MeshStatus, NodeStatus

pytestmark = pytest.mark.timeout(1800)  # flights last

SPEEDUP = 10.0
CAPACITY_AH = 5.0  # of 28 A in hover
HOVER_S = 3600.0 * CAPACITY_AH / 28.0
HOLDS_M = 2.0  # the place beside its post, and what the copter drifts
BATTERY = {
    "SIM_BATT_CAP_AH": CAPACITY_AH,
    "BATT_CAPACITY": 1000.0 * CAPACITY_AH,
    "BATT_LOW_VOLT": 0.0,  # its own failsafe acts at a charge, which the relief must not let come
    "BATT_LOW_MAH": 150.0 * CAPACITY_AH,
}
LIMITS = FlightLimits(
    speed_m_s=SPEED_M_S, min_battery_percent=10.0, cruise_height_m=8.0, layer_m=2.0
)
HOMES = {1: Location(0, 0, 0), 2: Location(0, 6, 0), 3: Location(0, 12, 0)}
POSTS = {1: Location(12, 0, 6), 2: Location(12, 12, 6)}


class Trio:
    """Three copters, their engines, and the rules that send them."""

    def __init__(self, rigs: dict[int, CopterRig]) -> None:
        self.rigs, self.orders = rigs, StandingOrders()
        rules = ReliefRules(hover_s=HOVER_S)
        self.relief = Relief(SpareFirst(), rules, HOMES)
        self.goals: dict[int, Location] = {}
        self.nearest_m = math.inf  # between two of which one is in the air
        self.longest_gap_s, self._held_s = 0.0, {post: math.inf for post in POSTS}
        self._looked_s = -math.inf

    def now_s(self) -> float:
        """The first copter's clock."""
        return self.rigs[1].pilot.uptime_s

    def place(self, node: int) -> Location:
        return self.rigs[node].engine.get_location()

    def is_down(self, node: int) -> bool:
        return bool(self.rigs[node].engine.status().on_ground)

    def percent(self, node: int) -> float:
        percent = self.rigs[node].engine.battery_percent()
        return math.nan if percent is None else percent

    def _status(self, node: int) -> NodeStatus:
        engine = self.rigs[node].engine
        flies = engine.is_flying() and node in self.goals
        place = self.place(node)
        if self.is_down(node):  # what it stands on is some centimetres off its home
            place = place._replace(height=0.0)
        return NodeStatus(
            node,
            connected=True,
            neighbours=bytes(other for other in (0, *HOMES) if other != node),
            position=place.to_vector(),
            path=self.goals[node].to_vector() if flies else (),
            battery=self.percent(node),
            why_not_fly=engine.why_not_fly(),
            home=HOMES[node].to_vector(),
        )

    def look(self) -> None:
        """Read all copters; once a second of their clock, decide."""
        for rig in self.rigs.values():
            rig.pilot.read(0.01)
        now_s = self.now_s()
        for one, other in itertools.combinations(HOMES, 2):
            if not (self.is_down(one) and self.is_down(other)):
                distance_m = self.place(one).distance_m(self.place(other))
                self.nearest_m = min(self.nearest_m, distance_m)
        for post, place in POSTS.items():
            if any(self.place(node).distance_m(place) <= HOLDS_M for node in HOMES):
                self._held_s[post] = now_s
            self.longest_gap_s = max(self.longest_gap_s, now_s - self._held_s[post])
        if now_s - self._looked_s < 1.0:
            return
        self._looked_s = now_s
        gateway = NodeStatus(0, Role.GATEWAY, connected=True, position=(0.0, 6.0, 0.0))
        mesh = MeshStatus(now_s, [gateway, *map(self._status, HOMES)], 100.0)
        self.relief.update(mesh, self.orders)
        for node, to in self.orders.update(mesh):
            print(f"{now_s:6.0f} s  {node} to {to.in_words()}, {self.percent(node):.0f} %")
            self.goals[node] = to
            self.rigs[node].engine.set_goal(*to)

    def are_at_posts(self) -> bool:
        return all(self.place(node).distance_m(post) < 1.0 for node, post in POSTS.items())

    def until(self, what: str, holds: Callable[[], bool], within_s: float) -> None:
        """Until it holds, within so many seconds of all clocks."""
        end_s = time.monotonic() + within_s
        while not holds():
            assert time.monotonic() < end_s, f"not {what}: {[*map(self._status, HOMES)]}"
            self.look()


@pytest.fixture
def trio(
    program: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Trio]:
    real = time.monotonic
    monkeypatch.setattr(time, "monotonic", lambda: SPEEDUP * real())  # the engines' as well
    with contextlib.ExitStack() as stack:
        rigs = {}
        for node, home in HOMES.items():
            folder = tmp_path / f"copter{node}"
            folder.mkdir()
            instance = 10 * WORKER + node - 1  # so that its system id is the node's
            rigs[node] = stack.enter_context(
                CopterRig(
                    program, folder, instance, SPEEDUP, parameters=BATTERY, limits=LIMITS,
                    home=home, node=node,
                )
            )  # fmt: skip
        yield Trio(rigs)


def test_a_full_copter_takes_over_before_another_one_must_land(trio: Trio) -> None:
    trio.orders.give("posts", POSTS, trio.now_s())
    trio.until("at their posts", trio.are_at_posts, 400.0)
    trio.nearest_m = math.inf
    trio.until("relieved", lambda: trio.relief.reliefs == 1, 2.0 * HOVER_S)
    trio.look()
    old = next(node for node in POSTS if trio.goals[node] == HOMES[node])
    trio.until("home", lambda: trio.is_down(old) and not trio.rigs[old].pilot.armed, 300.0)
    away_m = trio.place(old).distance_m(HOMES[old])
    print(
        f"{old} is home, {away_m:.1f} m off, with {trio.percent(old):.0f} %; longest gap "
        f"{trio.longest_gap_s:.0f} s, nearest {trio.nearest_m:.2f} m"
    )
    assert away_m < 2.0
    assert trio.percent(old) > 20.0
    assert trio.longest_gap_s <= 10.0
    assert trio.nearest_m >= 1.0
    assert all(rig.pilot.mode == "GUIDED" for node, rig in trio.rigs.items() if node != old)
