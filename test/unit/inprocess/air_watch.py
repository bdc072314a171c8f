"""Counts, at the air, how often each packet is forwarded."""

from __future__ import annotations

from collections import defaultdict

from drone_mesh.communication.interfaces import BROADCAST

EPISODE_S = 1.0  # the same packet again after such a silence is another one


class AirWatch:
    """Watches the air of a network from now on.

    A packet is known by what does not change on its way: creator, type, final addressee, body (but
    for the hops of a heartbeat). One that is made again while it is still on its way counts as made
    twice.
    """

    def __init__(self, network):
        self._clock = network.clock
        self._episodes = defaultdict(list)  # identity -> [last heard at, made, sent on]
        self._sent_on = defaultdict(list)  # type -> [(from, to)]
        network.air.carries = self._look

    def _look(self, payload):
        """Let every packet pass."""
        if payload[4] != BROADCAST:
            hops_free = payload[:7] + payload[8:] if payload[2] == 4 else payload
            identity = hops_free[:1] + hops_free[2:3] + hops_free[4:]
            episodes = self._episodes[identity]
            now_s = self._clock.now_s
            if not episodes or now_s - episodes[-1][0] > EPISODE_S:
                episodes.append([now_s, 0, 0])
            episode = episodes[-1]
            episode[0] = now_s
            if payload[0] == payload[1]:
                episode[1] += 1
            else:
                episode[2] += 1
                self._sent_on[payload[2]].append((payload[1], payload[3]))
        return True

    def sent_on(self, kind):
        """(from, to) of each time that another node forwarded a packet of this type."""
        return self._sent_on[kind]

    def most_often_sent_on(self):
        """How often the packet that was forwarded most often was forwarded."""
        return max(
            (
                sent_on / max(1, made)
                for episodes in self._episodes.values()
                for _, made, sent_on in episodes
            ),
            default=0.0,
        )
