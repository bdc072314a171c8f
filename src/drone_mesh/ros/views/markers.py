"""MarkerMaker: turns states of the mesh into rviz markers."""

from __future__ import annotations

import math
from typing import Any, Collection, Dict, Sequence, Tuple

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
from drone_mesh.state.model import (
    AreaStatus,
    NodeStatus,
    ObstacleStatus,
    position_is_known,
    rings_of,
    waypoints,
)
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
FENCE_WIDTH_M = 0.1
MOST_POSTS = 16  # of a ring: the 64 corners of a circle would hide what is behind them
OBSTACLE_OPACITY = 0.85

_Place = Sequence[float]
_Positions = Dict[int, Tuple[float, float, float]]
_Line = Tuple[_Place, ...]


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
        self._add_fence(state.fence)
        if shape_named(state.shape) is Shape.BOX:
            for role in Role:
                of_role = [node for node in nodes if node.role == role]
                self._add_boxes(of_role, role, positions)
        else:
            self._add_drones(nodes, positions)
            self._add_rotors(nodes, positions, state.header.stamp.to_sec())
        for use, links in links_by_use(nodes, lost).items():
            lines = [(positions[a], positions[b]) for a, b in shortest(links, nodes, MOST_LINKS)]
            looks = DARK.of_link(use), LINK_WIDTH_M[use], LINK_OPACITY[use]
            self._add_lines(f"links: {use.name.lower()}", lines, *looks)
        breaking = [(positions[a], positions[b]) for a, b in shortest(set(soon), nodes, MOST_LINKS)]
        self._add_lines("links: soon", breaking, DARK.flying, LINK_WIDTH_M[LinkUse.ROUTE])
        self._add_lines("flight paths", _path_lines(nodes, positions), DARK.path, PATH_WIDTH_M)
        self._add_lines("headings", _heading_lines(nodes, positions), DARK.muted, PATH_WIDTH_M)
        self._add_ids(nodes, positions)
        self._add_legend(positions)
        for marker in self._made:
            marker.header.stamp, marker.header.frame_id = state.header.stamp, names.MAP_FRAME
        return MarkerArray(self._made)

    def _add_boxes(self, nodes: Sequence[NodeStatus], role: Role, positions: _Positions) -> None:
        scale = [TIMES_LARGER * edge_m for edge_m in role.size_m]
        content = [(positions[n.id], DARK.of_node(role, condition_of(n))) for n in nodes]
        marker = self._changed(f"{role.word}s", 0, content, Marker.CUBE_LIST, scale)
        if marker:
            marker.points = [_point(place, up=scale[2] / 2) for place, _colour in content]
            marker.colors = [_colour(colour) for _place, colour in content]

    def _add_drones(self, nodes: Sequence[NodeStatus], positions: _Positions) -> None:
        """Add two markers per drone, frame and lamp, because a mesh in rviz has one colour."""
        for node in nodes:
            colour = DARK.of_node(node.role, condition_of(node))
            frame = MESHES + frame_file(_is_in_flight(node))
            lamp = MESHES + lamp_file(Role(node.role))
            for name, mesh, tint in (("frames", frame, FRAME_COLOUR), ("lamps", lamp, colour)):
                content = [positions[node.id], mesh, tint]
                scale = [TIMES_LARGER] * 3
                marker = self._changed(name, node.id, content, Marker.MESH_RESOURCE, scale, tint)
                if marker:
                    marker.mesh_resource = mesh
                    marker.pose.position = _point(positions[node.id])
        self._delete_gone(("frames", "lamps"), [node.id for node in nodes])

    def _add_rotors(
        self, nodes: Sequence[NodeStatus], positions: _Positions, time_s: float
    ) -> None:
        """The blades of all drones in flight, as one marker; they turn in simulated time."""
        flying = [positions[node.id] for node in nodes if _is_in_flight(node)]
        content = [time_s, *flying] if flying else []
        scale = [TIMES_LARGER * BLADE_WIDTH_M]
        marker = self._changed("rotors", 0, content, Marker.LINE_LIST, scale, FRAME_COLOUR)
        if marker:
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
            content = [tuple(box.center)]
            marker = self._changed(
                "obstacles", number, content, Marker.CUBE, box.size, DARK.obstacle, OBSTACLE_OPACITY
            )
            if marker:
                marker.pose.position = _point(box.center)
                marker.pose.orientation.z = math.sin(box.yaw / 2)
                marker.pose.orientation.w = math.cos(box.yaw / 2)

    def _add_fence(self, areas: Sequence[AreaStatus]) -> None:
        for side, inside, colour in (("in", True, DARK.accent), ("out", False, DARK.disconnected)):
            lines = [line for area in areas if area.inside is inside for line in _area_lines(area)]
            self._add_lines(f"fence: stay {side}", lines, colour, FENCE_WIDTH_M)
        for number, area in enumerate(areas):
            place = (*area.corners[:2], max(_heights_m(area)))
            content = [place, area.name]
            self._add_text("fence names", number, content, area.name, LABEL_M, LABEL_M)
        self._delete_gone(("fence names",), range(len(areas)))

    def _add_lines(
        self, name: str, lines: Sequence[_Line], colour: Colour, width_m: float, opacity: float = 1
    ) -> None:
        marker = self._changed(name, 0, lines, Marker.LINE_LIST, [width_m], colour, opacity)
        if marker:
            marker.points = [_point(end, up=0.05) for line in lines for end in line]

    def _add_ids(self, nodes: Sequence[NodeStatus], positions: _Positions) -> None:
        for node in nodes:
            up = TIMES_LARGER * Role(node.role).size_m[2] + 1.2 * LABEL_M
            self._add_text("ids", node.id, [positions[node.id]], str(node.id), LABEL_M, up)
        self._delete_gone(("ids",), [node.id for node in nodes])

    def _add_text(
        self,
        name: str,
        number: int,
        content: Sequence[Any],
        text: str,
        height_m: float,
        up: float = 0.0,
    ) -> None:
        """`content`: first the place of the text."""
        scale = (0.0, 0.0, height_m)
        marker = self._changed(name, number, content, Marker.TEXT_VIEW_FACING, scale, DARK.ink)
        if marker:
            marker.text = text
            marker.pose.position = _point(content[0], up)

    def _add_legend(self, positions: _Positions) -> None:
        for number, row in enumerate(legend_rows(positions.values()) if positions else []):
            scale = (row.height_m, row.height_m * row.thickness, 0.02)
            swatch = self._changed("legend colours", number, [row], Marker.CUBE, scale, row.colour)
            if swatch:
                swatch.pose.position = _point(row.place)
            self._add_text("legend", number, [row.text_place], row.text, row.height_m)

    def _delete_gone(self, names: Sequence[str], present: Collection[int]) -> None:
        for name, number in list(self._shown):
            if name in names and number not in present:
                self._changed(name, number, [])

    def _changed(
        self,
        name: str,
        number: int,
        content: Sequence[object],
        kind: int = 0,
        scale: Sequence[float] = (),
        colour: Colour | None = None,
        opacity: float = 1.0,
    ) -> Marker | None:
        """A marker to fill in, or None: unchanged, or deleted because `content` is empty."""
        key = (name, number)
        if self._shown.get(key, []) == content:
            return None
        self._shown[key] = content
        marker = Marker(ns=name, id=number, type=kind)
        marker.pose.orientation.w = 1.0
        self._made.append(marker)
        if not content:
            del self._shown[key]
            marker.action = Marker.DELETE
            return None
        for axis, size in zip("xyz", scale):
            setattr(marker.scale, axis, size)
        if colour is not None:
            marker.color = _colour(colour, opacity)
        return marker


def _is_in_flight(node: NodeStatus) -> bool:
    """Whether a drone is on an ordered or decided flight, or flown by its pilot."""
    return len(node.path) > 0 or len(node.heading) > 0


def _heights_m(area: AreaStatus) -> list[float]:
    """At which its outline is drawn: at its ends; on the ground if it has no lower one."""
    low_m = area.lowest if math.isfinite(area.lowest) else min(0.0, area.highest)
    return [low_m, *([area.highest] if math.isfinite(area.highest) else [])]


def _area_lines(area: AreaStatus) -> list[_Line]:
    heights_m = _heights_m(area)
    lines: list[_Line] = []
    for ring in rings_of(area):
        for start, end in zip(ring, (*ring[1:], ring[0])):
            lines += [((*start, z), (*end, z)) for z in heights_m]
        posts = ring[:: (len(ring) - 1) // MOST_POSTS + 1]
        lines += [((*corner, heights_m[0]), (*corner, heights_m[-1])) for corner in posts]
    return lines


def _path_lines(nodes: Sequence[NodeStatus], positions: _Positions) -> list[_Line]:
    ways = [[positions[node.id], *waypoints(node.path)] for node in nodes]
    return [line for way in ways for line in zip(way, way[1:])]


def _heading_lines(nodes: Sequence[NodeStatus], positions: _Positions) -> list[_Line]:
    return [(positions[node.id], tuple(node.heading)) for node in nodes if len(node.heading)]


def _colour(colour: Colour, opacity: float = 1.0) -> ColorRGBA:
    return ColorRGBA(*rgb(colour), opacity)


def _point(position: Sequence[float], up: float = 0.0) -> Point:
    return Point(position[0], position[1], position[2] + up)
