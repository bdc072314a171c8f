"""Conditions that start a fault: "when all connected", "10 s after the first flight"."""

from __future__ import annotations

import difflib
import re
from typing import NamedTuple

EVENTS = ("all connected", "the first flight", "the first landing", "the first loss", "healed")

_PATTERN = re.compile(
    r"\s*(?:when\s+|(?P<delay>\d+(?:\.\d+)?)\s*s\s+after\s+)?(?P<event>[a-z ]+?)\s*", re.IGNORECASE
)


class StartCondition(NamedTuple):
    """A delay after the first occurrence of an event."""

    event: str  # one of EVENTS
    delay_s: float


def parse_condition(text: str) -> StartCondition:
    """Raises ValueError, with what is allowed, for an invalid condition."""
    match = _PATTERN.fullmatch(text)
    event = " ".join(match.group("event").lower().split()) if match else ""
    if match is None or event not in EVENTS:
        close = difflib.get_close_matches(event, EVENTS, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"events: {', '.join(EVENTS)}"
        raise ValueError(f"expected 'when EVENT' or 'N s after EVENT'; {hint}")
    return StartCondition(event, float(match.group("delay") or 0.0))
