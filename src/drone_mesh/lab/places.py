"""Start positions of a run's drones, drawn from a layout."""

from __future__ import annotations

import csv
import math
import random
from pathlib import Path
from typing import Callable, List, NamedTuple, Tuple

from drone_mesh.air.graph import Graph, within
from drone_mesh.air.obstacles import Obstacles
from drone_mesh.arguments import finite, is_up_to
from drone_mesh.drone.fleet import MAX_DRONES, plan_fleet
from drone_mesh.drone.roles import Role
from drone_mesh.errors import ConfigurationError
from drone_mesh.formations.layouts import Layouts, UnknownCase
from drone_mesh.lab.scenario import Layout
from drone_mesh.yaml_file import read_text

MEAN_DEGREE = 8.0  # the published layouts have 7.3..8.8
MOST_DRAWS = 2000  # for a random layout that must be connected
BESIDE_M = 0.1  # between drones at the end of a line
PLACES_HEADER = ["id", "x", "y", "role"]


Draw = Callable[[Layout, float, Callable[[], float]], List[Tuple[float, float]]]


class StartPoint(NamedTuple):
    """The start position of one drone, in metres."""

    node_id: int
    x: float
    y: float
    gateway: bool


def draw_places(
    layout: Layout, range_m: float, rng: random.Random, obstacles: Obstacles | None = None
) -> list[StartPoint]:
    """All drones by id. Raises ConfigurationError for a layout that cannot be drawn.

    Random positions avoid the obstacles; "connected" includes the obstacles' effect on links.
    """
    if layout.kind == "file":
        return of_file(layout)
    if layout.kind == "casus":
        return casus(layout)
    if layout.kind == "line":
        places = _line(layout)
    elif layout.kind == "grid":
        places = _grid(layout)
    else:
        points = _connected_points(layout, range_m, rng, obstacles)
        places = _with_gateways(layout, points, rng)
    return _shuffled(places, rng) if layout.ids == "shuffled" else places


def rows_of_file(path: Path) -> list[list[float]]:
    """The drones of a CSV file with the header id,x,y,role by id: id, x, y, 1 for a gateway.

    A role is gateway or router. Raises ConfigurationError.
    """
    try:
        rows = list(csv.reader(read_text(path).splitlines(), skipinitialspace=True))
    except (ConfigurationError, csv.Error) as error:
        raise ConfigurationError(f"layout file {path}: {error}") from error
    if not rows or [name.strip() for name in rows[0]] != PLACES_HEADER:
        raise ConfigurationError(f"layout file {path}, line 1: expected {','.join(PLACES_HEADER)}")
    places: dict[int, list[float]] = {}
    for number, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        where = f"layout file {path}, line {number}"
        if len(row) != len(PLACES_HEADER):
            raise ConfigurationError(f"{where}: expected id,x,y,role")
        drone, *place, role = map(str.strip, row)
        node_id = int(drone) if is_up_to(drone, MAX_DRONES - 1) else -1
        if node_id < 0 or node_id in places:
            raise ConfigurationError(f"{where}: id {drone} is out of range or a duplicate")
        try:
            x, y = map(finite, place)
        except ValueError:
            role = ""
        if role not in ("gateway", "router"):
            raise ConfigurationError(f"{where}: expected finite x, y and role gateway or router")
        places[node_id] = [float(node_id), x, y, float(role == "gateway")]
    if not any(is_gateway for *_, is_gateway in places.values()):
        raise ConfigurationError(f"layout file {path}: no gateway")
    return [places[node_id] for node_id in sorted(places)]


def of_file(layout: Layout) -> list[StartPoint]:
    """The drones of a file."""
    return [StartPoint(int(i), x, y, bool(g)) for i, x, y, g in layout.places or ()]


def casus(layout: Layout) -> list[StartPoint]:
    """The drones of a DroneManager layout at their positions, and its gateway."""
    try:
        orders = Layouts.shipped().orders(layout.case)
    except UnknownCase as error:
        raise ConfigurationError(f"layout casus: {error}") from error
    fleet = plan_fleet(layout.gateways, 0, 1, 1.0)
    places = [StartPoint(g.node_id, g.longitude, g.latitude, True) for g in fleet]
    taken = {place.node_id for place in places}
    places += [
        StartPoint(order.node_id, order.goal.longitude, order.goal.latitude, False)
        for order in orders
        if order.node_id not in taken
    ]
    return sorted(places)


def _line(layout: Layout) -> list[StartPoint]:
    end = max(0, layout.drones - layout.at_end)
    return [
        StartPoint(
            i, min(i, end) * layout.spacing_m, max(0, i - end) * BESIDE_M, i < layout.gateways
        )
        for i in range(layout.drones)
    ]


def _grid(layout: Layout) -> list[StartPoint]:
    routers = layout.drones - layout.gateways
    columns = layout.columns or max(1, math.ceil(math.sqrt(routers)))
    fleet = plan_fleet(layout.gateways, routers, columns, layout.spacing_m)
    return [StartPoint(p.node_id, p.longitude, p.latitude, p.role is Role.GATEWAY) for p in fleet]


def _connected_points(
    layout: Layout, range_m: float, rng: random.Random, obstacles: Obstacles | None
) -> list[tuple[float, float]]:
    draw = _clusters if layout.kind == "clusters" else _uniform
    for _ in range(MOST_DRAWS):
        points = draw(layout, range_m, rng.random)
        if obstacles is not None or layout.least_distance_m:
            points = _moved_apart(points, obstacles, layout, range_m, draw, rng)
        if layout.require == "nothing" or _graph(points, range_m, obstacles).is_connected():
            return points
    raise ConfigurationError(
        f"layout {layout.kind}: none of {MOST_DRAWS} draws was connected; use a smaller area, a "
        "higher mean_degree or require: nothing"
    )


def _moved_apart(
    points: list[tuple[float, float]],
    obstacles: Obstacles | None,
    layout: Layout,
    range_m: float,
    draw: Draw,
    rng: random.Random,
) -> list[tuple[float, float]]:
    """Redraw positions in a box, or too close to an earlier one, until there are none."""
    for _ in range(MOST_DRAWS):
        misplaced = [
            i
            for i, (x, y) in enumerate(points)
            if (obstacles is not None and not obstacles.is_free((x, y, 0.0)))
            or any(math.dist((x, y), other) < layout.least_distance_m for other in points[:i])
        ]
        if not misplaced:
            return points
        fresh = draw(layout, range_m, rng.random)
        for index in misplaced:
            points[index] = fresh[index]
    raise ConfigurationError(f"layout {layout.kind}: there is no room for the drones")


def _graph(points: list[tuple[float, float]], range_m: float, obstacles: Obstacles | None) -> Graph:
    near = within(dict(enumerate(points)), range_m)
    if obstacles is not None:
        near = {
            i: [
                j
                for j in others
                if obstacles.margin_db((*points[i], 0.0), (*points[j], 0.0), range_m) > 0
            ]
            for i, others in near.items()
        }
    return Graph(near)


def width_for(drones: int, mean_degree: float, range_m: float) -> float:
    """Side of a square in which uniform drones have this many neighbours on average.

    A neighbour circle extends over the edge: the expected share of pairs within distance d in a
    unit square is pi d^2 - 8/3 d^3 + d^4/2 for d <= 1 (square line picking).
    """
    low, high = range_m, range_m * math.sqrt(math.pi * drones)
    wanted = min(1.0, mean_degree / (drones - 1))
    for _ in range(60):
        middle = (low + high) / 2
        d = range_m / middle
        share = math.pi * d**2 - 8 / 3 * d**3 + d**4 / 2
        low, high = (middle, high) if share > wanted else (low, middle)
    return (low + high) / 2


def side_of(layout: Layout, range_m: float) -> float:
    """Side of the square of a uniform layout, in metres."""
    return layout.width_m or width_for(layout.drones, layout.mean_degree or MEAN_DEGREE, range_m)


def _uniform(
    layout: Layout, range_m: float, draw: Callable[[], float]
) -> list[tuple[float, float]]:
    width_m = side_of(layout, range_m)
    return [(draw() * width_m, draw() * width_m) for _ in range(layout.drones)]


def _clusters(
    layout: Layout, range_m: float, draw: Callable[[], float]
) -> list[tuple[float, float]]:
    """Centres uniform in the square, drones uniform in a disc around each, in turn."""
    width_m = layout.width_m or 2 * layout.cluster_radius_m * math.sqrt(layout.clusters)
    centres = [(draw() * width_m, draw() * width_m) for _ in range(layout.clusters)]
    points = []
    for index in range(layout.drones):
        x, y = centres[index % len(centres)]
        radius = layout.cluster_radius_m * math.sqrt(draw())
        angle = 2 * math.pi * draw()
        points.append((x + radius * math.cos(angle), y + radius * math.sin(angle)))
    return points


def _with_gateways(
    layout: Layout, points: list[tuple[float, float]], rng: random.Random
) -> list[StartPoint]:
    """The drones nearest to the wanted positions become gateways and get the lowest ids."""
    if layout.gateway_at == "random":
        order = rng.sample(range(len(points)), len(points))
    else:
        xs, ys = [p[0] for p in points], [p[1] for p in points]
        at = (min(xs), min(ys))
        if layout.gateway_at == "middle":
            at = ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2)
        order = sorted(range(len(points)), key=lambda i: math.dist(points[i], at))
    chosen = order[: layout.gateways]
    rest = [index for index in range(len(points)) if index not in set(chosen)]
    return [
        StartPoint(node_id, *points[index], node_id < layout.gateways)
        for node_id, index in enumerate(chosen + rest)
    ]


def _shuffled(places: list[StartPoint], rng: random.Random) -> list[StartPoint]:
    ids = rng.sample(range(len(places)), len(places))
    return sorted(place._replace(node_id=ids[place.node_id]) for place in places)
