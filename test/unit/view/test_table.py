"""The table of `status`."""

from __future__ import annotations

from drone_mesh.drone.roles import Role
from drone_mesh.state.model import MeshStatus, NodeStatus
from drone_mesh.view.table import mesh_table

MESH = MeshStatus(
    12.34,
    [
        NodeStatus(
            0, Role.GATEWAY, connected=True, gateway=0, hops=0, next_hop=0, route=b"\x00",
            position=(-1.0, 0.0, 0.0), neighbours=b"\x01", neighbour_ages=b"\x02",
        ),
        NodeStatus(1, position=(0.0, 4.0, 0.0), path=(0.0, 4.0, 3.0, 5.0, 6.0, 0.0)),
        NodeStatus(2, on=False),
    ],
    achieved_real_time_factor=2.04,
)  # fmt: skip


def test_the_table_in_a_pipe_is_plain_text():
    lines = mesh_table(MESH, colours=False).splitlines()
    assert lines[0] == "t = 12.3 s, speed 2x: 0 of 1 routers connected, 1 switched off"
    assert lines[1].split() == [
        "node", "kind", "power", "connected", "gateway", "hops", "neighbours", "known", "sent",
        "position", "(x,", "y,", "z)", "route", "remark",
    ]  # fmt: skip
    assert lines[2].split() == [
        "0", "gateway", "on", "yes", "0", "0", "1", "0", "0", "-1.0,", "0.0,", "0.0", "0",
    ]  # fmt: skip
    assert "0.0, 4.0, 0.0 -> 5.0, 6.0, 0.0" in lines[3]
    assert lines[3].endswith("flying")
    assert lines[4].split() == [
        "2", "router", "off", "no", "-", "-", "0", "0", "0", "-", "-", "switched", "off",
    ]  # fmt: skip
    assert "\x1b" not in "".join(lines)


def test_on_a_terminal_rows_have_the_colour_of_their_condition():
    lines = mesh_table(MESH, colours=True).splitlines()
    assert lines[0].startswith("\x1b[31m")
    assert "\x1b" not in lines[2]
    assert lines[3].startswith("\x1b[33m")
    assert lines[3].endswith("\x1b[0m")
    assert lines[4].startswith("\x1b[90m")


def test_a_long_route_loses_its_middle():
    node = NodeStatus(9, connected=True, route=bytes([9, 8, 7, 6, 5, 4, 3, 0]))
    assert "9 > 8 > 7 > ... > 3 > 0" in mesh_table(MeshStatus(0.0, [node]), colours=False)


def test_on_a_shared_channel_the_table_shows_what_each_node_does_on_it():
    nodes = [
        NodeStatus(
            0, Role.GATEWAY, connected=True, airtime=0.0123, tries=1.25, queue=3, given_up=2
        ),
        NodeStatus(1, connected=True, tries=1.0),
    ]
    lines = mesh_table(MeshStatus(1.0, nodes), colours=False).splitlines()
    assert "airtime  tries  queue  given up" in lines[1]
    assert "1.2 %    1.25   3      2" in lines[2]
    assert "0.0 %    1.00   0      0" in lines[3]


def test_the_heading_names_the_routing_and_the_repair_in_use():
    mesh = MeshStatus(1.0, [], paused=True, routing="etx_tree", repair_strategy="thesis")
    heading = mesh_table(mesh, colours=False).splitlines()[0]
    assert heading.startswith("t = 1.0 s, paused")
    assert heading.endswith("; routing etx_tree; repair thesis")


def test_a_remark_ends_with_what_the_repair_does_and_why():
    node = NodeStatus(3, repair="does not fly: the place of 2 is occupied by 4")
    row = mesh_table(MeshStatus(1.0, [node]), colours=False).splitlines()[2]
    assert row.endswith("not connected to a gateway; does not fly: the place of 2 is occupied by 4")
    node = NodeStatus(3, connected=True, gateway=0, mission="mission, waypoint 3 of 12, 41 s left")
    row = mesh_table(MeshStatus(1.0, [node]), colours=False).splitlines()[2]
    assert row.endswith("mission, waypoint 3 of 12, 41 s left")
