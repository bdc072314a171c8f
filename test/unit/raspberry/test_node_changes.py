"""What a gateway reports of its routers, in a network under a virtual clock."""

from __future__ import annotations

import pytest

from drone_mesh.communication.timing import MeshTiming
from drone_mesh.inprocess import Network
from drone_mesh.raspberry.node_events import NodeChanges


class Watched:
    """Gateway 0, and the routers 1 and 2 in a line, which report every 30 s."""

    def __init__(self) -> None:
        self.network = Network(
            seed=1, timing=MeshTiming(report_period_s=30.0), max_distance_m=150.0
        )
        self.network.add_gateway(0, 0.0, 0.0)
        self.network.add_router(1, 100.0, 1.0)
        self.network.add_router(2, 200.0, 1.0, why_not_fly="it stands on the ground")
        self.gateway = self.network.nodes[0].component
        self.said: list[tuple[int, str, str]] = []
        self._changes = NodeChanges(0, 10.0, self._take)

    def _take(self, event) -> None:
        self.said.append((event.node, event.kind.value, event.detail))

    def run_for(self, duration_s: float) -> list[tuple[int, str, str]]:
        """The events reported within that time."""
        self.said.clear()
        for _ in range(round(duration_s)):
            self.network.run_for(1.0)
            self._changes.compare(
                self.gateway.get_known_nodes(),
                self.gateway.get_node_reports(),
                self.network.clock.now_s,
            )
        return list(self.said)


@pytest.fixture
def watched() -> Watched:
    return Watched()


def test_routers_that_connect_and_their_reasons_are_reported_once(watched):
    said = watched.run_for(60.0)
    assert sorted(said) == [
        (1, "connected", ""),
        (2, "cannot fly", "it stands on the ground"),
        (2, "connected", ""),
    ]
    assert watched.run_for(60.0) == []


def test_a_router_that_falls_silent_is_lost_and_comes_back(watched):
    watched.run_for(35.0)
    watched.network.power(2, False)
    assert watched.run_for(70.0) == [(2, "disconnected", "no route to it for 30 s")]
    watched.network.power(2, True)
    assert watched.run_for(30.0) == [(2, "connected", "")]


def test_take_off_and_landing_of_a_drone_are_reported(watched):
    watched.run_for(30.0)
    assert watched.gateway.send_goal_request_to_drone(1, 80.0, 90.0, 5, watched.network.clock.now_s)
    said = watched.run_for(120.0)
    assert [(node, kind) for node, kind, _ in said] == [(1, "took off"), (1, "landed")]


def test_a_drone_that_can_fly_again_is_reported(watched):
    watched.run_for(35.0)
    watched.network.nodes[2].drone._why_not_fly = ""
    assert watched.run_for(35.0) == [(2, "can fly again", "")]
