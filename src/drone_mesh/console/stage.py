"""Stage: plays a demonstration on the mesh that the console shows."""

from __future__ import annotations

import asyncio
import math
from concurrent.futures import Executor
from typing import Any, Mapping, Sequence

from drone_mesh.console.controls import MeshControls, OrderRefused
from drone_mesh.console.demonstration import Order, RepairDemonstration
from drone_mesh.console.frames import FrameStore
from drone_mesh.state.model import MeshStatus
from drone_mesh.state.repair_story import RepairStory

POLL_PERIOD_S = 0.1  # wall time


class Stage:
    """One demonstration at a time. Belongs to the server's event loop; orders run in `workers`."""

    def __init__(self, store: FrameStore, controls: MeshControls, workers: Executor) -> None:
        self._store = store
        self._controls = controls
        self._workers = workers
        self._running: asyncio.Task[None] | None = None

    def begin(self) -> str:
        """Begin a demonstration; returns words for the page. Raises OrderRefused."""
        if self._running is not None and not self._running.done():
            raise OrderRefused("a demonstration is running")
        self._running = asyncio.ensure_future(self._play(RepairDemonstration()))
        return "the demonstration begins"

    def end(self) -> str:
        """End the demonstration, or close the story of a finished one."""
        if self._running is not None and not self._running.done():
            self._running.cancel()
            return "the demonstration ends"
        self._store.set_story({})
        return "closed"

    async def _play(self, demonstration: RepairDemonstration) -> None:
        story, shown = demonstration.story, None
        try:
            while not demonstration.is_over:
                mesh = self._store.mesh
                if mesh is not None and mesh is not shown:
                    if shown is not None and mesh.stamp_s < shown.stamp_s:
                        raise OrderRefused("the simulation was restarted")
                    shown = mesh
                    orders = demonstration.advance(mesh)
                    self._store.set_story(describe(story, mesh, running=True))
                    await self._carry_out(orders)
                await asyncio.sleep(POLL_PERIOD_S)
            await self._carry_out(demonstration.leave())
        except OrderRefused as error:
            await self._stop(demonstration, str(error), shown)
        except asyncio.CancelledError:
            await self._stop(demonstration, "ended by the user", shown)
        if shown is not None:
            self._store.set_story(describe(story, shown, running=False))

    async def _stop(
        self, demonstration: RepairDemonstration, why: str, mesh: MeshStatus | None
    ) -> None:
        demonstration.story.add(f"Not finished: {why}", 0.0 if mesh is None else mesh.stamp_s)
        for order in demonstration.leave():
            try:
                await self._carry_out([order])
            except OrderRefused:
                continue  # the mesh may be gone; undo as much as possible

    async def _carry_out(self, orders: Sequence[Order]) -> None:
        loop = asyncio.get_running_loop()
        for order in orders:
            await loop.run_in_executor(self._workers, order, self._controls)


def describe(story: RepairStory, mesh: MeshStatus, running: bool) -> Mapping[str, Any]:
    """The story for a page: its steps, and how many seconds the mesh still waits at the last."""
    steps = [{"t": round(step.at_s, 1), "text": step.text} for step in story.steps]
    wait: dict[str, int] = {}
    if running and story.steps and story.steps[-1].until_s < math.inf:
        last = story.steps[-1]
        left_s = max(0.0, last.until_s - mesh.stamp_s)
        wait = {"left": math.ceil(left_s), "of": math.ceil(last.until_s - last.at_s)}
    return {"running": running, "steps": steps, "wait": wait}
