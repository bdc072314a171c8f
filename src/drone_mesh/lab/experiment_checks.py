"""The places in an experiment file, errors that point to them, and checks of a scenario."""

from __future__ import annotations

import difflib
import math
from pathlib import Path
from typing import Any, Iterator, Sequence

from pydantic import BaseModel, ValidationError
from typing_extensions import get_args

from drone_mesh.arguments import MOST, is_up_to
from drone_mesh.drone.fleet import ids_in_words
from drone_mesh.drone.goal import check_apart, check_goal
from drone_mesh.errors import ConfigurationError, GoalRefused
from drone_mesh.formations.layouts import Layouts, UnknownCase
from drone_mesh.lab import places
from drone_mesh.lab.scenario import Layout, Scenario
from drone_mesh.lab.scenario_parts import Fault
from drone_mesh.yaml_file import KeyPath, YamlFile


class Source:
    """Creates errors that point into the file, or at the argument that overrode it."""

    def __init__(self, file: YamlFile, folder: Path) -> None:
        self.folder = folder
        self.overrides: dict[KeyPath, str] = {}
        self._file = file

    def error(self, place: KeyPath, message: str) -> ConfigurationError:
        """The error to raise about the value at `place`."""
        for end in range(len(place), 0, -1):
            if place[:end] in self.overrides:
                return ConfigurationError(f"argument {self.overrides[place[:end]]}: {message}")
        return ConfigurationError(f"{self._file.where(*place)}: {message}")

    def error_of(
        self, error: ValidationError, before: KeyPath, model: Any, shown: KeyPath = ()
    ) -> ConfigurationError:
        """The first problem that pydantic found, as one line. `shown`: where to point instead."""
        first = error.errors()[0]
        inside: KeyPath = tuple(first["loc"])
        key = ".".join(map(str, (*before, *inside))) or "the file"
        kind = first["type"]
        if kind == "extra_forbidden":
            name, known = str(inside[-1]), _keys_at(model, inside[:-1])
            message = f"unknown key {key}; {nearest_name(name, known)}"
        elif kind == "missing":
            message = f"missing key {key}"
        else:
            words = str(first["msg"]).replace("Value error, ", "")
            value = first.get("input")
            tail = f", not {value!r}" if isinstance(value, (str, int, float, bool)) else ""
            message = f"{key}: {words[:1].lower()}{words[1:]}{tail}"
        return self.error(shown or (*before, *inside), message)


def nearest_name(name: str, known: Sequence[str]) -> str:
    """A hint for an unknown name: the closest one, or all of them."""
    close = difflib.get_close_matches(name, known, n=1)
    names = ", ".join(sorted(known)) or "none: nothing is swept"
    return f"did you mean {close[0]}?" if close else f"known keys: {names}"


def _keys_at(model: Any, place: KeyPath) -> list[str]:
    for step in place:
        if isinstance(step, int):
            continue
        fields = getattr(model, "model_fields", {})
        model = _model_in(fields[step].annotation) if step in fields else None
    return list(getattr(model, "model_fields", {}))


def _model_in(annotation: Any) -> Any:
    """The model class inside Optional[...] or List[...]."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_model_in, get_args(annotation))), None)


class NoSuchPlace(Exception):
    """A dotted path that does not exist."""


def put(content: Any, path: str, value: Any) -> KeyPath:
    """Set the value at a dotted path. A step into the faults is an index or an action's name."""
    place: list[str | int] = []
    steps = path.split(".")
    for index, step in enumerate(steps):
        last = index == len(steps) - 1
        key: str | int = step
        if isinstance(content, list):
            try:
                key = _index_of(content, step)
            except NoSuchPlace:
                raise NoSuchPlace(f"{'.'.join(steps[:index])} has no entry {step}") from None
            if not is_up_to(step, MOST):  # an action's name leads into the fault and the action
                place.append(key)
                content, key = content[int(key)], step
        elif not isinstance(content, dict):
            raise NoSuchPlace(f"{'.'.join(steps[:index])} is a value and has no key {step}")
        place.append(key)
        if last:
            content[key] = value
        elif isinstance(content, dict):
            content = content.setdefault(str(key), {})
        else:
            content = content[int(key)]
    return tuple(place)


def _index_of(entries: Sequence[Any], step: str) -> int:
    if is_up_to(step, MOST):
        if int(step) >= len(entries):
            raise NoSuchPlace
        return int(step)
    for index, entry in enumerate(entries):
        if isinstance(entry, dict) and step in entry:
            return index
    raise NoSuchPlace


def check_scenario(scenario: Scenario, source: Source) -> None:
    """Refuse what would never happen, or would end each run.

    Raises ConfigurationError that points into the file.
    """
    for place, words in _mistakes(scenario):
        raise source.error(("base", *place), f"{'.'.join(map(str, place))}: {words}")


def _mistakes(scenario: Scenario) -> Iterator[tuple[KeyPath, str]]:
    if scenario.model == "ideal":
        yield from _wrong_in_ideal(scenario)
    yield from _wrong_layouts(scenario)
    yield from _wrong_goals(scenario)
    yield from _wrong_ids(scenario)
    yield from _late_begins(scenario)


def _wrong_in_ideal(scenario: Scenario) -> Iterator[tuple[KeyPath, str]]:
    kill = scenario.faults[0].kill if len(scenario.faults) == 1 else None
    if kill is None or kill.pick not in ("random", "cut_vertex") or kill.ids is not None:
        yield ("faults",), "with model ideal one kill, of a random share or number or cut vertices"
    if scenario.obstacles.boxes:
        yield ("obstacles",), "model ideal has none: its drones fly straight"
    if scenario.sequence is not None:
        yield ("sequence",), "model ideal has none: it knows one kill"


def _wrong_layouts(scenario: Scenario) -> Iterator[tuple[KeyPath, str]]:
    clearance_m = scenario.repair_options.clearance_m
    cases: list[tuple[KeyPath, int]] = []
    if scenario.layout.kind == "casus":
        cases.append((("layout", "case"), scenario.layout.case))
    flown = [(index, fault.layouts) for index, fault in enumerate(scenario.faults) if fault.layouts]
    for index, layouts in flown:
        cases += [(("faults", index, "layouts", "cases"), case) for case in layouts.cases]
    for place, case in cases:
        try:
            orders = dict(Layouts.shipped().orders(case))
            if place[0] == "faults":
                check_apart(orders, clearance_m)
        except (GoalRefused, UnknownCase) as error:
            yield place, str(error)
            return
    ids, gateways = _ids_of(scenario.layout)
    corners = len(ids) - max(1, len(gateways)) + 1  # the routers, and the first gateway
    for index, layouts in flown:
        apart_m = 2 * (layouts.ring_m or math.inf) * math.sin(math.pi / corners)
        if apart_m < clearance_m:
            yield (
                ("faults", index, "layouts", "ring_m"),
                f"{corners} drones would stand {apart_m:.2f} m apart: the clearance is "
                f"{clearance_m:g} m",
            )


def _wrong_goals(scenario: Scenario) -> Iterator[tuple[KeyPath, str]]:
    fence = scenario.fence.fence()
    for index, fault in enumerate(scenario.faults):
        if fault.order is not None and fault.order.to is not None:
            x, y, height = (*fault.order.to, 0.0)[:3]
            try:
                check_goal(y, x, height, fence)
            except GoalRefused as error:
                yield ("faults", index, "order", "to"), str(error)


def _wrong_ids(scenario: Scenario) -> Iterator[tuple[KeyPath, str]]:
    ids, gateways = _ids_of(scenario.layout)
    layout_has = f"the layout has {ids_in_words(ids)}"
    for node in sorted({int(node) for node, *_knot in scenario.mobility.knots or ()} - ids):
        yield ("mobility", "path"), f"the trace names drone {node}; {layout_has}"
    for index, fault in enumerate(scenario.faults):
        place = ("faults", index, fault.action)
        for node in sorted(_ids_named_by(fault) - ids):
            yield place, f"no drone {node}; {layout_has}"
        if fault.gateway_off is not None and fault.gateway_off.id not in (gateways or ids):
            yield place, f"drone {fault.gateway_off.id} is no gateway; use kill"


def _ids_of(layout: Layout) -> tuple[set[int], set[int]]:
    """The drones of a layout, and those that are gateways; none: the seed decides."""
    if layout.kind in ("casus", "file"):
        points = places.casus(layout) if layout.kind == "casus" else places.of_file(layout)
        return {p.node_id for p in points}, {p.node_id for p in points if p.gateway}
    gateways = range(layout.gateways) if layout.ids == "in_order" else ()
    return set(range(layout.drones)), set(gateways)


def _ids_named_by(fault: Fault) -> set[int]:
    one: int | None = getattr(fault.what, "id", None)
    several = (getattr(fault.what, key, None) or () for key in ("ids", "between"))
    return {node for some in several for node in some} | (set() if one is None else {one})


def _late_begins(scenario: Scenario) -> Iterator[tuple[KeyPath, str]]:
    """What begins after the end of the run: nothing would show that it never happened."""
    if scenario.sequence is not None:  # it has faults and an end of its own
        return
    begins: list[tuple[KeyPath, float | None]] = [
        (("faults", index, fault.action), fault.at_s) for index, fault in enumerate(scenario.faults)
    ]
    if scenario.probes.per_s:
        begins.append((("probes", "from_s"), scenario.probes.from_s + scenario.probes.within_s))
    if scenario.mobility.knots:
        begins.append((("mobility", "path"), min(t for _id, t, *_place in scenario.mobility.knots)))
    end = f"the end of the run (duration_s {scenario.duration_s:g})"
    for place, begin_s in begins:
        if begin_s is not None and begin_s >= scenario.duration_s:
            yield place, f"begins at {begin_s:g} s, after {end}"
    for index, fault in enumerate(scenario.faults):
        counts_s = (fault.at_s or 0.0) + fault.load.counted_after_s if fault.load else 0.0
        if counts_s >= scenario.duration_s:
            yield ("faults", index, "load"), f"counts from {counts_s:g} s on, after {end}"
