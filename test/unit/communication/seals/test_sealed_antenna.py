from __future__ import annotations

import logging
import random

import pytest
from proofs.stranger import Tap
from rig import Rig
from seal_rig import KEY, OTHER_KEY, packet

from drone_mesh.communication.data import packets
from drone_mesh.communication.interfaces import IMeshNetwork, IWirelessCommunication
from drone_mesh.communication.seals.seal import HopSeal, _epoch_state
from drone_mesh.communication.seals.sealed_antenna import SealedAntenna
from drone_mesh.communication.timing import IMMEDIATE, QUEUED, Medium
from drone_mesh.inprocess import Network


def line(nodes, key=KEY, radio="disc", **options):
    network = Network(seed=1, key=key, radio=radio, **options)
    network.add_gateway(0, 0.0, 0.0)
    for node in range(1, nodes):
        network.add_router(node, 6.0 * node, 0.0)
    return network


def node_keys(node_id):
    return KEY if node_id == 0 else KEY.for_node(node_id)


def counts(network, node_id):
    return network.nodes[node_id].receiver.complaints.counts


@pytest.mark.parametrize("radio", ["disc", "shared"])
@pytest.mark.parametrize("key", [KEY, node_keys], ids=["mesh key", "a key per node"])
def test_a_mesh_with_a_key_connects_and_stays_connected(radio, key):
    network = line(5, key, radio)
    assert network.run_until(network.all_connected, within_s=30.0)
    for _ in range(12):
        network.run_for(5.0)
        assert network.all_connected()
    assert [network.hops(node) for node in range(5)] == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    "routing",
    ["babel", "batman", "child_table_tree", "dsdv", "etx_tree", "flooding", "steady_tree"],
)
def test_every_routing_technique_works_in_a_mesh_with_a_key(routing):
    network = line(4, routing=routing)
    assert network.run_until(network.all_connected, within_s=60.0)
    network.run_for(30.0)
    assert network.order(3, 18.0, 3.0)
    assert network.run_until(lambda: network.location(3).latitude == 3.0, within_s=30.0)


def test_nodes_know_the_gateways_place_as_they_do_without_a_key():
    network = line(4)
    network.run_for(30.0)
    for node in (1, 2, 3):
        places = network.nodes[node].component.places
        assert places.gateway == network.location(0)
        assert places.good == network.location(node - 1)


def test_the_longest_message_still_has_room_for_its_seal():
    network = line(3, node_keys)
    network.run_for(30.0)
    ticket = network.send(0, 2, bytes(1024))
    assert network.run_until(lambda: ticket.state.name == "DELIVERED", within_s=10.0)
    message = network.received[2][-1]
    assert message.payload == bytes(1024)


@pytest.mark.parametrize("changes", [False, True])
def test_a_relay_cannot_change_a_message(changes):
    network = line(3, node_keys)
    network.run_for(30.0)
    relay = network.nodes[1].component

    def on_msg(payload, now_s):
        if changes and payload[2] == 128 and payload[4] == 2:
            head = packets.head_of(payload[5:])
            sealed = b"o" + payload[16 : 15 + head.length]  # the right checksum, not the seal
            check = packets.checksum(head.session, head.port, head.order, sealed)
            head = head._replace(checksum=check)
            payload = payload[:5] + packets.first_body(head, sealed, 20) + payload[25:]
        return receive(payload, now_s)

    receive, relay.on_msg = relay.on_msg, on_msg
    network.send(0, 2, b"shut")
    network.run_for(5.0)
    arrived = [message.payload for message in network.received.get(2, [])]
    assert arrived == ([] if changes else [b"shut"])


def test_nodes_with_different_keys_form_separate_meshes(caplog):
    caplog.set_level(logging.WARNING)
    network = line(4, lambda node: KEY if node < 2 else OTHER_KEY)
    network.run_for(60.0)
    assert [network.connected(node) for node in range(4)] == [True, True, False, False]
    assert (
        "node 1: a neighbour, node 2, sends packets that this node's key does not open: "
        "another mesh or another key?" in caplog.text
    )


def test_a_neighbour_is_named_after_two_check_periods_at_the_earliest(caplog):
    """A restarted one answers a challenge by then."""
    caplog.set_level(logging.WARNING)
    network = line(2)
    network.run_for(10.0)
    for _ in range(5):
        assert "node 7" not in caplog.text
        network.inject(1, packet("07 07 03 01 fe 00 01"))
        network.run_for(4.5)
    network.run_for(3.0)
    network.inject(1, packet("07 07 03 01 fe 00 01"))
    network.run_for(1.0)
    assert "node 7, sends packets without a seal: it has no key" in caplog.text


@pytest.mark.parametrize("restarted", [0, 1, 2])
def test_a_restarted_node_is_back_within_a_check_period(restarted):
    network = line(4, node_keys)
    network.run_for(30.0)
    network.restart(restarted)
    network.run_for(1.0)
    assert network.run_until(network.all_connected, within_s=20.0)
    assert "other key" not in str([counts(network, node) for node in range(4)])


def test_a_neighbour_without_power_for_long_is_believed_again():
    network = line(3)
    network.run_for(20.0)
    network.power(2, False)
    network.run_for(120.0)
    network.power(2, True)
    assert network.run_until(network.all_connected, within_s=15.0)


def test_no_function_of_the_antenna_below_is_forgotten():
    public = {name for name in vars(IWirelessCommunication) if not name.startswith("_")}
    public |= {name for name in vars(IMeshNetwork) if not name.startswith("_")}
    assert public <= set(vars(SealedAntenna))


def test_without_a_key_there_is_no_layer():
    network = line(2, key=None)
    network.run_for(1.0)
    assert network.nodes[0].receiver is network.nodes[0].component


def test_a_relay_believes_no_gateway_in_passing_that_did_not_prove_to_be_one():
    network = line(4, node_keys, "shared")
    assert network.run_until(network.all_connected, within_s=30.0)
    relay = network.nodes[2].component
    false = packet("07 01 04 02 03 01 07 00")  # of "gateway" 7, on its way to node 3
    for _ in range(20):
        relay.on_msg(false, network.now_s())
        network.run_for(2.0)
        assert relay.get_preferred_gateway() == 0


def test_a_relay_takes_no_place_that_only_its_addressee_can_check():
    network = line(3, node_keys)
    network.run_for(30.0)
    relay = network.nodes[1].component
    relay.on_msg(
        packet("00 00 01 01 02 00 00 80 3f 00 00 80 3f 00 00 ff ff ff 7f"), network.now_s()
    )
    assert relay.places.gateway == network.location(0)


def test_a_radio_that_only_acknowledges_a_challenge_does_not_become_a_neighbour():
    network = line(3, radio="shared")
    assert network.run_until(network.all_connected, within_s=30.0)
    node = network.nodes[2]
    assert node.component.get_direction_to(0) == 1
    delivered = packet("02 02 00 00 00")  # it poses as the gateway
    node.receiver.on_delivered(delivered, 1, network.now_s())
    assert node.component.get_direction_to(0) == 1
    assert 0 not in node.component.get_neighbours()


def test_occasional_duplicates_are_not_reported_as_replayed(caplog):
    network = line(2)
    record = []
    node = network.nodes[1]
    node.receiver, sealed = Tap(network, 1, record), node.receiver
    network.run_for(30.0)
    node.receiver = sealed
    for _ in range(6):
        network.inject(1, record[-1].payload)
        network.run_for(45.0)
    assert "replayed or forged" not in caplog.text
    for _ in range(6):
        network.inject(1, record[-1].payload)
        network.run_for(10.0)
    assert "replayed or forged packets in the name of node 0" in caplog.text


def heard_by(network, node_id):
    """What this node hears from now on."""
    record = []
    network.nodes[node_id].receiver = Tap(network, node_id, record)
    return record


def test_a_copy_of_a_packet_of_the_last_seconds_has_no_effect_and_no_line_and_costs_no_packet(
    caplog,
):
    """A lost acknowledgement: its sender repeats a packet that was accepted."""
    network = line(2)
    complaints = counts(network, 1)
    record = heard_by(network, 1)
    network.run_for(30.0)
    everything = seals_heard(network)
    for _ in range(6):
        count = len(record)
        assert network.run_until(lambda count=count: len(record) > count, within_s=15.0)
        network.run_for(0.07)
        before = len(everything()), network.nodes[1].component.get_total_message_sent()
        if record[-1].payload[4] != 254:
            for _again in range(4):
                network.inject(1, record[-1].payload)
        after = len(everything()), network.nodes[1].component.get_total_message_sent()
        assert after == before
    assert complaints["packets that came late or twice"] >= 9
    assert not caplog.text


def test_packets_that_a_neighbour_shows_not_to_have_sent_are_named(caplog):
    network = line(3)
    network.run_for(30.0)
    for _ in range(4):
        network.inject(1, packet("02 02 04 01 01 00 ff 00 00 00 00 00 01 02 03"))
        network.run_for(10.0)
    lines = [record.getMessage() for record in caplog.records]
    assert len(lines) == 1
    assert "node 1: replayed or forged packets in the name of node 2" in lines[0]


@pytest.mark.parametrize("restarted", [0, 1, 2])
@pytest.mark.parametrize("radio", ["disc", "shared"])
def test_a_restart_is_no_attack(radio, restarted, caplog):
    network = line(4, node_keys, radio)
    network.run_for(40.0)
    for _ in range(4):
        network.restart(restarted)
        network.run_for(15.0)
    assert not caplog.text


def seals_heard(network):
    """What all nodes hear from now on, challenges and answers alone, by time."""
    record = []
    for node_id, node in network.nodes.items():
        node.receiver = Tap(network, node_id, record)
    return lambda: [one for one in record if one.payload[2] in (126, 127)]


def test_a_forged_broadcast_with_a_far_count_cuts_no_link_and_starts_no_storm():
    network = line(2, node_keys)
    network.run_for(30.0)
    victim = network.nodes[1].receiver._seal
    forger = HopSeal(1, KEY.for_node(7), random.Random(1), 30.0)  # has the network key alone
    forger._epoch, forger._count = victim._epoch, victim._count + 32_000
    forger._state_to_all = _epoch_state(KEY.network, victim._epoch)
    heard = seals_heard(network)
    network.inject(0, forger.seal(packet("01 01 03 00 fe ff 00")))
    connected = 0
    for _ in range(120):
        network.run_for(1.0)
        connected += network.connected(1)
    assert connected >= 110
    assert len(heard()) < 60


def test_a_stranger_gets_no_more_frames_out_of_a_mesh_than_he_sends():
    network = Network(seed=1, key=KEY)
    network.add_fleet(1, 24, 5, 6.0)
    network.run_for(60.0)
    heard = seals_heard(network)
    sent = 0
    for _tenth in range(600):  # frames in the names of living neighbours, 20 a second
        for victim in (6, 7):
            claimed = sorted(network.nodes[victim].component.get_neighbours())
            from_ = claimed[sent // 2 % len(claimed)]
            network.inject(victim, bytes((from_, from_, 4, victim, victim)).ljust(32, b"\7"))
            sent += 1
        network.run_for(0.1)
    assert len(heard()) < sent / 4
    assert network.all_connected()


def test_recorded_challenges_are_answered_once():
    network = line(2)
    heard = seals_heard(network)
    network.run_for(30.0)
    challenges = [one for one in heard() if one.payload[2] == 126]
    assert challenges
    before = len(heard())
    for _tenth in range(300):
        for one in challenges:
            network.inject(one.receiver, one.payload)
        network.run_for(0.1)
    answers = [one for one in heard()[before:] if one.payload[2] == 127]
    assert len(answers) < 10


def layer_of_1():
    """The layer of node 1, and its rig."""
    rig = Rig(node_id=1)
    layer = SealedAntenna(rig.antenna, 1, KEY, random.Random(1), lambda: rig.now_s)
    layer.start_antenna(rig.mesh)
    return layer, rig


def test_a_neighbour_that_has_answered_gets_the_same_time_again_before_it_is_named():
    layer, rig = layer_of_1()
    without_seal = packet("07 07 03 01 fe 00 01")
    layer.on_msg(without_seal, 0.0)
    (challenge,) = rig.antenna.taken
    layer.on_msg(HopSeal(7, KEY, random.Random(7), 30.0).answer(challenge, 0.0), 0.0)
    for now_s in (70.0, 71.0, 72.0, 89.9):
        layer.on_msg(without_seal, now_s)
        assert not layer.complaints.counts
    layer.on_msg(without_seal, 90.0)
    assert "node 7, sends packets without a seal" in next(iter(layer.complaints.counts))


def test_a_challenge_that_nobody_took_says_nothing_about_a_neighbours_key():
    """While a mesh starts, a shared channel may take seconds and lose it."""
    layer, rig = layer_of_1()
    heard = packet("07 07 03 01 fe 00 01")
    for now_s in (0.0, 4.0):
        layer.on_msg(heard, now_s)
        challenge = rig.antenna.taken.pop()
        layer.on_undelivered(challenge, 18, now_s + 1.0)
    layer.on_msg(heard, 21.0)
    assert not layer.complaints.counts
    for now_s in (30.0, 42.0):
        layer.on_msg(heard, now_s)
    assert "node 7, sends packets without a seal" in next(iter(layer.complaints.counts))


def test_a_very_late_answer_shows_that_the_neighbour_has_the_key():
    """Its epoch is not believed."""
    layer, rig = layer_of_1()
    neighbour = HopSeal(7, KEY, random.Random(7), 30.0)
    heard = neighbour.seal(packet("07 07 03 01 fe 00 01"))
    layer.on_msg(heard, 0.0)
    (first,) = rig.antenna.taken
    layer.on_msg(heard, 3.0)
    layer.on_msg(neighbour.answer(first, 10.5), 10.5)
    for _ in range(3):
        layer.on_msg(heard, 21.0)
    assert not layer.complaints.counts


def test_one_challenge_without_an_answer_says_nothing_about_a_neighbours_key():
    """Between two neighbours that hear little of each other it may be 20 s old by the second one.

    On a busy channel the answer takes seconds.
    """
    layer, rig = layer_of_1()
    heard = packet("07 07 03 01 fe 00 01")
    for now_s in (0.0, 20.0, 21.0, 22.0, 29.0):
        layer.on_msg(heard, now_s)
        assert not layer.complaints.counts
    layer.on_msg(heard, 31.0)
    assert "node 7, sends packets without a seal" in next(iter(layer.complaints.counts))


def test_only_a_challenge_with_another_key_shows_that_a_neighbour_has_one():
    """Its other packets may not open because its answers wait, on a channel that is too full."""
    layer, rig = layer_of_1()
    heard = HopSeal(7, KEY, random.Random(7), 30.0).seal(packet("07 07 03 01 fe 00 01"))
    foreign = HopSeal(7, OTHER_KEY, random.Random(7), 30.0)
    for now_s in range(0, 60, 5):
        layer.on_msg(heard, float(now_s))
        assert not layer.complaints.counts
    layer.on_msg(foreign.challenge(1, 60.0), 60.0)
    assert "node 7, sends packets that this node's key" in next(iter(layer.complaints.counts))


def test_a_challenge_by_broadcast_says_nothing_about_a_neighbours_key():
    rig = Rig(node_id=1, medium=Medium(policy=QUEUED))
    layer = SealedAntenna(rig.antenna, 1, KEY, random.Random(1), lambda: rig.now_s)
    layer.start_antenna(rig.mesh)
    for now_s in (0.0, 10.0, 20.0, 30.0):
        for node in range(2, 12):
            layer.on_msg(packet(f"{node:02x} {node:02x} 03 01 fe 00 01"), now_s)
    assert [sent[4] for sent in rig.broadcasts()] == [10, 11] * 4
    told = "".join(layer.complaints.counts)
    assert "node 9," in told
    assert "node 11," not in told


@pytest.mark.parametrize(("policy", "repeated"), [(IMMEDIATE, [3, 40]), (QUEUED, [3])])
def test_a_newcomer_gets_the_last_introduction_but_on_a_shared_channel_no_beacon(policy, repeated):
    rig = Rig(node_id=1, medium=Medium(policy=policy))
    layer = SealedAntenna(rig.antenna, 1, KEY, random.Random(1), lambda: rig.now_s)
    layer.start_antenna(rig.mesh)
    kinds = []
    for node, kind in ((7, 3), (8, 40)):
        layer.broadcast_message(packet(f"01 01 {kind:02x} ff ff"))
        rig.antenna.taken.clear()
        layer.on_msg(HopSeal(node, KEY, random.Random(node), 30.0).challenge(1, 0.0), 0.0)
        kinds += {sent[2] for sent in rig.antenna.taken if sent[:4] == bytes([1, 1, kind, node])}
    assert kinds == repeated


def test_another_radio_with_this_nodes_id_and_no_key_is_named_and_challenged_by_a_broadcast():
    layer, rig = layer_of_1()
    layer.on_msg(packet("01 01 03 01 fe 00 01"), 0.0)
    assert layer.complaints.counts == {"another radio uses id 1": 1}
    assert (rig.antenna.taken, [sent[2] for sent in rig.broadcasts()]) == ([], [126])


@pytest.mark.parametrize("radio", ["disc", "shared"])
def test_a_message_arrives_over_a_neighbour_that_was_silent_for_six_check_periods(radio):
    """It acknowledges the packet, but has to ask for the epoch before it can open another one."""
    network = line(3, node_keys, radio)
    network.run_for(60.0)
    relay = network.nodes[1].receiver
    relay._seal._peers[2].heard_s -= 61.0
    network.send(2, 0, b"once", reliable=False)
    network.run_for(1.0)
    assert [message.payload for message in network.received.get(0, [])] == [b"once"]


@pytest.mark.parametrize("radio", ["disc", "shared"])
def test_of_many_frames_in_a_neighbours_name_fewer_come_back_than_were_sent(radio):
    def delivered(forged):
        network = line(3, node_keys, radio)
        network.run_for(30.0)
        before = network.air.delivered
        for number in range(600):
            if forged:
                network.inject(1, packet(f"02 02 04 01 01 {'00' * 20} {number % 256:02x} 01 61"))
            network.run_for(0.05)
        return network.air.delivered - before

    assert delivered(forged=True) - delivered(forged=False) < 600 / 2
