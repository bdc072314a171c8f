"""Sender: the queue of one radio, and the task that sends it by the rules of access."""

from __future__ import annotations

from typing import Callable

from drone_mesh.channel.medium_access import Fate
from drone_mesh.channel.packet_queue import ALL_NODES, OutgoingPacket
from drone_mesh.channel.radio import PacketRadio, Try
from drone_mesh.channel.runtime import Runtime, Task
from drone_mesh.channel.trains import InTrain
from drone_mesh.communication.wire.packet_types import Priority


class Sender:
    """Sends queued packets, to several receivers at once.

    Threads: `start` starts one that sends. Any thread may call the other methods; none of them
    waits for the radio. A lock guards the queue, and is never held during a send.
    """

    def __init__(
        self,
        radio: PacketRadio,
        runtime: Runtime,
        on_delivered: Callable[[bytes, int], None],
        on_given_up: Callable[[bytes, int], None],
    ) -> None:
        """Both get a packet in the sending thread, with the number of frames it took."""
        self._radio = radio
        self._access = radio.access
        self._runtime = runtime
        self._on_delivered = on_delivered
        self._on_given_up = on_given_up
        self._lock = runtime.lock()
        self._news = runtime.signal()
        self._has_news = False
        self._closed = False
        self._task: Task | None = None

    def start(self) -> None:
        self._closed = False
        self._task = self._runtime.start(self._run, f"sender {self._radio.node_id}")

    def stop(self) -> None:
        """Give up waiting packets, without a report, and end the thread."""
        self._closed = True
        self.clear()
        task, self._task = self._task, None
        if task is not None:
            task.join()

    def offer(
        self,
        receiver: int,
        payload: bytes,
        priority: Priority = Priority.CONTROL,
        jittered: bool = True,
        once: bool = False,
    ) -> bool:
        """Queue a packet for a node or ALL_NODES. False: the queue is full or closed."""
        if self._closed:
            return False
        with self._lock:
            taken = self._access.offer(
                receiver, payload, self._runtime.now_s(), priority, jittered, once
            )
        self._wake()
        return taken

    def limit_tries(self, most: int) -> None:
        """See MediumAccess."""
        with self._lock:
            self._access.limit_tries(most)

    def data_room(self) -> int:
        """The number of packets of priority DATA that it would accept now."""
        with self._lock:
            return self._access.data_room()

    def heard(self, sender: int, *, broadcast: Priority | None, train: InTrain) -> None:
        """A packet of that node came in."""
        with self._lock:
            self._access.heard(sender, self._runtime.now_s(), broadcast=broadcast, train=train)

    def clear(self) -> None:
        """Give up waiting packets, without a report."""
        with self._lock:
            self._access.clear()
        self._wake()

    @property
    def patience(self) -> float:
        """See MediumAccess."""
        return self._access.patience

    def _wake(self) -> None:
        self._has_news = True
        self._news.notify()

    def _run(self) -> None:
        while not self._closed:
            with self._lock:
                now_s = self._runtime.now_s()
                packet = self._access.due(now_s)
                wait_s = self._access.next_try_s - now_s
                self._has_news = False
            if packet is None:
                self._news.wait_for(lambda: self._has_news or self._closed, wait_s)
            else:
                self._try(packet)

    def _try(self, packet: OutgoingPacket) -> None:
        radio, access = self._radio, self._access
        if packet.receiver == ALL_NODES:
            outcome = Try(radio.broadcast(packet.payload), 1)
        else:
            retransmits, delay = access.retransmits()

            def following(frames: int) -> bytes | None:
                """The packet was delivered: return the next payload of its train."""
                nonlocal packet
                with self._lock:
                    now_s = self._runtime.now_s()
                    more = access.following(packet, now_s)
                    if more is None:
                        return None
                    packet.frames += frames
                    fate = access.tried(packet, True, now_s)
                self._settle(packet, fate)
                packet = more
                return more.payload

            outcome = radio.try_once(
                packet.receiver, packet.payload, packet.tries > 0, retransmits, delay, following
            )
        with self._lock:
            packet.frames += outcome.frames
            fate = access.tried(packet, outcome.acknowledged, self._runtime.now_s())
        self._settle(packet, fate)

    def _settle(self, packet: OutgoingPacket, fate: Fate) -> None:
        """Report the outcome of a packet."""
        if fate is Fate.GIVEN_UP:
            self._radio.drop()
            if not self._closed:
                self._on_given_up(packet.payload, packet.frames)
        elif fate is Fate.DELIVERED and packet.receiver != ALL_NODES and not self._closed:
            self._on_delivered(packet.payload, packet.frames)
