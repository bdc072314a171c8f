"""What each node does now, in words."""

from __future__ import annotations

import pytest

from drone_mesh.drone.roles import Role
from drone_mesh.state.doing import doings
from drone_mesh.state.model import NodeStatus

HERE = (1.0, 2.0, 0.0)


def router(**fields: object) -> NodeStatus:
    return NodeStatus(3, **{"connected": True, "position": HERE, **fields})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("node", "words"),
    [
        (router(), "relays for nobody"),
        (router(connected=False), "looks for a gateway"),
        (router(connected=False, repair="waits 12 s for a gateway"), "waits 12 s for a gateway"),
        (router(path=(4.0, 6.0, 0.0)), "flies to x 4.0, y 6.0: 5 m left"),
        (router(path=HERE), "flies"),  # a real one does not report its goal
        (router(path=(4.0, 6.0, 0.0), position=(float("nan"),) * 3), "flies"),
        (router(heading=(4.0, 6.0, 0.0)), "flies with its pilot"),
        (
            router(heading=(4.0, 6.0, 0.0), mission="mission, waypoint 1 of 2"),
            "mission, waypoint 1 of 2",
        ),
        (router(on=False, path=(4.0, 6.0, 0.0)), ""),
        (router(report_age=9.0), ""),
        (router(crashed=True), ""),
        (router(pad="waits for the crew"), "waits for the crew"),
    ],
)
def test_the_words_of_one_router(node, words):
    assert doings([node]) == {3: words}


def test_both_sides_of_a_relief_are_told():
    comes = NodeStatus(4, connected=True, position=HERE, path=(4.0, 6.0, 0.0), relieves=3)
    words = {
        3: "4 relieves it; relays for nobody",
        4: "relieves 3; flies to x 4.0, y 6.0: 5 m left",
    }
    assert doings([router(), comes]) == words


def test_a_relay_and_a_gateway_count_the_routes_that_lead_there():
    nodes = [
        NodeStatus(0, role=Role.GATEWAY, connected=True),
        NodeStatus(1, connected=True, route=bytes([1, 0])),
        NodeStatus(2, connected=True, route=bytes([2, 1, 0])),
        NodeStatus(3, connected=True, route=bytes([3, 2, 1, 0])),
    ]
    assert doings(nodes) == {
        0: "serves 3 routers",
        1: "relays for 2 routers",
        2: "relays for 1 router",
        3: "relays for nobody",
    }


def test_a_gateway_without_internet_relays_for_its_routers_to_another_gateway():
    nodes = [
        NodeStatus(0, role=Role.GATEWAY, connected=True, route=bytes([0, 1])),
        NodeStatus(1, role=Role.GATEWAY, connected=True),
        NodeStatus(2, connected=True, route=bytes([2, 0, 1])),
    ]
    assert doings(nodes) == {
        0: "relays for 1 router",
        1: "serves 2 routers",
        2: "relays for nobody",
    }
