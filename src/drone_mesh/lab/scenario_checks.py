"""Refuses scenarios in which something would never happen, or that would end each run."""

from __future__ import annotations

import math

from drone_mesh.drone.fleet import ids_in_words
from drone_mesh.drone.goal import check_apart
from drone_mesh.errors import GoalRefused
from drone_mesh.formations.layouts import Layouts, UnknownCase
from drone_mesh.lab import places
from drone_mesh.lab.experiment_source import Source
from drone_mesh.lab.faults import Fault
from drone_mesh.lab.scenario import Layout, Scenario
from drone_mesh.yaml_file import KeyPath


def check_scenario(scenario: Scenario, source: Source) -> None:
    """Raise ConfigurationError that points into the file."""
    _check_cases(scenario, source)
    _check_rings(scenario, source)
    _check_ids(scenario, source)
    _check_begins(scenario, source)


def _check_cases(scenario: Scenario, source: Source) -> None:
    cases: list[tuple[KeyPath, int]] = []
    if scenario.layout.kind == "casus":
        cases.append((("layout", "case"), scenario.layout.case))
    for index, fault in enumerate(scenario.faults):
        if fault.layouts is not None:
            listed: KeyPath = ("faults", index, "layouts", "cases")
            cases += [(listed, case) for case in fault.layouts.cases]
    shipped = Layouts.shipped()
    for place, case in cases:
        try:
            orders = dict(shipped.orders(case))
            if place[0] == "faults":
                check_apart(orders, scenario.repair_options.clearance_m)
        except (GoalRefused, UnknownCase) as error:
            raise source.error(("base", *place), f"{_dotted(place)}: {error}") from None


def _check_rings(scenario: Scenario, source: Source) -> None:
    ids, gateways = _ids_of(scenario.layout)
    corners = len(ids) - max(1, len(gateways)) + 1  # the routers, and the first gateway
    for index, fault in enumerate(scenario.faults):
        radius_m = None if fault.layouts is None else fault.layouts.ring_m
        if radius_m is None:
            continue
        apart_m = 2 * radius_m * math.sin(math.pi / corners)
        if apart_m < scenario.repair_options.clearance_m:
            place: KeyPath = ("faults", index, "layouts", "ring_m")
            raise source.error(
                ("base", *place),
                f"{_dotted(place)}: {corners} drones would stand {apart_m:.2f} m apart: "
                f"the clearance is {scenario.repair_options.clearance_m:g} m",
            )


def _check_ids(scenario: Scenario, source: Source) -> None:
    ids, gateways = _ids_of(scenario.layout)
    layout_has = f"the layout has {ids_in_words(ids)}"
    for node in sorted({int(node) for node, *_knot in scenario.mobility.knots or ()} - ids):
        raise source.error(
            ("base", "mobility", "path"),
            f"mobility.path: the trace names drone {node}; {layout_has}",
        )
    for index, fault in enumerate(scenario.faults):
        place = ("faults", index, fault.action)
        for node in sorted(_ids_named_by(fault) - ids):
            raise source.error(("base", *place), f"{_dotted(place)}: no drone {node}; {layout_has}")
        if fault.gateway_off is not None and fault.gateway_off.id not in (gateways or ids):
            raise source.error(
                ("base", *place),
                f"{_dotted(place)}: drone {fault.gateway_off.id} is no gateway; use kill",
            )


def _ids_of(layout: Layout) -> tuple[set[int], set[int]]:
    """The drones of a layout, and those that are gateways; none: the seed decides."""
    if layout.kind == "casus":
        points = places.casus(layout)
    elif layout.kind == "file":
        points = places.of_file(layout)
    else:
        gateways = range(layout.gateways) if layout.ids == "in_order" else ()
        return set(range(layout.drones)), set(gateways)
    return {p.node_id for p in points}, {p.node_id for p in points if p.gateway}


def _ids_named_by(fault: Fault) -> set[int]:
    one: int | None = getattr(fault.what, "id", None)
    several = (getattr(fault.what, key, None) or () for key in ("ids", "between"))
    return {node for some in several for node in some} | (set() if one is None else {one})


def _dotted(place: KeyPath) -> str:
    return ".".join(map(str, place))


def _check_begins(scenario: Scenario, source: Source) -> None:
    """Refuse what begins after the end of the run: nothing would show that it never happened."""
    if scenario.sequence is not None:  # it has faults and an end of its own
        return
    begins: list[tuple[KeyPath, float | None]] = [
        (("faults", index, fault.action), fault.at_s) for index, fault in enumerate(scenario.faults)
    ]
    if scenario.probes.per_s:
        begins.append((("probes", "from_s"), scenario.probes.from_s + scenario.probes.within_s))
    if scenario.mobility.knots:
        begins.append((("mobility", "path"), min(t for _id, t, *_place in scenario.mobility.knots)))
    for place, begin_s in begins:
        if begin_s is not None and begin_s >= scenario.duration_s:
            raise source.error(
                ("base", *place),
                f"{_dotted(place)}: begins at {begin_s:g} s, after the end of the run "
                f"(duration_s {scenario.duration_s:g})",
            )
