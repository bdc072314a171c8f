"""Packets on their way to one page."""

from __future__ import annotations

import json

from drone_mesh.console.dots import MOST_WAITING, Dot, PacketDots


def test_a_page_that_falls_behind_is_sent_the_newest_packets_and_the_number_of_all():
    dots = PacketDots()
    dots.wanted = True
    for number in range(3):
        dots.add(1000, [Dot(number, 200, 4, 0.0)] * (MOST_WAITING // 2))
    (text,) = dots.messages(is_live=True)
    message = json.loads(text)
    assert message["carried"] == 3000
    assert len(message["dots"]) == MOST_WAITING
    assert {dot[0] for dot in message["dots"]} == {1, 2}


def test_packets_of_the_present_are_not_kept_for_a_page_that_looks_at_the_past():
    dots = PacketDots()
    dots.wanted = True
    dots.add(1, [Dot(1, 2, 4, 0.0)])
    assert list(dots.messages(is_live=False)) == []
    assert list(dots.messages(is_live=True)) == []
