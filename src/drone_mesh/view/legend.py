"""The legend of a picture: one row for each colour in it."""

from __future__ import annotations

from typing import NamedTuple

from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import Condition
from drone_mesh.state.links import LinkUse
from drone_mesh.view.palette import LIGHT, Colour
from drone_mesh.view.picture import Scene

NODE_HEIGHT, LINK_HEIGHT, PATH_HEIGHT = 12.0, 3.0, 2.0  # pixels, of the swatch


class LegendRow(NamedTuple):
    """One colour and its meaning."""

    text: str
    colour: Colour
    height: float  # of the swatch, pixels


def legend_of(scene: Scene) -> list[LegendRow]:
    """Connected gateways and routers, other conditions, obstacles, flight paths and links."""
    rows: list[LegendRow] = []
    for role in (Role.GATEWAY, Role.ROUTER):
        connected = sum(
            drone.role is role and drone.condition is Condition.CONNECTED for drone in scene.drones
        )
        if connected:
            colour = LIGHT.of_node(role, Condition.CONNECTED)
            rows.append(LegendRow(f"{role.word} ({connected})", colour, NODE_HEIGHT))
    for condition in Condition:
        count = sum(drone.condition is condition for drone in scene.drones)
        if count and condition is not Condition.CONNECTED:
            colour = LIGHT.of_node(Role.ROUTER, condition)
            rows.append(LegendRow(f"{condition.value} ({count})", colour, NODE_HEIGHT))
    if scene.obstacles:
        text = f"obstacle ({len(scene.obstacles)})"
        rows.append(LegendRow(text, LIGHT.obstacle, NODE_HEIGHT))
    if any(drone.path for drone in scene.drones):
        rows.append(LegendRow("flight path", LIGHT.path, PATH_HEIGHT))
    for use in LinkUse:
        if any(link.use is use for link in scene.links):
            rows.append(LegendRow(use.value, LIGHT.of_link(use), LINK_HEIGHT))
    return rows
