"""MarkerMaker: turns states of the mesh into rviz markers."""

from __future__ import annotations

import math
from typing import Dict, Sequence, Tuple

from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from drone_mesh.drone.roles import Role
from drone_mesh.msg import MeshState
from drone_mesh.ros.graph import names
from drone_mesh.ros.views.marker_legend import legend_rows
from drone_mesh.state.condition import condition_of
from drone_mesh.state.links import (
    LinkForecast,
    LinkUse,
    LostLinks,
    known_links,
    links_by_use,
    shortest,
)
from drone_mesh.state.model import NodeStatus, ObstacleStatus, position_is_known, waypoints
from drone_mesh.view.palette import DARK, Colour, rgb  # rviz has a dark background
from drone_mesh.view.quadrocopter import (
    BLADE_WIDTH_M,
    MOTORS,
    ROTOR_HIGH_M,
    blade_ends,
    frame_file,
    lamp_file,
    turned_rad,
)
from drone_mesh.view.scene import Shape, fanned_positions, shape_named

MOST_LINKS = 1500  # per use: 254 drones 1 m apart have 18,000 links
TIMES_LARGER = 4.0  # how much larger than life drones are drawn
MESHES = "package://drone_mesh/meshes/"  # of drone_mesh.view
FRAME_COLOUR = DARK.muted
BOX_RADIUS_M = TIMES_LARGER * Role.ROUTER.size_m[0] / math.sqrt(2)
LABEL_M = 0.5
LINK_WIDTH_M = {LinkUse.ROUTE: 0.08, LinkUse.KNOWN: 0.03, LinkUse.LOST: 0.05}
LINK_OPACITY = {LinkUse.ROUTE: 1.0, LinkUse.KNOWN: 0.6, LinkUse.LOST: 1.0}
PATH_WIDTH_M = 0.06
OBSTACLE_OPACITY = 0.85

_Positions = Dict[int, Tuple[float, float, float]]


class MarkerMaker:
    """Creates the markers that changed since the last call. Belongs to one thread."""

    def __init__(self) -> None:
        self._shown: dict[tuple[str, int], object] = {}
        self._made: list[Marker] = []  # in this call
        self._lost = LostLinks()
        self._forecast = LinkForecast()

    def forget_shown(self) -> None:
        """Create all markers at the next call, for a new subscriber."""
        self._shown.clear()

    def markers(self, state: MeshState, wall_s: float) -> MarkerArray:
        """The markers that changed since the last call."""
        nodes = [node for node in state.nodes if position_is_known(node)]
        positions = fanned_positions(nodes, BOX_RADIUS_M)
        known = known_links(nodes)
        lost = self._lost.update(known, wall_s)
        soon = self._forecast.update(known, nodes, state.header.stamp.to_sec(), state.max_distance)
        self._made = []
        self._add_obstacles(state.obstacles)
        if shape_named(state.shape) is Shape.BOX:
            for role in Role:
                of_role = [node for node in nodes if node.role == role]
                self._add_boxes(of_role, role, positions)
        else:
            self._add_drones(nodes, positions)
            self._add_rotors(nodes, positions, state.header.stamp.to_sec())
        for use, links in links_by_use(nodes, lost).items():
            lines = [(positions[a], positions[b]) for a, b in shortest(links, nodes, MOST_LINKS)]
            colour = _colour(DARK.of_link(use), LINK_OPACITY[use])
            self._add_lines(f"links: {use.name.lower()}", lines, colour, LINK_WIDTH_M[use])
        breaking = [(positions[a], positions[b]) for a, b in shortest(set(soon), nodes, MOST_LINKS)]
        self._add_lines("links: soon", breaking, _colour(DARK.flying), LINK_WIDTH_M[LinkUse.ROUTE])
        flown, ahead = _path_lines(nodes, positions), _heading_lines(nodes, positions)
        self._add_lines("flight paths", flown, _colour(DARK.path), PATH_WIDTH_M)
        self._add_lines("headings", ahead, _colour(DARK.muted), PATH_WIDTH_M)
        self._add_ids(nodes, positions)
        self._add_legend(positions)
        for marker in self._made:
            marker.header.stamp, marker.header.frame_id = state.header.stamp, names.MAP_FRAME
        return MarkerArray(self._made)

    def _add_boxes(self, nodes: Sequence[NodeStatus], role: Role, positions: _Positions) -> None:
        x_m, y_m, z_m = (TIMES_LARGER * edge_m for edge_m in role.size_m)
        colours = [DARK.of_node(role, condition_of(node)) for node in nodes]
        content = [(positions[node.id], colour) for node, colour in zip(nodes, colours)]
        marker = self._changed(f"{role.word}s", 0, content)
        if marker:
            marker.type = Marker.CUBE_LIST
            marker.scale.x, marker.scale.y, marker.scale.z = x_m, y_m, z_m
            marker.points = [_point(positions[node.id], up=z_m / 2) for node in nodes]
            marker.colors = [_colour(colour) for colour in colours]

    def _add_drones(self, nodes: Sequence[NodeStatus], positions: _Positions) -> None:
        """Add two markers per drone, frame and lamp, because a mesh in rviz has one colour."""
        for node in nodes:
            colour = DARK.of_node(node.role, condition_of(node))
            flying = _is_in_flight(node)
            frame, lamp = MESHES + frame_file(flying), MESHES + lamp_file(Role(node.role))
            looks = (("frames", frame, FRAME_COLOUR), ("lamps", lamp, colour))
            for name, mesh, tint in looks:
                content = [positions[node.id], mesh, tint]
                marker = self._changed(name, node.id, content)
                if marker:
                    marker.type = Marker.MESH_RESOURCE
                    marker.mesh_resource = mesh
                    marker.scale.x = marker.scale.y = marker.scale.z = TIMES_LARGER
                    marker.color = _colour(tint)
                    marker.pose.position = _point(positions[node.id], up=0.0)
        self._delete_gone(("frames", "lamps"), nodes)

    def _add_rotors(
        self, nodes: Sequence[NodeStatus], positions: _Positions, time_s: float
    ) -> None:
        """The blades of all drones in flight, as one marker; they turn in simulated time."""
        flying = [positions[node.id] for node in nodes if _is_in_flight(node)]
        marker = self._changed("rotors", 0, [time_s, *flying] if flying else [])
        if marker:
            marker.type = Marker.LINE_LIST
            marker.scale.x = TIMES_LARGER * BLADE_WIDTH_M
            marker.color = _colour(FRAME_COLOUR)
            blades = [
                (TIMES_LARGER * x, TIMES_LARGER * y)
                for number, motor in enumerate(MOTORS)
                for x, y in blade_ends(motor, turned_rad(time_s, number))
            ]
            up = TIMES_LARGER * ROTOR_HIGH_M
            marker.points = [
                Point(x + dx, y + dy, z + up) for x, y, z in flying for dx, dy in blades
            ]

    def _add_obstacles(self, boxes: Sequence[ObstacleStatus]) -> None:
        for number, box in enumerate(boxes):
            marker = self._changed("obstacles", number, [tuple(box.center)])
            if marker:
                marker.type = Marker.CUBE
                marker.scale.x, marker.scale.y, marker.scale.z = box.size
                marker.color = _colour(DARK.obstacle, OBSTACLE_OPACITY)
                marker.pose.position = _point(box.center, up=0.0)
                marker.pose.orientation.z = math.sin(box.yaw / 2)
                marker.pose.orientation.w = math.cos(box.yaw / 2)

    def _add_lines(
        self, name: str, lines: Sequence[tuple[Sequence[float], ...]],
        colour: ColorRGBA, width_m: float,
    ) -> None:  # fmt: skip
        marker = self._changed(name, 0, lines)
        if marker:
            marker.type = Marker.LINE_LIST
            marker.scale.x = width_m
            marker.color = colour
            marker.points = [_point(end, up=0.05) for line in lines for end in line]

    def _add_ids(self, nodes: Sequence[NodeStatus], positions: _Positions) -> None:
        for node in nodes:
            marker = self._changed("ids", node.id, [positions[node.id]])
            if marker:
                marker.type = Marker.TEXT_VIEW_FACING
                marker.scale.z = LABEL_M
                marker.color = _colour(DARK.ink)
                marker.text = str(node.id)
                height_m = TIMES_LARGER * Role(node.role).size_m[2]
                marker.pose.position = _point(positions[node.id], up=height_m + 1.2 * LABEL_M)
        self._delete_gone(("ids",), nodes)

    def _add_legend(self, positions: _Positions) -> None:
        rows = legend_rows(positions.values()) if positions else []
        for number, row in enumerate(rows):
            swatch = self._changed("legend colours", number, [row])
            if swatch:
                swatch.type = Marker.CUBE
                swatch.scale.x, swatch.scale.y = row.height_m, row.height_m * row.thickness
                swatch.scale.z = 0.02
                swatch.color = _colour(row.colour)
                swatch.pose.position = _point(row.place, up=0.0)
            text = self._changed("legend", number, [row])
            if text:
                text.type = Marker.TEXT_VIEW_FACING
                text.scale.z = row.height_m
                text.color = _colour(DARK.ink)
                text.text = row.text
                text.pose.position = _point(row.text_place, up=0.0)

    def _delete_gone(self, names: Sequence[str], nodes: Sequence[NodeStatus]) -> None:
        present = {node.id for node in nodes}
        for name, number in list(self._shown):
            if name in names and number not in present:
                self._changed(name, number, [])

    def _changed(self, name: str, number: int, content: Sequence[object]) -> Marker | None:
        """A marker to fill in, or None: unchanged, or deleted because `content` is empty."""
        key = (name, number)
        if self._shown.get(key, []) == content:
            return None
        self._shown[key] = content
        marker = Marker(ns=name, id=number)
        marker.pose.orientation.w = 1.0
        self._made.append(marker)
        if not content:
            del self._shown[key]
            marker.action = Marker.DELETE
            return None
        return marker


def _is_in_flight(node: NodeStatus) -> bool:
    """Whether a drone is on an ordered or decided flight, or flown by its pilot."""
    return len(node.path) > 0 or len(node.heading) > 0


def _path_lines(
    nodes: Sequence[NodeStatus], positions: _Positions
) -> list[tuple[Sequence[float], ...]]:
    lines: list[tuple[Sequence[float], ...]] = []
    for node in nodes:
        way = [positions[node.id], *waypoints(node.path)]
        lines += zip(way, way[1:])
    return lines


def _heading_lines(
    nodes: Sequence[NodeStatus], positions: _Positions
) -> list[tuple[Sequence[float], ...]]:
    return [(positions[node.id], tuple(node.heading)) for node in nodes if len(node.heading)]


def _colour(colour: Colour, opacity: float = 1.0) -> ColorRGBA:
    return ColorRGBA(*rgb(colour), opacity)


def _point(position: Sequence[float], up: float) -> Point:
    return Point(position[0], position[1], position[2] + up)
