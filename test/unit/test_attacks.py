"""What strangers do to a mesh (docs/security.md, "Attacks")."""

from __future__ import annotations

import pytest
from proofs import damage
from proofs.attacks import ATTACKS, RECORDING
from proofs.command import main
from proofs.damage import (
    KEY,
    TABLE_HEAD,
    Case,
    Damage,
    Moment,
    Place,
    Threat,
    damage_row,
    harm,
    trial,
)
from proofs.fuzz import fuzz

# Tolerance where an attack must have no effect: the scenario alone has slightly different results
# when packets travel at other moments.
SLACK = 0.05


def outcome(name, threat):
    return trial(Case(name, threat), seed=0)


def cut_off_meanwhile(case, seed=0):
    """The same without the minute after the attack."""
    return trial(case, seed, recovery_s=0.0).cut_off


@pytest.mark.parametrize("name", ATTACKS)
def test_no_stranger_harms_a_mesh_with_a_key(name):
    damage = harm(Case(name, Threat.WITH_KEY), seed=0)
    assert damage.lured <= 0
    assert damage.cut_off <= SLACK
    assert damage.later <= 0.0


@pytest.mark.parametrize("name", ["forged order to the gateway", "forged orders to all"])
def test_without_a_key_a_stranger_cuts_most_nodes_off_and_sends_drones_kilometres_away(name):
    damage = trial(Case(name, Threat.WITHOUT_KEY), seed=0, recovery_s=0.0)
    assert damage.cut_off > 0.5
    assert damage.metres > 6000


def test_without_a_key_false_reports_of_a_missing_gateway_cut_nobody_off_for_long():
    """Each second the routers next to the stranger lose their routes, and find others at once."""
    assert cut_off_meanwhile(Case("MISSING storm", Threat.WITHOUT_KEY)) < 0.05


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
    damage = harm(Case(name, Threat.CAPTURED), seed=0, recovery_s=0.0)
    assert damage.lured <= 0
    assert damage.cut_off <= SLACK


@pytest.mark.parametrize(
    ("threat", "place"),
    [*((Threat.WITHOUT_KEY, place) for place in Place), (Threat.CAPTURED, Place.MIDDLE)],
)
def test_beacons_of_a_black_hole_draw_nobody_who_knows_places(threat, place):
    """In the middle of the mesh half of it was cut off, while hops were believed."""
    case = Case("beacons of a black hole", threat, place)
    assert cut_off_meanwhile(case, seed=1) <= SLACK


@pytest.mark.parametrize("moment", [Moment.FAILURE, Moment.FLIGHT, Moment.RESTART])
def test_a_captured_node_that_draws_who_lost_its_way_is_soon_found_out(moment):
    """A third to two thirds were cut off while nobody asked whether the gateway answers."""
    case = Case("beacons of a black hole", Threat.CAPTURED, Place.MIDDLE, moment)
    assert cut_off_meanwhile(case) < 0.25


def test_a_node_that_promises_a_beacon_and_falls_silent_is_soon_forgotten():
    case = Case("a beacon, then silence", Threat.WITHOUT_KEY, Place.MIDDLE)
    assert cut_off_meanwhile(case, seed=1) <= SLACK


@pytest.mark.parametrize("threat", [Threat.WITHOUT_KEY, Threat.CAPTURED])
@pytest.mark.parametrize("name", ["wormhole", "replayed beacons"])
def test_beacons_that_are_played_far_from_their_sender_draw_nobody_who_knows_places(name, threat):
    """Two thirds were cut off while hops were believed."""
    assert cut_off_meanwhile(Case(name, threat)) <= SLACK


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


def test_in_a_mesh_with_a_key_only_the_gateway_itself_says_that_it_has_no_internet():
    """A captured node kept 86 % of the mesh unconnected while nothing proved it."""
    name = "resignations in the gateway's name"
    assert cut_off_meanwhile(Case(name, Threat.WITHOUT_KEY)) > 0.5
    assert cut_off_meanwhile(Case(name, Threat.CAPTURED)) < 0.15


@pytest.mark.parametrize("name", ["bids of 1e9", "bids of 100 m"])
def test_the_bids_of_a_captured_node_delay_a_repair_and_do_not_prevent_it(name):
    attacked = outcome(name, Threat.CAPTURED)
    assert attacked.cut_off < 0.5
    assert attacked.later == 0.0


def test_the_table_has_a_cell_for_each_case(monkeypatch):
    monkeypatch.setattr(damage, "worst", Case)  # beside the gateway, at rest
    name = "order replayed after 1 s"
    assert ATTACKS[name] in RECORDING
    row = damage_row(name, runs=1)
    assert TABLE_HEAD[0] == "| attack | without key | with key | captured node |"
    cells = [cell.strip() for cell in row.split("|")[1:-1]]
    assert cells == [name, "0 %, later 0 %", "0 %, later 0 %", ""]


def damage_of(case, seed, mute=False, recovery_s=0.0):
    """Damage that depends on place and moment together, and of the time without an attack."""
    if mute:
        return Damage(0.1 if case.moment is Moment.FAILURE else 0.0, 0.0, 0, 0.0)
    share = {Place.LEFT: 0.3, Place.FRONT: 0.2}.get(case.place, 0.1)
    if case.moment is Moment.FAILURE:
        share = 0.35
    if case.moment is Moment.FLIGHT:
        share = 0.7 if case.place is Place.FRONT else 0.4
    return Damage(share + 0.1 * seed, 0.0, 0, 0.0)


def test_an_attack_is_searched_for_its_worst_place_and_moment(monkeypatch):
    """At rest left is worst; there a flight is, for which the front is worse; a failure costs
    a tenth without an attack, too."""
    monkeypatch.setattr(damage, "trial", damage_of)
    worst = damage.worst("false gateway", Threat.WITH_KEY)
    assert worst == Case("false gateway", Threat.WITH_KEY, Place.FRONT, Moment.FLIGHT)
    cell = "75 %, later 0 % (front, flight)"  # the mean of two seeds
    assert damage_row("false gateway", runs=2) == f"| false gateway | {cell} | {cell} | {cell} |"


@pytest.mark.parametrize(
    ("name", "lured", "cut_off", "worst"),
    [
        ("false gateway", 5, 0.21, Place.FRONT),  # 5 of 25 drones
        ("false gateway", 5, 0.19, Place.LEFT),
        ("frames in neighbours' names", 2, 0.23, Place.FRONT),  # 2 of 9
        ("frames in neighbours' names", 2, 0.21, Place.LEFT),
        ("bids of 1e9", 1, 0.26, Place.FRONT),  # 1 of 4
        ("bids of 1e9", 1, 0.24, Place.LEFT),
    ],
)
def test_a_lured_drone_weighs_as_much_as_one_that_is_cut_off(
    monkeypatch, name, lured, cut_off, worst
):
    harmed = {Place.LEFT: Damage(0.0, 0.0, lured, 5.0), Place.FRONT: Damage(cut_off, 0.0, 0, 0.0)}
    nothing = Damage(0.0, 0.0, 0, 0.0)

    def trial(case, seed, mute=False, recovery_s=0.0):
        return nothing if mute else harmed.get(case.place, nothing)

    monkeypatch.setattr(damage, "trial", trial)
    assert damage.worst(name, Threat.WITHOUT_KEY).place is worst


@pytest.mark.parametrize("moment", Moment)
def test_an_attack_can_begin_at_each_moment(moment):
    """A recorded order does not come true again in a mesh with a key, whenever it was given."""
    case = Case("order replayed after a restart", Threat.WITH_KEY, Place.MIDDLE, moment)
    assert trial(case, seed=0, recovery_s=0.0).lured == 0


def test_an_unknown_attack_is_an_error_in_one_line(capsys):
    assert main(["attack", "tickling"]) == 1
    assert "unknown attack 'tickling': use one of forged order" in capsys.readouterr().err


@pytest.mark.parametrize("key", [None, KEY], ids=["without key", "with key"])
def test_no_mutated_packet_stops_a_node(key):
    result = fuzz(10_000, seed=1, key=key)
    if key is not None:
        assert (result.moved, result.connected) == (0, 5)
