"""Trains of users' packets that a node overhears, and how long it sends nothing because of them.

Rule 5 of medium_access.py.
"""

from __future__ import annotations

import enum
import math
from typing import Final

from drone_mesh.channel.access_rules import AccessRules
from drone_mesh.communication.data import packets
from drone_mesh.communication.interfaces import BROADCAST
from drone_mesh.communication.wire import messages

_NO_SENDER: Final = -1


class InTrain(enum.Enum):
    """The place of an overheard packet in its train."""

    NO = "no"  # it belongs to none
    PERHAPS = "perhaps"  # another packet may follow at once
    MORE = "more"  # another packet follows, and the last one will say so
    LAST = "last"


class Yielding:
    """How long one node sends nothing because others send trains."""

    def __init__(self, rules: AccessRules) -> None:
        self._rules = rules
        self._since_s = -math.inf
        self.until_s = -math.inf
        self._to = _NO_SENDER  # whose train is under way
        self._enough = False  # it has waited long enough, so it is this node's turn

    def heard(self, sender: int, train: InTrain, now_s: float, wants_to_send: bool) -> None:
        """A packet of a train came in: wait for the end of that train."""
        if self._enough:
            return
        if now_s > self.until_s:
            self._since_s, self._to = now_s, _NO_SENDER
        if train is InTrain.LAST:
            if sender == self._to:
                self.until_s, self._to = now_s, _NO_SENDER
            return
        if train is InTrain.MORE:
            self._to = sender
        rules, announced = self._rules, self._to != _NO_SENDER
        pause_s = rules.train_hold_s if announced else rules.train_pause_s
        last_s = self._since_s + (rules.most_hold_s if announced else rules.most_yield_s)
        self.until_s = min(now_s + pause_s, last_s)
        self._enough = wants_to_send and self.until_s == last_s

    def has_sent(self) -> None:
        """The node had its turn."""
        self._enough = False


def place_in_train(payload: bytes, receiver: int) -> InTrain:
    """The place of a packet in its train, as `receiver` can tell."""
    if not messages.is_data(payload):  # most packets
        return InTrain.NO
    _creator, _from, kind, _to, addressee = messages.header(payload)
    if addressee == BROADCAST:
        return InTrain.NO
    if addressee == receiver or kind == packets.FRAGMENTS.start:
        return InTrain.PERHAPS
    return InTrain.MORE if kind in packets.FRAGMENTS else InTrain.LAST
