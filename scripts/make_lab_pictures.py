"""Draws what each repair strategy and each routing technique does, and a report of the lab.

They become pictures in docs/pictures.
"""

from __future__ import annotations

import math
import shutil
import tempfile
from pathlib import Path
from typing import Callable

from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.inprocess import Network
from drone_mesh.lab.command import main as lab
from drone_mesh.lab.network_sample import physical_graph
from drone_mesh.lab.run_report.drawing import in_style, svg_of_its_own
from drone_mesh.lab.worker import quiet_nodes
from drone_mesh.view.palette import LIGHT

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
CHROMIUM_FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
PAGE = {"width": 900, "height": 1250}  # px: the first screens of a report
REPORTED = (
    "title=Healing of fifty drones", "seeds=8", "base.layout.drones=50",
    "sweep.repair=[thesis,nearest,home]", "sweep.faults.kill=[{share: 0.3}]",
)  # fmt: skip
STRATEGIES = (
    "thesis", "nearest", "named_backup", "c3r", "follow", "inward", "field", "virtual_spring",
    "fiedler", "home", "oracle",
)  # fmt: skip
TECHNIQUES = (
    "child_table_tree", "steady_tree", "etx_tree", "babel", "batman", "dsdv", "flooding",
    "shortest_path",
)  # fmt: skip
COLUMNS = 4
# The gateway 0, the router 1 that dies, and a group that only 1 connects to the gateway.
PLACES = ((0, 0), (8, 0), (14, 5), (16, -2), (22, 4), (22, -6), (29, 0))
DEAD = 1
WATCHED_S = 200.0
GRID, SPACING_M, LOSS = 5, 6.0, 0.2
SETTLED_S = 120.0


def main() -> None:
    """Write both pictures."""
    with quiet_nodes(), in_style():
        for name, names, draw, height_in in (
            ("strategies", STRATEGIES, draw_repair, 1.7),
            ("techniques", TECHNIQUES, draw_routes, 2.6),
        ):
            out = PICTURES / f"{name}.svg"
            out.write_text(svg_of_its_own(panels(names, draw, height_in)), encoding="utf-8")
            print(f"wrote {out}")
    picture_of_report(PICTURES / "lab.png")


def picture_of_report(out: Path) -> None:
    """Run a small experiment, and photograph its report."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        results = str(Path(folder) / "heal")
        experiment = str(ROOT / "experiments" / "heal.yaml")
        lab(
            [
                "run",
                experiment,
                *REPORTED,
                "base.layout.drones=50",
                "--workers",
                "0",
                "--out",
                results,
            ]
        )
        lab(["report", results, "--out", f"{folder}/report.html"])
        chromium = shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=chromium, args=CHROMIUM_FLAGS)
        page = browser.new_page(viewport=PAGE)
        page.goto(f"file://{folder}/report.html")
        page.screenshot(path=out)
        browser.close()
    print(f"wrote {out}")


def panels(names: tuple[str, ...], draw: Callable[[Axes, str], str], height_in: float) -> Figure:
    """One panel for each name, with the sentence that `draw` returns below it."""
    rows = -(-len(names) // COLUMNS)
    figure = Figure(figsize=(10.0, height_in * rows), layout="constrained")
    panel = figure.subplots(rows, COLUMNS).ravel()
    for axes in panel[len(names) :]:
        axes.set_axis_off()
    for axes, name in zip(panel, names):
        words = draw(axes, name)
        axes.set_title(name, fontsize=10)
        axes.set_xlabel(words, fontsize=8)
        axes.set_aspect("equal")
        axes.margins(0.08, 0.2)  # no circle is cut off
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set_visible(False)
    return figure


def draw_repair(axes: Axes, repair: str) -> str:
    """Where the drones fly after the death of a relay."""
    network = Network(seed=1, repair=repair)
    network.add_gateway(0, *PLACES[0])
    for node, place in enumerate(PLACES[1:], start=1):
        network.add_router(node, *place)
    legs: list[tuple[int, FlightPath]] = []
    for node, member in network.nodes.items():
        member.drone.observe(lambda _before, path, node=node: legs.append((node, path)))
    network.run_until(network.all_connected, within_s=60.0)
    network.run_for(20.0)
    network.power(DEAD, False)
    died_s = network.now_s()
    network.run_for(10.0)
    network.run_until(network.all_connected, within_s=WATCHED_S)
    took_s = network.now_s() - died_s
    network.run_for(20.0)
    draw_links(axes, network)
    flown_m = 0.0
    for place, (node, path) in enumerate(legs):
        later = [after.start for other, after in legs[place + 1 :] if other == node]
        end = [*later, network.location(node).to_vector()][0]
        flown_m += math.dist(path.start[:2], end[:2])
        axes.plot(*path.start[:2], "o", ms=9, mfc="none", mec=LIGHT.muted, ls="none")
        arrow = {"arrowstyle": "->", "color": LIGHT.flying, "lw": 1.6}
        axes.annotate("", end[:2], path.start[:2], arrowprops=arrow)
    axes.plot(*PLACES[DEAD], "x", ms=9, mew=2, color=LIGHT.disconnected)
    draw_nodes(axes, network)
    flew = len({node for node, _path in legs})
    lost = "" if network.all_connected() else ", then lost again"
    return f"{flew} of 5 fly, {flown_m:.0f} m in all;\nhealed after {took_s:.0f} s{lost}"


def draw_routes(axes: Axes, routing: str) -> str:
    """The next hop of each router towards the gateway, on links that lose packets."""
    network = Network(seed=3, routing=routing, loss=LOSS)
    network.add_fleet(1, GRID * GRID, GRID, SPACING_M)
    network.run_for(SETTLED_S)
    draw_links(axes, network)
    for node in network.nodes:
        component = network.nodes[node].component
        step = component.get_route_to_gateway() if network.connected(node) else NO_ROUTE
        if node and step in network.nodes:
            here, there = network.location(node), network.location(step)
            axes.annotate(
                "", (there.longitude, there.latitude), (here.longitude, here.latitude),
                arrowprops={"arrowstyle": "->", "color": LIGHT.connected, "lw": 1.4},
            )  # fmt: skip
    draw_nodes(axes, network)
    connected = sum(map(network.connected, network.nodes)) - 1
    rate = network.air.delivered / SETTLED_S / len(network.nodes)
    return f"{connected} of {GRID * GRID} connected, {rate:.1f} packets/s each"


def draw_links(axes: Axes, network: Network) -> None:
    """The pairs that hear each other."""
    places = {node: network.location(node).to_vector()[:2] for node in network.nodes}
    pairs = [
        (places[node], places[other])
        for node, others in physical_graph(network).near.items()
        for other in others
        if other > node
    ]
    axes.add_collection(LineCollection(pairs, colors=LIGHT.known, linewidths=0.8, zorder=0))


def draw_nodes(axes: Axes, network: Network) -> None:
    """The drones that have power, with their ids."""
    for node, member in network.nodes.items():
        if not member.antenna.powered:
            continue
        place = network.location(node)
        colour = LIGHT.gateway if member.is_gateway else LIGHT.connected
        colour = colour if network.connected(node) else LIGHT.disconnected
        axes.plot(place.longitude, place.latitude, "o", ms=9, color=colour, zorder=3)
        axes.text(
            place.longitude, place.latitude, str(node), ha="center", va="center", fontsize=6,
            color=LIGHT.card, zorder=4,
        )  # fmt: skip


if __name__ == "__main__":
    main()
