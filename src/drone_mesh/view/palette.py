"""The colours of every view: page, report, pictures, window, rviz and terminal."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Mapping

from drone_mesh.communication.wire.packet_types import PacketKind
from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import Condition, Severity
from drone_mesh.state.links import LinkUse

Colour = str  # "#rrggbb"


@dataclass(frozen=True)
class Palette:
    """One colour for each meaning. Text colours reach a contrast of 4.5 on `card` and `hover`."""

    # of nodes and links
    gateway: Colour
    connected: Colour
    flying: Colour
    disconnected: Colour
    off: Colour
    silent: Colour
    crashed: Colour
    known: Colour
    obstacle: Colour
    # of what surrounds them
    page: Colour
    card: Colour
    hover: Colour
    line: Colour
    grid: Colour
    ink: Colour
    muted: Colour
    accent: Colour
    accent_ink: Colour

    def of_node(self, role: int, condition: Condition) -> Colour:
        return self.colour(node_colour_name(role, condition))

    def of_link(self, use: LinkUse) -> Colour:
        return self.colour(_LINK_COLOUR_NAMES[use])

    def of_packet(self, kind: PacketKind) -> Colour:
        return self.colour(_PACKET_COLOUR_NAMES[kind])

    @property
    def path(self) -> Colour:
        return self.flying

    def colour(self, name: str) -> Colour:
        """The colour with this field's name."""
        colour: Colour = getattr(self, name)
        return colour


LIGHT = Palette(
    gateway="#6d3fd1", connected="#08794f", flying="#a85400", disconnected="#c8231a",
    off="#646b76", silent="#7d6512", crashed="#a8177f", known="#b4bfce", obstacle="#c9beab",
    page="#f3f5f8", card="#ffffff", hover="#eef2f9", line="#dde2e9", grid="#e7ebf1",
    ink="#18212d", muted="#5d6878", accent="#2458d3", accent_ink="#ffffff",
)  # fmt: skip
DARK = Palette(
    gateway="#b193ff", connected="#3ecf95", flying="#ffb14a", disconnected="#ff7b72",
    off="#939aa5", silent="#d9bf6b", crashed="#ff7fd0", known="#3c4859", obstacle="#8a7f6d",
    page="#0d1116", card="#161b22", hover="#1e2630", line="#2a323d", grid="#1d242e",
    ink="#e4e9f0", muted="#97a2b2", accent="#6b9bff", accent_ink="#0d1116",
)  # fmt: skip

# For pictures of the world, which always show daylight.
GROUND: Colour = "#f4f5f1"
GRID: Colour = "#d6dbd6"
AXIS: Colour = "#a8b2ad"
SHADOW: Colour = "#ccd1cc"
FRAME: Colour = "#3a424d"  # of a drone

_LINK_COLOUR_NAMES: Mapping[LinkUse, str] = {
    LinkUse.ROUTE: "connected",
    LinkUse.KNOWN: "known",
    LinkUse.LOST: "disconnected",
}
# For dots, whose edge has the colour of the card, because they also move along lines of their
# colour.
_PACKET_COLOUR_NAMES: Mapping[PacketKind, str] = {
    PacketKind.HEARTBEAT: "accent",
    PacketKind.INTRODUCTION: "connected",
    PacketKind.POSITION: "silent",
    PacketKind.REPAIR: "disconnected",
    PacketKind.ORDER: "flying",
    PacketKind.REPORT: "gateway",
    PacketKind.DATA: "crashed",
    PacketKind.OTHER: "off",
}
_ANSI_OF_SEVERITY: Mapping[Severity, int] = {
    Severity.OK: 32,  # green
    Severity.WARN: 33,  # yellow
    Severity.ERROR: 31,  # red
    Severity.STALE: 35,  # magenta
}
_ANSI_OF_CONDITION: Mapping[Condition, int] = {
    Condition.CRASHED: 95,
    Condition.FLYING: 33,
    Condition.DISCONNECTED: 31,
    Condition.OFF: 90,  # grey
    Condition.SILENT: 35,
}


def node_colour_name(role: int, condition: Condition) -> str:
    """The palette's name for a node's colour: its condition; `gateway` for a connected gateway."""
    if role == Role.GATEWAY and condition is Condition.CONNECTED:
        return "gateway"
    return condition.value


def rgb(colour: Colour) -> tuple[float, float, float]:
    """Red, green and blue, 0..1."""
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return (red, green, blue)


def css_variables(palette: Palette) -> str:
    """The body of a CSS rule that sets `color-scheme` and a variable for each colour."""
    colours = {_variable(field.name): palette.colour(field.name) for field in fields(palette)}
    colours.update(
        {f"{use.name.lower()}-link": palette.of_link(use) for use in LinkUse}, path=palette.path
    )
    colours.update({f"packet-{kind.value}": palette.of_packet(kind) for kind in PacketKind})
    variables = " ".join(f"--{name}: {colour};" for name, colour in colours.items())
    return f"color-scheme: {'dark' if palette is DARK else 'light'}; {variables}"


def variable_names(palette: Palette) -> dict[Colour, str]:
    """The CSS variable, without its dashes, that has each colour of a palette."""
    # If two names share a colour the first is used; the second is for text on another colour.
    return {palette.colour(f.name): _variable(f.name) for f in reversed(fields(palette))}


def _variable(name: str) -> str:
    return name.replace("_", "-")


def ansi(text: str, what: Severity | Condition) -> str:
    """`text` in a colour for terminals; uncoloured for a connected node."""
    code = _ANSI_OF_SEVERITY[what] if isinstance(what, Severity) else _ANSI_OF_CONDITION.get(what)
    return text if code is None else f"\x1b[{code}m{text}\x1b[0m"
