"""MovedFrames: which drones' tf frames are to be sent with a state."""

from __future__ import annotations

from typing import Sequence

from drone_mesh.state.model import NodeStatus, position_is_known

ALL_FRAMES_PERIOD_S = 1.0  # wall time; period of the frames of drones that do not move


class MovedFrames:
    """Selects the drones that moved; all of them once per ALL_FRAMES_PERIOD_S.

    A frame is sent once per stamp: tf2 keeps one transform per stamp, and warns about a second one
    (TF_REPEATED_DATA). While the simulation is paused, all states have the same stamp.
    """

    def __init__(self) -> None:
        self._sent: dict[int, tuple[float, tuple[float, ...]]] = {}  # node -> stamp, position
        self._all_sent_s = float("-inf")

    def select(
        self, nodes: Sequence[NodeStatus], stamp_s: float, wall_s: float
    ) -> list[NodeStatus]:
        """The drones to send; `stamp_s`: of the state, simulated seconds."""
        all_due = wall_s - self._all_sent_s >= ALL_FRAMES_PERIOD_S
        if all_due:
            self._all_sent_s = wall_s
        selected = []
        for node in nodes:
            if not position_is_known(node):
                continue
            position = tuple(node.position)
            before_s, before = self._sent.get(node.id, (None, None))
            if before_s != stamp_s and (all_due or before != position):
                self._sent[node.id] = stamp_s, position
                selected.append(node)
        return selected
