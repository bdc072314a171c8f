"""The numbers in docs/security.md are those of the code, and of the command that attacks."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from drone_mesh.communication import complaints, limits
from drone_mesh.communication.data import packets as data
from drone_mesh.communication.heartbeats import detours, swallowing
from drone_mesh.communication.repair import bid_credit
from drone_mesh.communication.seals import end_to_end, keys, message_seal, replay, seal
from drone_mesh.communication.seals import sealed_antenna as antenna
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.internet import guarded_app
from drone_mesh.lab.proofs import attacks, claims, damage

PAGE = (Path(__file__).resolve().parents[2] / "docs/security.md").read_text(encoding="utf-8")
TEXT = " ".join(PAGE.split())
CHECK_S = MeshTiming.check_period_s
TRIES_PER_YEAR = 500 * 365.25 * 86400
PAUSE_S = seal.CHALLENGE_AGAIN_S

WORDS = ("no", "one", "two", "three")

SENTENCES = [
    f"limited to three check periods ({antenna.FRESH_PERIODS * CHECK_S:.0f} s)",
    f"after {WORDS[bid_credit.WINNERS_WITHOUT_FLIGHT]} winners that do not fly",
    f"at most once in {complaints.COMPLAINT_PERIOD_S:g} s per kind",
    f"in {guarded_app.REFUSAL_LOG_PERIOD_S:g} s. In the simulation",
    f"makes a mesh key of {8 * keys.KEY_BYTES} random bits",
    f"(RFC 7693, `hashlib.blake2s`), {8 * keys.KEY_BYTES} bits each",
    f"BLAKE2s with {seal.TAG_BYTES} bytes of output over epoch (8 bytes), counter (4 bytes)",
    f"none that is more than {replay.WIDTH - 1} behind the highest",
    f"while more than {seal.WAITING_CHALLENGES // 2} challenges are pending",
    f"At most {seal.WAITING_CHALLENGES} challenges are pending, each for "
    f"{seal.CHALLENGE_OUT_S:g} s to {PAUSE_S:g} s, and a node challenges each neighbour at most "
    f"once in {PAUSE_S:g} s",
    f"at most {seal.WAITING_CHALLENGES / seal.CHALLENGE_OUT_S:g} challenges a second",
    f"claimed more than {seal.OVERTAKING} beyond it",
    f"then doubles, from {PAUSE_S:g} s to {PAUSE_S * 2**seal.DOUBTS:g} s, and all neighbours "
    f"together get at most {seal.MOST_DOUBTED} of them in {PAUSE_S:g} s",
    f"at most {seal.ANSWERS} of one neighbour and {seal.MOST_ANSWERS} of all in {PAUSE_S:g} s",
    f"remembers the last {seal.NONCES_KEPT} nonces",
    f"at most every {end_to_end.NEW_NONCE_AFTER_S:g} s",
    f"Its last {WORDS[end_to_end.NONCES]} nonces are valid",
    f"in the {message_seal.ACK_TAG_BYTES} bytes that are left",
    f"every {WORDS[int(swallowing.ASK_PERIODS)]} check periods",
    f"(at least {WORDS[swallowing.LEAST_UNANSWERED]}) bring no answer",
    f"that next hop for {'ten' if detours.SWALLOWER_AVOIDED_S == 600 else '?'} minutes",
    f"brings no answer for {'a minute' if detours.AVOIDED_S == 60 else '?'}",
    f"one stranger next to the gateway of {damage.NODES} nodes, {damage.SPACING_M:g} m apart",
    f"for invented ids, {damage.SHARED_NODES} nodes on the shared channel",
    f"Each attack takes {attacks.ATTACK_S:g} s (bids {attacks.BIDDING_S:g} s, relay that swallows "
    f"and jammed requests {attacks.SWALLOWING_S:g} s, far place {attacks.OUTAGE_S:g} s more, "
    f"nonces {len(claims.ORDERED)} orders of {claims.ORDER_PERIOD_S:g} s); seeds 0 to 11",
    f"{claims.FAR_AHEAD:,} counts ahead",
    f"*Packets in receivers' own names*: {claims.CLAIMS_PER_S} a second",
    f"*Nonces in drones' names*: {claims.CLAIMS_PER_S} a second at the gateway, while the owner "
    f"orders {len(claims.ORDERED)} drones away by {claims.ORDERED_M:g} m",
    f"*with numbers ahead* are {claims.AHEAD} ahead",
    f"more than {damage.LURED_M:g} m from their place, or more than {damage.OFF_ORDER_M:g} m from",
    f"| {limits.STRANGERS} losses in {limits.LIMIT_PERIOD_S:g} s; until the "
    f"{limits.LIMIT_PERIOD_S:g} s are over",
    f"| {limits.REPEATS} announcements in {limits.LIMIT_PERIOD_S:g} s;",
    f"| one in {detours.AVOIDED_S:g} s |",
    f"500 packets a second fill the channel at 250 kbit/s. An attacker that sends them for a year "
    f"makes {TRIES_PER_YEAR:.1e} attempts".replace("e+10", "e10"),
]


@pytest.mark.parametrize("sentence", SENTENCES)
def test_a_sentence_with_a_number_says_what_the_code_does(sentence):
    assert sentence in TEXT


FORGERIES = [
    ("a packet of one hop", 8 * seal.TAG_BYTES),
    ("an order", 8 * (seal.TAG_BYTES + end_to_end.ORDER_TAG_BYTES)),
    ("an order", 8 * end_to_end.ORDER_TAG_BYTES),
    ("a user's message", 8 * data.MESSAGE_TAG_BYTES),
    ("an acknowledgement of a user's message", 8 * message_seal.ACK_TAG_BYTES),
    ("a place, a report, a heartbeat of a gateway", 8 * end_to_end.TAG_BYTES),
]


@pytest.mark.parametrize(("what", "bits"), FORGERIES)
def test_the_mean_number_of_forgeries_follows_from_the_bits(what, bits):
    rows = [row for row in PAGE.split("\n") if row.startswith(f"| {what} |")]
    (row,) = [row for row in rows if f"| {bits} |" in row]
    mean = float(re.findall(r"[0-9.e-]+", row.split("|")[4])[0])
    assert mean == pytest.approx(TRIES_PER_YEAR / 2**bits, rel=0.1)


def rows() -> dict[str, list[str]]:
    lines = PAGE.split("\n")
    start = lines.index(damage.TABLE_HEAD[0])
    table = {}
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            return table
        name, *cells = (cell.strip() for cell in line.split("|")[1:-1])
        table[name] = cells
    return table


def test_the_table_has_a_row_of_the_command_for_each_attack():
    assert list(rows()) == list(attacks.ATTACKS)
    for name, cells in rows().items():
        recorded = attacks.ATTACKS[name] in attacks.RECORDING
        for threat, cell in zip(damage.Threat, cells):
            if threat is damage.Threat.CAPTURED and recorded:
                assert cell == ""
            else:
                assert re.fullmatch(r"\d+ %, later \d+ %(; \d+\.\d lured, \d+ m)?", cell), name


def test_the_page_counts_the_orders_that_claimed_nonces_silence():
    captured = rows()["nonces in drones' names"][-1]
    ordered, lost = len(claims.ORDERED), float(re.findall(r"([0-9.]+) lured", captured)[0])
    done = f"with {claims.CLAIMS_PER_S} claims a second {ordered - lost:.1f} of {ordered} orders"
    assert f"{done} are carried out" in TEXT


def test_what_the_threat_table_calls_prevented_does_no_harm_in_the_attack_table():
    """With a key an outsider lures nobody, and cuts off no more than the scenario itself."""
    for name, (none, _without, with_key, _captured) in rows().items():
        assert "lured" not in with_key, name
        quiet, attacked = (int(re.findall(r"\d+", cell)[0]) for cell in (none, with_key))
        assert attacked <= quiet + 5, name
