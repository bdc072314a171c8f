"""FrameStore: the state that a page should show, and its difference to what the page has.

A frame is one JSON object: `version`, `clock`, `nodes` (id -> changed fields), `gone` (ids),
`events` and `samples` (new ones), `obstacles`, `fence`, `alarms` and `story` (complete, if they
have changed). A page at version v gets what changed after v, however long ago: a page that falls
behind gets a larger difference, and nothing is queued for it.

The fields of a node are those of NodeState.msg, plus decisions that the page only displays: the
node's condition, the name of its colour, its trouble, its slot among nodes at the same position,
the progress of its latest order, what it does now, and its links with nodes of higher ids.
"""

from __future__ import annotations

import json
import math
from collections import deque
from dataclasses import asdict, astuple
from typing import Any, Iterable, Mapping, Sequence

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.console.history import History
from drone_mesh.drone.geodesy import Origin
from drone_mesh.state.alarms import AlarmBook
from drone_mesh.state.condition import Trouble, condition_of, find_trouble, summarise
from drone_mesh.state.doing import doings
from drone_mesh.state.links import LinkForecast, LostLinks, known_links, links_by_use
from drone_mesh.state.model import (
    AreaStatus,
    EventRecord,
    MeshStatus,
    NodeStatus,
    ObstacleStatus,
    channel_in_words,
    data_in_words,
    footprint,
    position_is_known,
    rings_of,
)
from drone_mesh.state.orders import OrderWatch
from drone_mesh.state.outages import MeshSample, take_sample
from drone_mesh.view.palette import node_colour_name
from drone_mesh.view.scene import fan_out, shape_named

EVENTS_KEPT = 1000  # more than a person scrolls back
EVENTS_PER_FRAME = 300  # of a burst of thousands only the newest are read
CHARTS_S = 600.0  # simulated
SAMPLES_KEPT = 600
SAMPLE_PERIOD_S = 1.0  # wall time
NOTHING_MORE: Mapping[int, Mapping[str, Any]] = {}


class FrameStore:
    """Belongs to one thread, the server's event loop. An empty page has version 0."""

    def __init__(self, history: History | None = None, origin: Origin | None = None) -> None:
        """`history` keeps the states given to the store, for pages that look back.

        `origin`: where the mesh is on the earth, if that is known.
        """
        self.version = 0
        self.history = history
        self.origin = origin
        self._mesh: MeshStatus | None = None
        self._link = "waiting for the first state of a mesh"
        self._clock: dict[str, Any] = {}
        self._nodes: dict[int, dict[str, Any]] = {}
        self._changed_at: dict[int, dict[str, int]] = {}
        self._gone_at: dict[int, int] = {}
        self._events: deque[tuple[int, dict[str, Any]]] = deque(maxlen=EVENTS_KEPT)
        self._samples: deque[tuple[int, MeshSample]] = deque(maxlen=SAMPLES_KEPT)
        self._sampled_at_s = float("-inf")
        self._lost_links = LostLinks()
        self._forecast = LinkForecast()
        self._orders = OrderWatch()
        self._alarms = AlarmBook()
        self._run_began_at = 0
        # What is sent complete: the version in which it changed, and the content.
        self._complete: dict[str, tuple[int, Any]] = {
            "obstacles": (0, []),
            "fence": (0, []),
            "alarms": (0, []),
            "story": (0, {}),
        }
        self._cache: dict[int, str] = {}

    def update_mesh(
        self,
        mesh: MeshStatus,
        wall_s: float,
        more: Mapping[int, Mapping[str, Any]] = NOTHING_MORE,
    ) -> None:
        """Replace the state of the mesh.

        `wall_s`: wall time in seconds; `more`: by node, what only real nodes report.
        """
        self._next_version()
        if self._mesh is not None and mesh.stamp_s < self._mesh.stamp_s:
            self._forget_run()
        self._mesh, self._link = mesh, ""
        if self.history is not None:
            self.history.add(mesh, wall_s)
        troubles = {trouble.node: trouble for trouble in find_trouble(mesh.nodes)}
        summary = summarise(mesh.nodes, list(troubles.values()))
        self._clock = {
            "t": round(mesh.stamp_s, 2),
            "paused": mesh.paused,
            "factor": round(mesh.real_time_factor, 3),
            "achieved": round(mesh.achieved_real_time_factor, 2),
            "range": round(mesh.max_distance, 3),
            "summary": summary.text,
            "severity": int(summary.severity),
            "routing": mesh.routing,
            "repair": mesh.repair_strategy,
            "layouts": list(mesh.layouts),
            "shape": shape_named(mesh.shape).value,
            "origin": astuple(self.origin) if self.origin else None,
        }
        for gone in self._nodes.keys() - {node.id for node in mesh.nodes}:
            del self._nodes[gone]
            del self._changed_at[gone]
            self._gone_at[gone] = self.version
        self._replace("obstacles", [_obstacle(box) for box in mesh.obstacles])
        self._replace("fence", [_area(area) for area in mesh.fence])
        slots, does = fan_out(mesh.nodes), doings(mesh.nodes)
        for node in mesh.nodes:
            fields = _fields(node, troubles.get(node.id))
            fields.update(self._order_of(node), slot=slots.get(node.id), does=does[node.id])
            fields.update(more.get(node.id, {}))
            self._update_node(node.id, fields)
        for node_id, fields in self._links(mesh, wall_s).items():
            self._update_node(node_id, fields)
        self._alarms.update(mesh)
        self._replace("alarms", self._alarms.groups())
        if wall_s - self._sampled_at_s >= SAMPLE_PERIOD_S and not mesh.paused:
            self._sampled_at_s = wall_s
            self._samples.append((self.version, take_sample(mesh)))

    def add_events(self, events: Iterable[EventRecord]) -> None:
        """Add new events, oldest first."""
        events = list(events)
        self._next_version()
        self._orders.on_events(events)
        self._alarms.on_events(events)
        self._replace("alarms", self._alarms.groups())
        if self.history is not None:
            self.history.add_events(events)
        self._show_events(events)

    def _show_events(self, events: Iterable[EventRecord]) -> None:
        self._events.extend(
            (
                self.version,
                {
                    "t": round(event.stamp_s, 2),
                    "node": event.node,
                    "kind": event.kind,
                    "peers": list(event.peers),
                    "detail": event.explanation(),
                },
            )
            for event in events
        )

    def expect_orders(self, drones: Iterable[int]) -> int:
        """An order to these drones is being sent; returns a ticket for `forget_expected`."""
        ticket = self._orders.expect(drones)
        self._show_orders()
        return ticket

    def forget_expected(self, ticket: int) -> None:
        """Show earlier orders again for the drones for which no event of this order has come."""
        self._orders.forget_expected(ticket)
        self._show_orders()

    def acknowledge(self, text: str) -> int:
        """Somebody has seen all alarms with this text; returns how many."""
        seen = self._alarms.acknowledge(text)
        self._next_version()
        self._replace("alarms", self._alarms.groups())
        return seen

    def _show_orders(self) -> None:
        self._next_version()
        for node in self._mesh.nodes if self._mesh else ():
            self._update_node(node.id, self._order_of(node))

    def _order_of(self, node: NodeStatus) -> dict[str, str]:
        """The latest order of a node, and its progress since."""
        return {"order": self._orders.words(node.id, node), "since": self._orders.since(node)}

    @property
    def mesh(self) -> MeshStatus | None:
        return self._mesh

    def restart(self, samples: Sequence[MeshSample]) -> None:
        """Start over, as when a page jumps in time: with these samples and without events."""
        self._next_version()
        self._forget_run()
        self._mesh = None
        recent = [s for s in samples if s.stamp_s > samples[-1].stamp_s - CHARTS_S]
        step = math.ceil(len(recent) / SAMPLES_KEPT) or 1
        self._samples.extend((self.version, sample) for sample in recent[::-step][::-1])
        self._sampled_at_s = float("-inf")

    def saved(self) -> dict[str, Any]:
        """What neither the next state nor the history tells, as plain values for `restore`."""
        return {"alarms": self._alarms.saved(), "orders": self._orders.saved()}

    def restore(
        self,
        saved: Mapping[str, Any],
        events: Sequence[EventRecord],
        samples: Sequence[MeshSample],
    ) -> None:
        """Go on with what a console before this one saved in the same run.

        Raises KeyError, TypeError or ValueError if it is no such thing.
        """
        self.restart(samples)
        self._alarms.restore(saved["alarms"])
        self._orders.restore(saved["orders"])
        self._show_events(events)
        self._replace("alarms", self._alarms.groups())

    def set_story(self, story: Mapping[str, Any]) -> None:
        """Set the story of a demonstration for the pages; empty: none."""
        if story != self._complete["story"][1]:
            self._next_version()
            self._replace("story", story)

    def set_link(self, text: str) -> None:
        """Set the reason why no states arrive, as text for the page; empty: they do."""
        if text != self._link:
            self._next_version()
            self._link = text

    def frame_since(self, version: int) -> str:
        """JSON text of what changed after `version`; after version 0 that is everything."""
        if version not in self._cache:
            self._cache[version] = json.dumps(self._build(version), separators=(",", ":"))
        return self._cache[version]

    def detail_of(self, node_id: int) -> dict[str, Any]:
        """The values of the selected node that change all the time, which pages show for no other.

        `neighbours`: (neighbour, simulated seconds since it was last heard); `fallback_age`:
        simulated seconds since the fallback position was reported, None without one.
        """
        for node in self._mesh.nodes if self._mesh else ():
            if node.id == node_id:
                age = node.fallback_age
                return {
                    "neighbours": list(zip(node.neighbours, node.neighbour_ages)),
                    "fallback_age": round(age) if math.isfinite(age) else None,
                }
        return {"neighbours": [], "fallback_age": None}

    def _build(self, version: int) -> dict[str, Any]:
        if version < self._run_began_at:
            version = 0
        frame: dict[str, Any] = {
            "type": "frame",
            "full": version == 0,
            "version": self.version,
            "link": self._link,
            "clock": self._clock,
        }
        if nodes := {
            node: {key: fields[key] for key, at in self._changed_at[node].items() if at > version}
            for node, fields in self._nodes.items()
            if max(self._changed_at[node].values()) > version
        }:
            frame["nodes"] = nodes
        if gone := [node for node, at in self._gone_at.items() if at > version]:
            frame["gone"] = gone
        if events := [event for at, event in self._events if at > version]:
            frame["events"] = events[-EVENTS_PER_FRAME:]
        if samples := [asdict(sample) for at, sample in self._samples if at > version]:
            frame["samples"] = samples
        frame.update({part: what for part, (at, what) in self._complete.items() if at > version})
        return frame

    def _links(self, mesh: MeshStatus, wall_s: float) -> dict[int, dict[str, str]]:
        """For each node and use, the nodes with higher ids that it has a link with.

        `soon`: the links that will soon break, which are also known or on a route.
        """
        nodes, known = mesh.nodes, known_links(mesh.nodes)
        lost = self._lost_links.update(known, wall_s)
        sets = {use.name.lower(): links for use, links in links_by_use(nodes, lost).items()}
        soon = self._forecast.update(known, nodes, mesh.stamp_s, mesh.max_distance)
        sets["soon"] = set(soon)
        bits = {use: dict.fromkeys((node.id for node in nodes), 0) for use in sets}
        for use, links in sets.items():
            of_node = bits[use]
            for low, high in links:
                if low in of_node:
                    of_node[low] |= 1 << high
        return {
            node.id: {f"{use}_links": _hex(bits[use][node.id]) for use in sets} for node in nodes
        }

    def _update_node(self, node_id: int, fields: Mapping[str, Any]) -> None:
        known = self._nodes.setdefault(node_id, {})
        changed_at = self._changed_at.setdefault(node_id, {})
        self._gone_at.pop(node_id, None)
        for key, value in fields.items():
            if key not in known or known[key] != value:
                known[key] = value
                changed_at[key] = self.version

    def _replace(self, part: str, content: Any) -> None:
        if content != self._complete[part][1]:
            self._complete[part] = self.version, content

    def _next_version(self) -> None:
        self.version += 1
        self._cache.clear()

    def _forget_run(self) -> None:
        """Simulated time jumped: a different world. Charts and logs of all pages start over."""
        self._run_began_at = self.version
        self._lost_links, self._forecast = LostLinks(), LinkForecast()
        self._orders.forget()
        self._alarms.forget()
        self._events.clear()
        self._samples.clear()


def _fields(node: NodeStatus, trouble: Trouble | None) -> dict[str, Any]:
    condition = condition_of(node)
    return {
        "role": node.role,
        "on": node.on,
        "condition": condition.value,
        "colour": node_colour_name(node.role, condition),
        "gateway": node.gateway,
        "hops": node.hops,
        "next_hop": node.next_hop,
        "fallback": node.fallback,
        "known_nodes": node.known_nodes,
        "total_messages": node.total_messages,
        "neighbours": len(node.neighbours),
        "route": list(node.route),
        "position": _centimetres(node.position) if position_is_known(node) else None,
        "path": _centimetres(node.path),
        "heading": _centimetres(node.heading),
        "repair": node.repair,
        "mission": node.mission,
        "battery": round(node.battery) if math.isfinite(node.battery) else None,
        "time_left": round(node.time_left / 5) * 5 if math.isfinite(node.time_left) else None,
        "home": _centimetres(node.home),
        "pad": node.pad,
        "relieves": None if node.relieves == NO_ROUTE else node.relieves,
        "why_not_fly": node.why_not_fly,
        "channel": channel_in_words(node),
        "data": data_in_words(node),
        "trouble": trouble.text if trouble else "",
        "severity": int(trouble.severity) if trouble else 0,
    }


def _obstacle(box: ObstacleStatus) -> dict[str, Any]:
    return {
        "corners": [_centimetres(corner) for corner in footprint(box)],
        "top": round(float(box.center[2] + box.size[2] / 2), 2),
    }


def _area(area: AreaStatus) -> dict[str, Any]:
    low, high = (
        round(float(height_m), 2) if math.isfinite(height_m) else None
        for height_m in (area.lowest, area.highest)
    )
    rings = [[_centimetres(corner) for corner in ring] for ring in rings_of(area)]
    return {"name": area.name, "inside": area.inside, "low": low, "high": high, "rings": rings}


def _centimetres(metres: Sequence[float]) -> list[float]:
    return [round(float(value), 2) for value in metres]


def _hex(bits: int) -> str:
    """A set of ids, bit n for id n: a fifth of the length of a list of 200 ids."""
    return format(bits, "x")
