"""SeenFloods: the fragments to all nodes that this node has already forwarded."""

from __future__ import annotations

from collections import OrderedDict

REMEMBERED_S = 5.0  # our choice: 256 messages to all need longer, so no number comes twice
MOST_REMEMBERED = 1024  # messages of all senders together


class SeenFloods:
    """Remembers fragments by sender, message and index. Memory: MOST_REMEMBERED entries."""

    def __init__(self) -> None:
        self._seen: OrderedDict[tuple[int, int], tuple[int, float]] = OrderedDict()

    def is_new(self, sender: int, number: int, index: int, now_s: float) -> bool:
        """Whether this fragment is new; records it."""
        key = (sender, number)
        indices, first_s = self._seen.get(key, (0, now_s))
        if now_s - first_s >= REMEMBERED_S:  # the number is that of another message by now
            indices, first_s = 0, now_s
        if indices >> index & 1:
            return False
        self._seen[key] = indices | 1 << index, first_s
        while len(self._seen) > MOST_REMEMBERED:
            self._seen.popitem(last=False)
        return True
