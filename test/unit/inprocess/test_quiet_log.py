"""No line in the log of a mesh in which nothing is wrong."""

from __future__ import annotations

import itertools
import logging
from types import SimpleNamespace

import pytest
from proofs import quiet
from proofs.quiet import CASES, LAYOUTS, RADIOS, TECHNIQUES, Run, runs, warnings_of
from proofs.stranger import RecordedPacket

from drone_mesh.communication.events.observer import MeshEvent, MeshEventKind
from drone_mesh.formations.layouts import GRID_CASE

KINDS = [*itertools.product(RADIOS, TECHNIQUES, [False, True])]
LARGE = [case for case in CASES if len(LAYOUTS.orders(case)) > 1 and case != GRID_CASE]
SMALL = [case for case in CASES if len(LAYOUTS.orders(case)) == 1]


@pytest.mark.parametrize(("radio", "routing", "has_key"), KINDS)
def test_the_default_run_has_a_quiet_log(radio, routing, has_key):
    assert warnings_of(Run(0, radio, routing, has_key, seed=2)) == []


@pytest.mark.parametrize(
    ("seed", "what"),
    [
        (5, "a relay gives up an order that its drone has taken"),
        (6, "an order that waited until its nonce had expired is not forged"),
        (8, "answers to challenges wait in a queue while the mesh starts"),
        (9, "the gateway answers along an old way"),
        (11, "challenges that nobody took say nothing about a key"),
        (13, "the only reply is lost, and the drone is heard again half a minute later"),
        (15, "a challenge by broadcast, which its neighbour does not hear"),
        (26, "the only reply is lost, and the drone is in flight when a try is due"),
    ],
)
def test_no_wrong_suspicion_on_a_busy_channel_with_a_key(seed, what):
    assert warnings_of(Run(0, "shared", "child_table_tree", True, seed)) == [], what


@pytest.mark.slow
@pytest.mark.parametrize(
    ("layout", "kind"),
    [
        *itertools.product(LARGE, KINDS),
        *zip(SMALL, itertools.cycle(KINDS)),  # each moves one drone: `scripts/proofs` has them all
    ],
)
def test_every_layout_has_a_quiet_log(layout, kind):
    assert warnings_of(Run(layout, *kind, seed=0)) == []


def test_what_a_node_warns_of_is_counted_unless_it_is_true_of_an_order(monkeypatch):
    logger = logging.getLogger("drone_mesh.communication")
    lines = [f"node 0: an order for drone {drone} failed: no route" for drone in (8, 80)]

    def fly_to(_run):
        for line in [*lines, "node 7"]:
            logger.warning(line)
        return ("node 0: an order for drone 8 failed",)

    monkeypatch.setattr(quiet, "_fly_to", fly_to)
    assert warnings_of(Run(0, "disc", "beacon", False, seed=7)) == [lines[1], "node 7"]


ORDERED, NO_ROUTE, LOST = (
    MeshEvent(kind, node, at_s, peer)
    for kind, node, at_s, peer in (
        (MeshEventKind.FLIGHT_ORDERED, 8, 1.0, 0),
        (MeshEventKind.NO_ROUTE, 0, 2.0, 8),
        (MeshEventKind.ORDER_LOST_CONTACT, 0, 60.0, 8),
    )
)
REPLY = bytes.fromhex("08 05 40 00 00 01 00 01").ljust(32, bytes(1))


@pytest.mark.parametrize(
    ("events", "replied_s", "truths"),
    [
        ([NO_ROUTE], (), ["8 failed"]),
        ([NO_ROUTE, ORDERED], (), []),
        ([ORDERED, LOST], (), ["8 has an unknown outcome"]),
        ([ORDERED, LOST], (61.0,), ["8 has an unknown outcome"]),
        ([ORDERED, LOST], (30.0, 61.0), []),
    ],
)
def test_what_is_true_of_an_order_is_seen_from_outside(events, replied_s, truths):
    heard = [RecordedPacket(at_s, 0, REPLY) for at_s in replied_s]
    assert [*quiet._in_vain(SimpleNamespace(events=events), heard)] == truths


def test_the_command_has_all_layouts_radios_and_techniques_with_and_without_a_key():
    first = [run for run in runs(2) if run.seed == 0]
    assert len(set(first)) == len(CASES) * len(RADIOS) * len(TECHNIQUES) * 2
