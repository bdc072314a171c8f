"""What strangers do to a mesh (docs/security.md, "Attacks")."""

from __future__ import annotations

import functools

import pytest
from proofs import damage
from proofs.attacks import ATTACKS, RECORDING
from proofs.command import main
from proofs.damage import (
    KEY,
    PLACES,
    TABLE_HEAD,
    Threat,
    damage_row,
    trial,
)
from proofs.fuzz import fuzz

# Tolerance where an attack must have no effect: the scenario alone has slightly different results
# when packets travel at other moments.
SLACK = 0.05
MIDDLE = PLACES.index((0.5, 0.5))


@functools.lru_cache(maxsize=None)  # several tests look at the same one
def outcome(name, threat):
    return trial(name, threat, seed=0)


def quiet(name, attacked):
    """The same scenario without an attack, made only where it can matter."""
    if attacked.cut_off <= SLACK and attacked.later == 0.0:
        return attacked  # no worse than whatever happens without one
    return outcome(name, Threat.NONE)


@pytest.mark.parametrize("name", ATTACKS)
def test_no_stranger_harms_a_mesh_with_a_key(name):
    attacked = outcome(name, Threat.WITH_KEY)
    assert attacked.lured == 0
    assert attacked.cut_off <= quiet(name, attacked).cut_off + SLACK
    assert attacked.later <= quiet(name, attacked).later


@pytest.mark.parametrize("name", ["forged order to the gateway", "forged orders to all"])
def test_without_a_key_one_stranger_cuts_most_nodes_off(name):
    assert outcome(name, Threat.WITHOUT_KEY).cut_off > 0.5


def test_without_a_key_false_reports_of_a_missing_gateway_cut_nobody_off_for_long():
    """Each second the routers next to the stranger lose their routes, and find others at once."""
    assert outcome("MISSING storm", Threat.WITHOUT_KEY).cut_off < 0.05


@pytest.mark.parametrize("name", ["forged order to the gateway", "forged orders to all"])
def test_without_a_key_a_stranger_sends_drones_kilometres_away(name):
    assert outcome(name, Threat.WITHOUT_KEY).metres > 6000


@pytest.mark.parametrize(
    "name",
    [
        "forged order to the gateway",
        "forged orders to all",
        "false gateway",
        "MISSING storm",
        "far place and an outage",
        "requests for places jammed",
        "black hole",
        "beacons of a black hole",
        "beacons with numbers ahead",
    ],
)
def test_a_captured_node_neither_orders_nor_lures_nor_cuts_off(name):
    attacked = outcome(name, Threat.CAPTURED)
    assert attacked.lured == 0
    assert attacked.cut_off <= quiet(name, attacked).cut_off + SLACK


@pytest.mark.parametrize(
    ("threat", "place"),
    [*((Threat.WITHOUT_KEY, n) for n in range(len(PLACES))), (Threat.CAPTURED, MIDDLE)],
)
def test_beacons_of_a_black_hole_draw_nobody_who_knows_places(threat, place):
    """In the middle of the mesh half of it was cut off, while hops were believed."""
    assert trial("beacons of a black hole", threat, seed=1, place=place).cut_off <= SLACK


def test_a_node_that_promises_a_beacon_and_falls_silent_is_soon_forgotten():
    attacked = trial("a beacon, then silence", Threat.WITHOUT_KEY, seed=1, place=MIDDLE)
    assert attacked.cut_off <= SLACK


@pytest.mark.parametrize("threat", [Threat.WITHOUT_KEY, Threat.CAPTURED])
@pytest.mark.parametrize("name", ["wormhole", "replayed beacons"])
def test_beacons_that_are_played_far_from_their_sender_draw_nobody_who_knows_places(name, threat):
    """Two thirds were cut off while hops were believed."""
    assert outcome(name, threat).cut_off <= SLACK


@pytest.mark.parametrize("name", ["beacons that list all drones", "beacons that hear all drones"])
def test_a_captured_node_that_claims_all_drones_is_soon_believed_by_nobody(name):
    """Three quarters of the packets went to it while of several claims the newest counted."""
    attacked = outcome(name, Threat.CAPTURED)
    assert attacked.cut_off < 0.25
    assert attacked.later == 0.0
    assert attacked.lured == 0  # of the drones that were ordered meanwhile all fly


def test_a_relay_that_forwards_heartbeats_only_is_avoided_in_a_mesh_with_a_key():
    name = "relay that swallows"
    assert outcome(name, Threat.WITHOUT_KEY).later > 0.3
    captured = outcome(name, Threat.CAPTURED)
    assert captured.cut_off < 0.15
    assert captured.later == 0.0


@pytest.mark.parametrize("name", ["bids of 1e9", "bids of 100 m"])
def test_the_bids_of_a_captured_node_delay_a_repair_and_do_not_prevent_it(name):
    attacked = outcome(name, Threat.CAPTURED)
    assert attacked.cut_off < 0.5
    assert attacked.later == 0.0


def test_the_table_has_a_cell_for_each_case():
    name = "order replayed after 1 s"
    assert ATTACKS[name] in RECORDING
    row = damage_row(name, runs=1)
    assert TABLE_HEAD[0] == "| attack | no attack | without key | with key | captured node |"
    cells = [cell.strip() for cell in row.split("|")[1:-1]]
    assert cells[0] == name
    assert all("later 0 %" in cell for cell in cells[1:4])
    assert cells[4] == ""


@pytest.mark.parametrize(
    ("name", "threat", "place"),
    [
        ("false gateway", Threat.WITHOUT_KEY, 3),
        ("black hole", Threat.CAPTURED, 3),
        ("false gateway", Threat.WITH_KEY, 3),
        ("false gateway", Threat.NONE, 0),
        ("order replayed after 1 s", Threat.WITHOUT_KEY, 0),
        ("bids of 1e9", Threat.CAPTURED, 0),
    ],
)
def test_an_attack_is_made_where_it_does_most(name, threat, place, monkeypatch):
    shares = (0.1, 0.4, 0.2, 0.7, 0.3)
    trials = lambda _name, _threat, _seed, at: damage.Damage(shares[at], 0.0, 0, 0.0)  # noqa: E731
    monkeypatch.setattr(damage, "trial", trials)
    assert damage.worst_place(name, threat) == place


def test_an_unknown_attack_is_an_error_in_one_line(capsys):
    assert main(["attack", "tickling"]) == 1
    assert "unknown attack 'tickling': use one of forged order" in capsys.readouterr().err


@pytest.mark.parametrize("key", [None, KEY], ids=["without key", "with key"])
def test_no_mutated_packet_stops_a_node(key):
    result = fuzz(10_000, seed=1, key=key)
    if key is not None:
        assert (result.moved, result.connected) == (0, 5)
