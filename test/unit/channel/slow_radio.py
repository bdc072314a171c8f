"""A radio that is no nRF24L01+: 100 ms for a packet and its acknowledgement, on one channel.

It shows what CONTRIBUTING.md, "Add a radio", asks of a radio, and stands for what LoRa is like.
"""

from __future__ import annotations

import math

from drone_mesh.channel.access_rules import AccessRules
from drone_mesh.channel.antenna import PacketAntenna
from drone_mesh.channel.medium_access import MediumAccess
from drone_mesh.channel.radio import Try
from drone_mesh.channel.statistics import RadioStatistics
from drone_mesh.communication.timing import Medium
from drone_mesh.inprocess.clock import TaskClock
from drone_mesh.inprocess.interfaces import IInProcessAir, IInProcessAntenna

HOP_S = 0.1
FRAME_S = {"packet": 0.06, "answer": 0.03}  # the rest of a hop is turning round
RANGE_M = 9.0


class Frame:
    def __init__(self, sender, start_s, end_s):
        self.sender, self.start_s, self.end_s = sender, start_s, end_s

    def overlaps(self, other):
        return self.start_s < other.end_s and other.start_s < self.end_s


class Arrived:
    def __init__(self, payload, to_all):
        self.payload, self.to_all = payload, to_all


class SlowRadio:
    """A PacketRadio: hears nothing while it sends, and overlapping frames are lost."""

    working = True

    def __init__(self, air, host, rng):
        self.node_id, self.drone = host.node_id, host.drone
        self.medium = Medium.for_hop(HOP_S)
        self.access = MediumAccess(AccessRules.for_cycle(HOP_S), rng)
        self.listening = False
        self._air = air
        self._clock = air.clock.tasks
        self._inbox = []
        self._news = self._clock.signal()
        self._taken = {}  # by sender: its last packet to this node alone
        self._statistics = RadioStatistics()

    def begin(self):
        self.listening = True

    def power_down(self):
        self.listening = False

    close = power_down

    def try_once(self, node_id, payload, again, retransmits, delay, following):
        done = self._exchange(node_id, payload, again)
        while done:
            payload = following(1)
            if payload is None:
                return Try(True, 1)
            done = self._exchange(node_id, payload, again=False)
        return Try(False, 1)

    def drop(self):
        """Nothing is kept for another try."""

    def broadcast(self, payload):
        for other in self._send("packet"):
            other.take(self.node_id, payload, to_all=True)
        return self.listening

    def hears_power(self):
        return None  # it cannot measure

    def receive(self, timeout_s):
        self._news.wait_for(lambda: bool(self._inbox), timeout_s)
        arrived, self._inbox = self._inbox, []
        return arrived

    def statistics(self):
        return self._statistics

    def take(self, sender, payload, to_all, again=False):
        if to_all or not again or self._taken.get(sender) != payload:
            self._inbox.append(Arrived(payload, to_all))
            self._news.notify()
        if not to_all:
            self._taken[sender] = payload

    def _exchange(self, node_id, payload, again):
        receiver = next((r for r in self._send("packet") if r.node_id == node_id), None)
        if receiver is not None:
            receiver.take(self.node_id, payload, to_all=False, again=again)
            answered = self in receiver._send("answer")
        else:
            self._clock.sleep(FRAME_S["answer"])
            answered = False
        self._clock.sleep(HOP_S - sum(FRAME_S.values()))
        return answered

    def _send(self, kind):
        """Send a frame; returns the radios that received it."""
        if not self.listening:
            return []
        start_s = self._clock.now_s()
        frame = Frame(self, start_s, start_s + FRAME_S[kind])
        self._air.frames.append(frame)
        self._statistics.airtime_s += FRAME_S[kind]
        self._clock.sleep(FRAME_S[kind])
        return self._air.receivers(frame)


class SlowAntenna(PacketAntenna, IInProcessAntenna):
    """Nothing to add: PacketAntenna does all."""


class SlowAir(IInProcessAir):
    """All slow radios of a network; to be passed to Network as its radio."""

    max_distance_m = RANGE_M

    def __init__(self):
        self.clock = TaskClock()
        self.frames = []
        self.radios = {}
        self.antennas = {}

    @property
    def delivered(self):
        return 0

    def antenna(self, host, rng):
        radio = self.radios[host.node_id] = SlowRadio(self, host, rng)
        antenna = SlowAntenna(radio, host.submit, runtime=self.clock.tasks)
        self.antennas[host.node_id] = antenna
        return antenna

    def run(self, function):
        self.clock.tasks.start(function, "node")

    def in_range(self, node):
        return {n: a for n, a in self.antennas.items() if n != node and self._near(node, n)}

    def flight(self, node, started):
        """Places are looked up for each frame."""

    def moved(self, nodes):
        """Places are looked up for each frame."""

    def receivers(self, frame):
        """The radios that heard this frame, and nothing else at the same time."""
        others = [f for f in self.frames if f is not frame and f.overlaps(frame)]
        self.frames = [f for f in self.frames if f.end_s > frame.start_s - 1.0]
        return [
            radio
            for radio in self.radios.values()
            if radio is not frame.sender
            and radio.listening
            and self._near(frame.sender.node_id, radio.node_id)
            and not any(
                f.sender is radio or self._near(f.sender.node_id, radio.node_id) for f in others
            )
        ]

    def _near(self, one, other):
        here, there = (self.radios[n].drone.get_location() for n in (one, other))
        return math.dist(here, there) < RANGE_M
