"""OwnId: what a node does about another radio that uses its id (docs/protocol.md, "One id twice").

Both name it. A router that was first connected less than a check period ago gives way to one that
is connected: it switches its antenna off for a while, as a radio that listens also acknowledges
packets for the other one.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

from drone_mesh.communication.control.control_plane import IControlPlane
from drone_mesh.communication.control.node_part import due
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.interfaces import IWirelessCommunication
from drone_mesh.communication.timing import Deadlines, Due, RateLimit

SHARED_FOR_S = 60.0  # for so long after the last packet of the other, both say so
OFF_S = 30.0  # the antenna of a node that gives way is off for 1 to 2 times this
INTRODUCTIONS = 3  # in OFF_S, so that the other one hears one each time it comes back
APART_S = 1.0  # between two of them, 0.5 to 1.5 times this: both send, and hear nothing meanwhile


@dataclass(eq=False)
class OwnId:
    """Another radio with the id of one node. Belongs to the component's thread."""

    _control: IControlPlane
    _antenna: IWirelessCommunication
    _deadlines: Deadlines
    _complaints: Complaints
    _rng: random.Random  # two that gave way do not return together, nor do both send at one time
    _new_for_s: float  # it gives way until it has been connected for longer than this
    # When the node was first connected, since it last gave way; a gateway always was: its drones
    # look for it as soon as it starts.
    _connected_s: float

    def __post_init__(self) -> None:
        self._heard_s = -math.inf
        self._is_off = False
        self._introductions = RateLimit(INTRODUCTIONS, OFF_S)

    def connected(self) -> None:
        self._connected_s = min(self._connected_s, self._deadlines.now_s)

    def heard(self, kind: int, payload: bytes) -> None:
        """A packet of the other radio: name it, show that the id is taken, or give way."""
        now_s, was_heard = self._deadlines.now_s, self._heard_s > -math.inf
        self._complaints.own_id_heard(now_s)
        self._heard_s = now_s
        is_new = now_s - self._connected_s <= self._new_for_s
        if is_new and was_heard and self._control.says_connected(kind, payload):
            self._connected_s, self._is_off = math.inf, True
            self._deadlines.set(Due.OWN_ID, now_s + OFF_S * (1.0 + self._rng.random()))
            self._antenna.switch_power(False)
        elif self._deadlines.at_s[Due.OWN_ID] == math.inf:
            self.on_due()

    @due(Due.OWN_ID)
    def on_due(self) -> None:
        """Come back, or introduce itself, a few times in a row."""
        next_s = math.inf
        if self._is_off:
            self._is_off = False
            self._antenna.switch_power(True)
        elif self._introductions.count(0, self._deadlines.now_s):
            self._control.introduce()
            next_s = self._deadlines.now_s + APART_S * (0.5 + self._rng.random())
        self._deadlines.set(Due.OWN_ID, next_s)

    def is_shared(self) -> bool:
        """Whether the other radio was heard lately. Any thread may ask."""
        return self._deadlines.now_s - self._heard_s <= SHARED_FOR_S
