"""Stage: plays a demonstration on the mesh that the console shows."""

from __future__ import annotations

import asyncio
import contextlib
import math
from concurrent.futures import Executor
from typing import Any, Mapping, Sequence

from drone_mesh.console.controls import MeshControls, OrderRefused
from drone_mesh.console.demonstration import Demonstration, RepairDemonstration
from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.put_back import Order
from drone_mesh.console.relief_demonstration import ReliefDemonstration
from drone_mesh.state.model import MeshStatus

DEMONSTRATIONS: Mapping[str, type[Demonstration]] = {
    "repair": RepairDemonstration,
    "relief": ReliefDemonstration,
}
POLL_PERIOD_S = 0.1  # wall time
ENDED_AT_ONCE = "Ended at once: all are switched on, and those that are away stay where they are"


class Stage:
    """One demonstration at a time. Belongs to the server's event loop; orders run in `workers`."""

    def __init__(
        self, store: FrameStore, controls: MeshControls, workers: Executor, what: str
    ) -> None:
        """`what`: one of DEMONSTRATIONS."""
        self._kind = DEMONSTRATIONS[what]
        self._store = store
        self._controls = controls
        self._workers = workers
        self._running: asyncio.Task[None] | None = None
        self._ending = False  # it puts everything back, or shall do so

    def plan(self) -> str:
        """The plan of a demonstration, as a question. Raises OrderRefused if it cannot begin."""
        if self._store.mesh is None:
            raise OrderRefused("no state of a mesh yet")
        return self._kind.casting.choose(self._store.mesh).in_words()

    def begin(self) -> str:
        """Begin a demonstration; returns words for the page. Raises OrderRefused."""
        if self._running is not None and not self._running.done():
            raise OrderRefused("a demonstration is running")
        self._ending = False
        self._running = asyncio.ensure_future(self._play(self._kind()))
        return "the demonstration begins"

    def end(self) -> str:
        """End the demonstration, which restores the fleet; a second call ends it without flights.

        After its end: close its story.
        """
        if self._running is not None and not self._running.done():
            if self._ending:
                self._running.cancel()
                return "the demonstration ends at once"
            self._ending = True
            return "the demonstration ends, and puts everything back"
        self._store.set_story({})
        return "closed"

    async def _play(self, demonstration: Demonstration) -> None:
        shown = None
        try:
            while not demonstration.is_over:
                mesh = self._store.mesh
                if mesh is not None and mesh is not shown:
                    if shown is not None and mesh.stamp_s < shown.stamp_s:
                        demonstration.story.add("The simulation was restarted", mesh.stamp_s)
                        break
                    shown = mesh
                    if self._ending and not demonstration.is_leaving:
                        demonstration.leave("ended by the user", mesh.stamp_s)
                    try:
                        await self._carry_out(demonstration.advance(mesh))
                    except OrderRefused as error:
                        if demonstration.is_leaving:
                            raise
                        demonstration.leave(str(error), mesh.stamp_s)
                    self._ending = self._ending or demonstration.is_leaving
                    self._store.set_story(describe(demonstration, mesh, running=True))
                await asyncio.sleep(POLL_PERIOD_S)
        except (OrderRefused, asyncio.CancelledError):
            for order in demonstration.power_back():
                with contextlib.suppress(OrderRefused):  # undo as much as possible
                    await self._carry_out([order])
            if shown is not None:
                demonstration.story.add(ENDED_AT_ONCE, shown.stamp_s)
        if shown is not None:
            self._store.set_story(describe(demonstration, shown, running=False))

    async def _carry_out(self, orders: Sequence[Order]) -> None:
        loop = asyncio.get_running_loop()
        for order in orders:
            await loop.run_in_executor(self._workers, order, self._controls)


def describe(demonstration: Demonstration, mesh: MeshStatus, running: bool) -> Mapping[str, Any]:
    """The story for a page.

    Its steps, how many seconds the mesh still waits at the last one, who takes part, and the places
    to show.
    """
    story, plan = demonstration.story, demonstration.plan
    steps = [{"t": round(step.at_s, 1), "text": step.text} for step in story.steps]
    wait: dict[str, int] = {}
    if running and story.steps and story.steps[-1].until_s < math.inf:
        last = story.steps[-1]
        left_s = max(0.0, last.until_s - mesh.stamp_s)
        wait = {"left": math.ceil(left_s), "of": math.ceil(last.until_s - last.at_s)}
    told = {"running": running, "steps": steps, "wait": wait}
    if plan is None or demonstration.is_leaving:
        return told
    return {**told, "cast": [plan.gateway, *plan.cast], "places": list(plan.places.values())}
