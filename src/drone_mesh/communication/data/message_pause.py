"""MessagePause: the pause between the messages of one outbox on a shared channel.

A window cannot become smaller than one message, and many nodes with one message each still
congest a channel. The pause takes the place of smaller windows: it doubles with each timeout,
grows while the channel around the node is busy, and shrinks with each answer otherwise
(multiplicative decrease: Chiu and Jain, 1989).
"""

from __future__ import annotations

import math

BUSY_PATIENCE = 1.7  # our choice: two thirds of what an antenna reports at most
MOST_PAUSE_S = 30.0  # our choice: three check periods
MOST_ROUND_TRIPS = 8.0  # our choice: the longest pause once an answer has come
GROWS_BY = 1.5  # our choice: with each answer on a busy channel
SHRINKS_BY = 0.8  # our choice: with each other answer
LEAST_PAUSE_S = 0.05  # our choice: a shorter one is none


class MessagePause:
    """The pause of one outbox."""

    def __init__(self) -> None:
        self.pause_s = 0.0
        self.until_s = -math.inf

    def on_silence(self, timeout_s: float) -> None:
        """No answer came within `timeout_s`."""
        self.pause_s = min(MOST_PAUSE_S, max(timeout_s, 2.0 * self.pause_s))

    def on_answer(self, round_trip_s: float, patience: float, now_s: float) -> None:
        """An answer came: the pause begins.

        `round_trip_s`: the mean of all answers; `patience`: see IWirelessCommunication.
        """
        if patience >= BUSY_PATIENCE:
            self.pause_s = GROWS_BY * self.pause_s + round_trip_s / 2
        else:
            self.pause_s *= SHRINKS_BY
        self.pause_s = min(self.pause_s, MOST_ROUND_TRIPS * round_trip_s)
        if self.pause_s < LEAST_PAUSE_S:
            self.pause_s = 0.0
        self.until_s = now_s + self.pause_s if self.pause_s else -math.inf
