"""A real mesh under a virtual clock behind the console: everything but ROS is the real thing."""

from __future__ import annotations

import random
import threading
import time
from dataclasses import replace
from typing import Sequence

from drone_mesh.console.controls import OrderRefused
from drone_mesh.console.dots import Dot
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.fleet import MAX_DRONES
from drone_mesh.drone.flight_path import Point
from drone_mesh.errors import ConfigurationError, GoalRefused
from drone_mesh.fence_file import Row, fence_of
from drone_mesh.formations.layouts import Layouts, Order, UnknownCase
from drone_mesh.formations.missions import Mission
from drone_mesh.formations.preview import FormationPreview, preview
from drone_mesh.inprocess.network import Network
from drone_mesh.mobility.pilot import along
from drone_mesh.state.model import EventRecord, MeshStatus
from drone_mesh.state.observation import EventBatcher
from drone_mesh.state.packets import PacketSampler

STEP_S = 0.05  # wall time between two steps of the clock


class InProcessMesh:
    """Owns the network; a lock is held for each step, order and reading, none of which waits."""

    def __init__(
        self,
        routers: int,
        gridsize: int,
        spacing: float,
        max_distance: float = 9.0,
    ):
        self._lock = threading.Lock()
        self._network = Network(seed=1, max_distance_m=max_distance)
        self._network.add_fleet(1, routers, gridsize, spacing)
        self._sampler = PacketSampler(random.Random(1))
        self._sampled_s = 0.0  # simulated: when the sample was last taken
        self._carry, self._network.air.send = self._network.air.send, self._noted
        self._layouts = Layouts({})
        self._batcher = EventBatcher()
        self._told = 0
        self.factor, self.paused = 1.0, False
        self._areas: dict[str, Row] = {}

    def _noted(self, packet: bytes) -> bool:
        carried = self._carry(packet)
        if carried:
            self._sampler.note(packet, self._network.now_s())
        return carried

    def packets(self, within_s: float) -> tuple[int, list[Dot]]:
        """The packets since the last call, as if they had been carried within so many seconds."""
        with self._lock:
            carried, sample = self._sampler.drain()
            now_s = self._network.now_s()
        passed_s, self._sampled_s = now_s - self._sampled_s, now_s
        scale = within_s / passed_s if passed_s else 0.0
        return carried, [Dot(*p[:3], (now_s - p.at_s) * scale) for p in sample]

    def run(self, stop: threading.Event) -> None:
        """Let time pass until `stop` is set."""
        before = time.monotonic()
        while not stop.wait(STEP_S):
            now = time.monotonic()
            with self._lock:
                if not self.paused:
                    self._network.run_for((now - before) * self.factor)
            before = now

    def skip(self, seconds: float) -> None:
        """Let simulated time pass at once."""
        with self._lock:
            self._network.run_for(seconds)

    def read(self) -> tuple[MeshStatus, list[EventRecord]]:
        """The mesh now, and what happened since the last call."""
        with self._lock:
            for event in self._network.events[self._told :]:
                self._batcher.observe(event)
            self._told = len(self._network.events)
            achieved = 0.0 if self.paused else self.factor
            mesh = replace(
                self._network.status(),
                real_time_factor=self.factor,
                achieved_real_time_factor=achieved,
                paused=self.paused,
            )
            return mesh, self._batcher.drain()

    def place_of(self, node: int) -> tuple[float, float]:
        """x, y in metres."""
        with self._lock:
            place = self._network.location(node)
        return place.longitude, place.latitude

    def power(self, node: int, on: bool) -> str:
        with self._lock:
            self._network.power(node, on)
        return f"node {node} is {'on' if on else 'off'}"

    def fly(self, node: int, x: float, y: float, z: float, allow_shared_place: bool = False) -> str:
        try:
            with self._lock:
                taken = self._network.order(
                    node, x, y, round(z), allow_shared_place=allow_shared_place
                )
        except GoalRefused as error:
            raise OrderRefused(str(error)) from error
        if not taken:
            raise OrderRefused(f"the gateway has no route to drone {node}")
        return f"drone {node} is sent to ({x:g}, {y:g}, {z:g})"

    def layout(self, case: int) -> str:
        try:
            orders = self._layouts.orders(case)
        except UnknownCase as error:
            raise OrderRefused(str(error)) from error
        self._order(orders)
        return f"ordered layout {case}"

    def formation(self, name: str, orders: Sequence[Order], gateways: Sequence[int]) -> str:
        self._order(orders)
        return f"{name}: ordered {len(orders)} of {len(orders)} drones"

    def _order(self, orders: Sequence[Order]) -> None:
        with self._lock:
            for node, goal in orders:
                if node in self._network.nodes:
                    place = (goal.longitude, goal.latitude, int(goal.height))
                    self._network.order(node, *place, allow_shared_place=True)

    def preview(self, case: int) -> FormationPreview:
        with self._lock:
            status = self._network.status()
        return preview(status, dict(self._layouts.orders(case)))

    def speed(self, paused: bool, factor: float) -> str:
        self.paused, self.factor = paused, factor or self.factor
        return "paused" if paused else f"speed {self.factor:g}"

    def add(self, node: int | None, gateway: bool, x: float, y: float) -> str:
        with self._lock:
            nodes = self._network.nodes
            if node is None:
                node = min(set(range(MAX_DRONES)) - nodes.keys())
            elif node in nodes:
                raise OrderRefused(f"drone {node} exists already: choose another id")
            add = self._network.add_gateway if gateway else self._network.add_router
            add(node, x, y, self._network.now_s())
        return f"added {'gateway' if gateway else 'router'} {node} at x {x:g} m, y {y:g} m"

    def keep_to(self, areas: Sequence[Row]) -> None:
        """Let all drones keep these areas."""
        self._areas = {str(area["name"]): area for area in areas}
        with self._lock:
            self._network.set_fence(fence_of(areas) if areas else Fence())

    def fence(
        self, name: str, corners: Sequence[Point], inside: bool, max_height: float | None
    ) -> str:
        areas = {other: area for other, area in self._areas.items() if other != name}
        if corners:
            area = {"name": name, "inclusion": inside, "max_height": max_height}
            areas[name] = {**area, "polygon": corners}
        try:
            self.keep_to(list(areas.values()))
        except ConfigurationError as error:
            raise OrderRefused(str(error)) from error
        return f"fence of {len(areas)} areas"

    def mission(self, nodes: Sequence[int], mission: Mission) -> str:
        with self._lock:
            tracks = {
                node: along(mission.waypoints, mission.speed_m_s, mission.loop) for node in nodes
            }
            self._network.fly(tracks)
        return f"the mission of {len(nodes)} drones has begun"

    def pilots(self, action: str) -> str:
        raise OrderRefused("no drone has a mission")

    def remove(self, node: int) -> str:
        with self._lock:
            gone = self._network.nodes.pop(node)
            gone.component.stop()
        return f"removed router {node}"
