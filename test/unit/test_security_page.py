"""The numbers in docs/security.md are those of the code, and of the command that attacks."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from proofs import attacks, claims, damage

from drone_mesh.channel.access_rules import AccessRules
from drone_mesh.communication.beacon.connection import AGAIN_S, NEW_S, PERIOD_S
from drone_mesh.communication.beacon.disputes import REMEMBERED_S
from drone_mesh.communication.beacon.times import JITTER
from drone_mesh.communication.beacon.verdicts import SUSPECTED_S
from drone_mesh.communication.beacon.way_up import IN_VAIN, PARDONED, STALE
from drone_mesh.communication.beacon.way_up import REMEMBERED_S as ASKED_S
from drone_mesh.communication.data import packets as data
from drone_mesh.communication.events import complaints
from drone_mesh.communication.heartbeats import detours, node_search
from drone_mesh.communication.interfaces import BROADCAST, MAX_NODE_ID, PAYLOAD_BYTES
from drone_mesh.communication.repair import election
from drone_mesh.communication.seals import end_to_end, keys, message_seal, replay, seal
from drone_mesh.communication.seals import sealed_antenna as antenna
from drone_mesh.communication.timing import LIMIT_PERIOD_S, QUEUED, REPEATS, STRANGERS, MeshTiming
from drone_mesh.communication.wire.messages import TO_AT
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.internet import guarded_app

PAGE = (Path(__file__).resolve().parents[2] / "docs/security.md").read_text(encoding="utf-8")
TEXT = " ".join(PAGE.split())
CHECK_S = MeshTiming.check_period_s
TRIES_PER_YEAR = 500 * 365.25 * 86400
PAUSE_S = seal.CHALLENGE_AGAIN_S

WORDS = ("no", "one", "two", "three")

SENTENCES = [
    f"came for six check periods ({antenna.FRESH_PERIODS * CHECK_S:.0f} s) nor "
    f"{2 * replay.LATELY_S:g} s after a later one",
    f"after {WORDS[election.WINNERS_WITHOUT_FLIGHT]} winners that do not fly",
    f"at most once in {complaints.COMPLAINT_PERIOD_S:g} s per kind",
    f"in {guarded_app.REFUSAL_LOG_PERIOD_S:g} s. In the simulation",
    f"makes a mesh key of {8 * keys.KEY_BYTES} random bits",
    f"(RFC 7693, `hashlib.blake2s`), {8 * keys.KEY_BYTES} bits each",
    f"BLAKE2s with {seal.TAG_BYTES} bytes of output over epoch (8 bytes), counter (4 bytes)",
    f"none that is more than {replay.WIDTH - 1} behind the highest, and none for which a higher "
    f"one came {replay.LATELY_S:g} to {2 * replay.LATELY_S:g} s ago",
    f"while more than {seal.WAITING_CHALLENGES // 2} challenges are pending",
    f"At most {seal.WAITING_CHALLENGES} challenges are pending, each for "
    f"{seal.CHALLENGE_OUT_S:g} s to {PAUSE_S:g} s, and a node challenges each neighbour at most "
    f"once in {PAUSE_S:g} s",
    f"at most {seal.WAITING_CHALLENGES / seal.CHALLENGE_OUT_S:g} challenges a second",
    f"claimed more than {seal.OVERTAKING} beyond it",
    f"then doubles, from {PAUSE_S:g} s to {PAUSE_S * 2**seal.DOUBTS:g} s, and all neighbours "
    f"together get at most {seal.MOST_DOUBTED} of them in {PAUSE_S:g} s",
    f"the last {'four' if antenna.REPEATED == 4 else '?'} packets that it sent "
    f"to the challenger within {antenna.REPEATED_S:g} s",
    f"at most {seal.ANSWERS} of one neighbour and {seal.MOST_ANSWERS} of all in {PAUSE_S:g} s",
    f"remembers the last {seal.NONCES_KEPT} nonces",
    f"at most every {end_to_end.NEW_NONCE_AFTER_S:g} s, or {end_to_end.UNUSED_NONCE_S:g} s while",
    f"Its last {WORDS[end_to_end.NONCES]} nonces are valid",
    f"(one of the {WORDS[end_to_end.EXPIRED]} before the last {WORDS[end_to_end.NONCES]})",
    f"in the {message_seal.ACK_TAG_BYTES} bytes that are left",
    f"every {WORDS[int(detours.ASK_PERIODS)]} check periods",
    f"(at least {WORDS[detours.LEAST_UNANSWERED]}, on a shared channel "
    f"{WORDS[detours.LEAST_OF_QUEUED]}) bring no answer",
    f"the last {WORDS[detours.LEAST_UNANSWERED]} ({WORDS[detours.LEAST_OF_QUEUED]}) by this relay",
    f"it waits up to {1 + AccessRules.for_cycle(0.0).most_patience:g} times as long",
    f"that next hop for {'ten' if detours.SWALLOWER_AVOIDED_S == 600 else '?'} minutes",
    f"brings no answer for {'a minute' if detours.AVOIDED_S == 60 else '?'}",
    f"one stranger into a mesh of {damage.NODES} nodes, {damage.SPACING_M:g} m apart",
    f"for invented ids, {damage.SHARED_NODES} nodes on the shared channel",
    f"Each attack takes {attacks.ATTACK_S:g} s (bids {attacks.BIDDING_S:g} s, relay that swallows "
    f"and jammed requests {attacks.SWALLOWING_S:g} s, far places {claims.OUTAGE_S:g} s more, "
    f"nonces {len(claims.ORDERED)} orders of {claims.ORDER_PERIOD_S:g} s), and",
    f"{claims.FAR_AHEAD:,} counts ahead",
    f"*Packets in receivers' own names*: {claims.CLAIMS_PER_S} a second",
    f"*Nonces in drones' names*: {claims.CLAIMS_PER_S} a second at the gateway, while the owner "
    f"orders {len(claims.ORDERED)} drones away by {claims.ORDERED_M:g} m",
    f"are {claims.ELSEWHERE.longitude * math.sqrt(2) / 1000:.1f} km away; "
    f"then the gateway is off for {claims.OUTAGE_S:g} s",
    f"A gateway draws one every {end_to_end.NEW_GATEWAY_NONCE_AFTER_S:g} s",
    f"and {claims.LIE_M:g} m nearer to it than it is; those *with numbers ahead* are "
    f"{claims.AHEAD} ahead",
    f"promises the next one in {claims.LONGEST_S:g} s, and none for {claims.SILENT_TURNS / 2:g} s",
    f"*Frames in neighbours' names*: {attacks.FRAMES_PER_S} a second",
    f"are {claims.MOST_AHEAD} ahead, the most that counts as newer",
    f"{'five' if len(damage.Place) == 5 else '?'} places, from beside the gateway to the far "
    f"corner, {damage.REST_S:g} s after the mesh has formed",
    f"then {'seven' if len(damage.Moment) == 7 else '?'} moments",
    f"Meanwhile the owner orders {len(claims.ORDERED)} drones away by {claims.ORDERED_M:g} m; "
    "lured",
    f"it on for {'five' if STALE == 5 else '?'} intervals, both claims are disputed for "
    f"{'a minute' if REMEMBERED_S == 60 else '?'}",
    f"a heartbeat within {AGAIN_S:g} s after it connects",
    f"again after {AGAIN_S:g} to {2 * AGAIN_S:g} s until the gateway",
    f"every {PERIOD_S * (1 - JITTER):g} to {PERIOD_S:g} s. With a new parent",
    f"has not answered within {'ten' if ASKED_S == 600 else '?'} minutes, the next one comes "
    f"within {AGAIN_S:g} s, or {NEW_S:g} to {NEW_S + AGAIN_S:g} s after the last one",
    f"at most {'eight' if IN_VAIN == 8 else '?'}, for {'ten' if ASKED_S == 600 else '?'} minutes "
    f"(on a shared channel from the {'third' if PARDONED == 2 else '?'} one on)",
    f"for {SUSPECTED_S:g} s, to neighbours that took a POLL in vain",
    f"more than {damage.LURED_M:g} m from their place, or more than {damage.OFF_ORDER_M:g} m from",
    f"| {STRANGERS} losses in {LIMIT_PERIOD_S:g} s; until the {LIMIT_PERIOD_S:g} s are over",
    f"| {REPEATS} announcements in {LIMIT_PERIOD_S:g} s;",
    f"| one in {detours.AVOIDED_S:g} s |",
    f"after {node_search.FIRST_PAUSE_S:g}, {2 * node_search.FIRST_PAUSE_S:g}, "
    f"{4 * node_search.FIRST_PAUSE_S:g} s and so on up to {node_search.LONGEST_PAUSE_S:g} s; "
    f"on a shared channel one in {QUEUED.search_pause_s:g} s. Each",
    f"bytes 0..{seal.SEAL_AT - 1}, under the key of the pair. Packets with forward {BROADCAST}",
    f"byte {TO_AT} counts as {BROADCAST}",
    f"random number of {seal._EPOCH_BITS} bits that a node draws at each start",
    f"SEAL_CHALLENGE ({MessageType.SEAL_CHALLENGE:d}): a nonce of {seal._NONCE_BITS // 8} bytes, "
    f"tag at {seal.TAG_AT}..{PAYLOAD_BYTES - 1} under the key of the pair, over all but "
    f"byte {TO_AT}. Byte {TO_AT + 1} is the challenged node",
    f"SEAL_ANSWER ({MessageType.SEAL_ANSWER:d}): the same nonce, epoch "
    f"({seal._EPOCH_BITS // 8} bytes), counter (4 bytes), tag at "
    f"{seal.TAG_AT}..{PAYLOAD_BYTES - 1}",
    f"random number of {8 * end_to_end._NONCE_BYTES} bits that a node announces",
    f"in bytes {end_to_end._NONCE_AT}..{end_to_end._NONCE_AT + 3}, under the key of the pair",
    f"one tag of {data.MESSAGE_TAG_BYTES} bytes behind the payload",
    f"Packets stay {PAYLOAD_BYTES} bytes long",
    f"Packets still have {PAYLOAD_BYTES} bytes",
    f"at most {MAX_NODE_ID} x {MAX_NODE_ID} per node",
    f"under {MAX_NODE_ID + 1} invented ids",
    f"| a key | one tag | {8 * keys.KEY_BYTES} | none | |",
    f"authentic ones that are at least {replay.LATELY_S:g} s older than others that were accepted",
    f"it takes three of them within {antenna.FORGOTTEN_S:g} s",
    f"has challenged it within {complaints.CHALLENGED_FOR_S:g} s",
    f"it counts for {seal.LATE_ANSWER_S:g} s, also after the next challenge",
    f"which acknowledges nothing, once in {seal.OWN_ID_AGAIN_S:g} s",
    f"until its next answer to a challenge within {seal.CHALLENGE_AGAIN_S:g} s",
    f"it came within {seal.CHALLENGE_AGAIN_S:g} s of the challenge",
    f"500 packets a second fill the channel at 250 kbit/s. An attacker that sends them for a year "
    f"makes {TRIES_PER_YEAR:.1e} attempts".replace("e+10", "e10"),
]


# Numbers without a constant in the code. Whoever changes one of them has measured it again with the
# command that the page names there, or it follows from the numbers beside it.
_MEASURED = """
The requests and answers are 0.8 % of the packets of 100 nodes on the disc (39,668 instead of
39,348 in 120 s), and 8 % of those of 25 nodes on a quiet shared channel (3,198 instead of
2,949)

is a random number of 16 bits after each restart

the expected number of such cases is 3e-5

it costs only 2 bytes per message more

256 messages earlier

each cell is the mean of seeds 0 to 2

Figures of 2026-11-29 (2cd620c9).

Of the 100 drones of the grid, all ordered at once on a channel of 250 kbit/s, some get no order

*A counter far ahead*: once in 2 s

At rest four times as many cut off 70 %, ten times as many 76 % (seeds 0 to 2, from the middle

an order replayed after 1 s has no effect

on a shared channel one in 5 s

| packets that wait for a node | 1,000;

do the same with 10,000 and 2,000

with 100 nodes 132,600 and 42,400 (one run

about 500 packets per second: on the air a packet takes 1.9 ms at 250 kbit/s. A packet takes 2.1
BLAKE2s calls: 0.8 to seal a hop (a broadcast is sealed once), 1 to open it, and 0.3 for end-to-end
seals

a user's message of 1,024 bytes take

With 4 bytes it prints 27.8

With a key there are up to 9 % more of them: 39,668 instead of 36,412 in 120 s with 100 nodes on
the disc, 3,198 instead of 3,158 with 25 nodes on the shared channel

16 nodes 6 m apart are connected after 4.9, 4.6 and 5.8 s (three seeds) instead of 2.8, 2.0 and
2.4 s, 49 nodes after 20, 17 and 18 s instead of 11, 9 and 10 s, and the fleet of the default run,
18 nodes 1 m apart, after 9 to 20 s (16 seeds). On the disc, 25 and 100 nodes
"""
MEASURED = [" ".join(part.split()) for part in _MEASURED.split("\n\n")]

NAMES = re.compile(
    r"BLAKE2s|AES-128|RFC \d+|IPv6: of a /64|python3|127\.0\.0\.1|mode 600|node5?\.key|--id 5|"
    r"keys of node 5|mesh\.key 5|docs/\S+"
)


def test_no_number_stands_on_the_page_without_a_check():
    prose = re.sub(r"```.*?```", "", PAGE, flags=re.DOTALL)
    rest = " ".join(line for line in prose.split("\n") if not _is_checked_row(line))
    rest = " ".join(rest.split())
    for phrase in (*SENTENCES, *MEASURED, ORDERS_DONE):
        assert phrase in TEXT, phrase
        rest = rest.replace(phrase, "")
    rest = NAMES.sub("", rest)
    assert re.findall(r".{0,40}\d.{0,20}", rest) == []


def _is_checked_row(line: str) -> bool:
    """Whether a test of its own reads this row of a table."""
    cells = [cell.strip() for cell in line.split("|")[1:-1]]
    is_attack = cells[:1] in [[name] for name in attacks.ATTACKS] and "%" in line
    is_forgery = len(cells) == 5 and (cells[0], cells[2]) in [(w, str(b)) for w, b, _ in FORGERIES]
    return is_attack or is_forgery or line in LAYOUT


@pytest.mark.parametrize("sentence", SENTENCES)
def test_a_sentence_with_a_number_says_what_the_code_does(sentence):
    assert sentence in TEXT


ORDERS_DONE = (
    f"with {claims.CLAIMS_PER_S} claims a second all {len(claims.ORDERED)} orders are carried out"
)


def _range(first: int, count: int) -> str:
    return f"{first}..{first + count - 1}"


def _proof(form: end_to_end._Form) -> str:
    return f"tag {_range(form.at, form.tag_bytes)}, sequence {_range(form.at + form.tag_bytes, 2)}"


_PLACE = end_to_end._OF_PAIR
_ORDER = end_to_end._FORMS[MessageType.MOVE_TO_LOCATION]
_HEARTBEAT = end_to_end._FORMS[MessageType.HEARTBEAT]
_NONCE = _range(end_to_end._NONCE_AT, end_to_end._NONCE_BYTES)
_PRESENT_NONCE = _range(end_to_end._PRESENT_NONCE_AT, end_to_end._NONCE_BYTES)
LAYOUT = [
    "| 0..4 | header |",
    f"| 5..{seal.SEAL_AT - 1} | body; its end holds the end-to-end seal of the types that "
    "have one |",
    f"| {_range(seal.SEAL_AT, 2)} | counter of the sender, low 16 bits |",
    f"| {_range(seal.TAG_AT, seal.TAG_BYTES)} | hop tag |",
    f"| PRESENT | 5..6; digest of the frame at {_range(end_to_end._DIGEST_AT, 2)} | nonce "
    f"{_PRESENT_NONCE} | {end_to_end._PRESENT_NONCE_AT - 7} bytes for the routing technique |",
    f"| HEARTBEAT | 5..7 | nonce {_NONCE}; from a gateway, or to one that was heard, also "
    f"{_proof(_HEARTBEAT)} | {end_to_end._NONCE_AT - 8} bytes for the routing technique |",
    f"| REQUESTLOCATION | | nonce {_NONCE} | |",
    f"| LOCATION, for one node | 5..{_PLACE.at - 1} | {_proof(_PLACE)} | |",
    f"| GATEWAY_PLACE ({MessageType.GATEWAY_PLACE:d}) | 5..17 | {_proof(_PLACE)} | |",
    f"| MOVE_TO_LOCATION | 5..{_ORDER.at - 1} | {_proof(_ORDER)} | |",
    f"| reports 64..124, for one node | 5..{_PLACE.at - 1} | {_proof(_PLACE)} | |",
    f"| ACK ({data.ACK:d}) | 5..{seal.SEAL_AT - message_seal.ACK_TAG_BYTES - 1} | tag "
    f"{_range(seal.SEAL_AT - message_seal.ACK_TAG_BYTES, message_seal.ACK_TAG_BYTES)} | |",
    f"| MOVEMENT_NEGOTIATION, MISSING, broadcast LOCATION, NODE_SEARCH and LAST_PLACE, "
    f"techniques' own types, other packets of users' data | 5..{seal.SEAL_AT - 1} | none | |",
]


@pytest.mark.parametrize("row", LAYOUT)
def test_the_layout_is_that_of_the_code(row):
    assert row in PAGE.split("\n")


FORGERIES = [  # what, bits, and tags that would do
    ("a packet of one hop", 8 * seal.TAG_BYTES, 1),
    ("an order", 8 * (seal.TAG_BYTES + end_to_end.ORDER_TAG_BYTES), end_to_end.NONCES),
    ("an order", 8 * end_to_end.ORDER_TAG_BYTES, end_to_end.NONCES),
    ("a user's message", 8 * data.MESSAGE_TAG_BYTES, 1),
    ("an acknowledgement of a user's message", 8 * message_seal.ACK_TAG_BYTES, 1),
    ("a place, a report, a heartbeat of a gateway", 8 * end_to_end.TAG_BYTES, end_to_end.NONCES),
]


@pytest.mark.parametrize(("what", "bits", "chances"), FORGERIES)
def test_the_mean_number_of_forgeries_follows_from_the_bits(what, bits, chances):
    rows = [row for row in PAGE.split("\n") if row.startswith(f"| {what} |")]
    (row,) = [row for row in rows if f"| {bits} |" in row]
    mean = float(re.findall(r"[0-9.e-]+", row.split("|")[4])[0])
    assert mean == pytest.approx(chances * TRIES_PER_YEAR / 2**bits, rel=0.1)


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


CELL = (
    r"\d+ %, later \d+ %(; \d+\.\d lured, \d+ m)?"
    rf"( \(({'|'.join(place.name.lower() for place in damage.Place)}), "
    rf"({'|'.join(moment.value for moment in damage.Moment)})\))?"
)


def test_the_table_has_a_row_of_the_command_for_each_attack():
    assert list(rows()) == list(attacks.ATTACKS)
    for name, cells in rows().items():
        recorded = attacks.ATTACKS[name] in attacks.RECORDING
        for threat, cell in zip(damage.Threat, cells):
            if threat is damage.Threat.CAPTURED and recorded:
                assert cell == ""
            else:
                assert re.fullmatch(CELL, cell), name


def test_claimed_nonces_silence_no_order():
    assert "lured" not in rows()["nonces in drones' names"][-1]
    assert ORDERS_DONE in TEXT


def test_what_the_threat_table_calls_prevented_does_no_harm_in_the_attack_table():
    """With a key an outsider lures nobody, and cuts off no more than the scenario itself."""
    assert re.search(r"\| wormhole: [^|]*\| \*\*not\*\* prevented", PAGE)  # its row may say more
    for name, (_without, with_key, _captured) in rows().items():
        assert "lured" not in with_key, name
        most = 20 if name == "wormhole" else 5
        assert int(re.findall(r"\d+", with_key)[0]) <= most, name
