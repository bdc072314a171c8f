"""AccessRules: the numbers of the rules of medium access (medium_access.py has the rules)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AccessRules:
    """Numbers of the rules; `for_cycle` scales them to the time that one packet takes."""

    tries: int  # of one packet
    retransmits: int  # by the chip itself, in each try
    retransmit_delays: tuple[int, int]  # settings of ARD, from..to; a random one for each try
    tries_when_silent: int  # of one packet for a receiver that let the last one fail or is silent
    first_pause_s: float  # mean pause after the first try; doubles with each further one
    longest_pause_s: float  # mean pause, at most
    gap_s: float  # mean distance between two packets of one node
    train: int  # users' packets without a gap between them, at most
    train_retransmits: int  # by the chip, of a packet that follows another one in a train
    train_pause_s: float  # a train that was not heard for this time is over
    train_gap_s: float  # least time between two trains of one node, enough for an answer
    train_hold_s: float  # as train_pause_s, for a train whose sender announces its end
    most_yield_s: float  # longest wait for the end of others' trains
    most_hold_s: float  # as most_yield_s, if their end is announced
    broadcast_jitter_s: float  # a broadcast waits for a random part of this
    once_jitter_s: float  # and so does a challenge that is tried once
    answer_jitter_s: float  # so does any packet within this time after a broadcast was heard
    lifetime_s: float  # a packet that waited for this time is no longer useful
    still_there_s: float  # a node that was heard within this time counts as present
    perhaps_gone_s: float  # a node that was not heard within this time may be gone
    queue_length: int  # packets that may wait, in total
    data_queue_length: int  # of these: users' packets
    most_patience: float  # check periods without probes on a busy channel, at most
    busy_at: float  # share of failed first tries above which a channel counts as busy
    is_limited: bool = False  # whether the mesh limited the tries

    @classmethod
    def for_cycle(cls, cycle_s: float) -> AccessRules:
        """`cycle_s`: one packet and its acknowledgement, from the decision to listening again."""
        return cls(
            tries=9,
            retransmits=1,
            retransmit_delays=(2, 9),
            tries_when_silent=3,
            first_pause_s=5 * cycle_s,
            longest_pause_s=400 * cycle_s,
            gap_s=2 * cycle_s,
            train=110,
            train_retransmits=3,
            train_pause_s=1.1 * cycle_s,
            train_gap_s=1.9 * cycle_s,
            train_hold_s=30 * cycle_s,
            most_yield_s=100 * cycle_s,
            most_hold_s=200 * cycle_s,
            broadcast_jitter_s=60 * cycle_s,
            once_jitter_s=180 * cycle_s,
            answer_jitter_s=60 * cycle_s,
            lifetime_s=max(10.0, 3800 * cycle_s),
            still_there_s=max(5.0, 1900 * cycle_s),
            perhaps_gone_s=max(10.5, 4000 * cycle_s),
            queue_length=300,
            data_queue_length=120,
            most_patience=2.5,
            busy_at=0.3,
        )
