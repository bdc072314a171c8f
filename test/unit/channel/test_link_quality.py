"""How well packets reach a neighbour, from what became of them."""

from __future__ import annotations

import pytest

from drone_mesh.channel.statistics import LinkQuality


def test_the_first_packet_is_all_that_is_known():
    links = LinkQuality()
    links.packet(3, 4, delivered=True)
    assert links.figures == {3: (4.0, 1.0)}


def test_the_latest_packets_count_most_and_each_neighbour_by_itself():
    links = LinkQuality()
    for _ in range(100):
        links.packet(3, 1, delivered=True)
        links.packet(4, 9, delivered=False)
    assert links.figures[3] == (1.0, 1.0)
    links.packet(3, 9, delivered=False)
    assert links.figures[3] == pytest.approx((1.8, 0.9))
    assert links.figures[4] == pytest.approx((9.0, 0.0))


def test_figures_that_were_read_do_not_change():
    links = LinkQuality()
    links.packet(3, 1, delivered=True)
    read = links.figures
    links.packet(3, 2, delivered=True)
    links.packet(4, 2, delivered=True)
    assert read == {3: (1.0, 1.0)}
