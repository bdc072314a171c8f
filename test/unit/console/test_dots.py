"""Packets on their way to one page."""

from __future__ import annotations

import json

from drone_mesh.console.dots import MOST_WAITING, Dot, PacketDots, RecordedDots
from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.history import History
from drone_mesh.console.orders import TimeLine
from drone_mesh.console.page import Page
from drone_mesh.state.model import MeshStatus, NodeStatus


def test_a_page_that_falls_behind_is_sent_the_newest_packets_and_the_number_of_all():
    dots = PacketDots()
    dots.wanted = True
    for number in range(3):
        dots.add(1000, [Dot(number, 200, 4, 0.0)] * (MOST_WAITING // 2))
    (text,) = dots.messages()
    message = json.loads(text)
    assert message["carried"] == 3000
    assert len(message["dots"]) == MOST_WAITING
    assert {dot[0] for dot in message["dots"]} == {1, 2}


def page_with_packets() -> Page:
    """A page that draws packets, of a run of ten seconds with a sample of packets each second."""
    history = History.of_run([MeshStatus(float(t), [NodeStatus(1)]) for t in range(10)], [])
    history.add_packets(RecordedDots.pack(t + 0.5, 7, [Dot(t, 2, 4, 0.1)]) for t in range(10))
    store = FrameStore()
    store.update_mesh(MeshStatus(9.0, [NodeStatus(1)]), 0.0)
    page = Page(None, store, history, is_live=True)
    page.packets.wanted = True
    return page


def packets_sent(page: Page, wall_s: float) -> list[dict]:
    messages = [json.loads(text) for text in page.messages(wall_s)]
    return [message for message in messages if message["type"] == "packets"]


def test_a_page_that_looks_at_the_past_is_sent_the_packets_of_that_time_and_not_the_present_ones():
    page = page_with_packets()
    page.show_packets(1, [Dot(100, 2, 4, 0.0)])
    page.move(TimeLine(do="time", t=2.0, factor=2.0))
    page.show_packets(1, [Dot(100, 2, 4, 0.0)])
    (message,) = packets_sent(page, 1.0)  # which plays from 2 s to 4 s
    assert message["carried"] == 14
    assert message["dots"] == [[2, 2, "heartbeat", 0.85], [3, 2, "heartbeat", 0.35]]
    page.move(TimeLine(do="time", live=True))
    assert packets_sent(page, 1.0) == []


def test_a_jump_in_time_shows_no_packets_of_the_time_between():
    page = page_with_packets()
    page.move(TimeLine(do="time", t=0.0))
    page.move(TimeLine(do="time", t=8.0, paused=True))
    assert packets_sent(page, 5.0) == []
