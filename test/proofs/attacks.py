"""Attacks on a mesh that an outsider with one radio can make (docs/security.md, "Attacks").

Each function here is one attack. It is called once the mesh is connected, takes as much simulated
time as it needs, and notes in `stranger.ordered` where the owner sends drones meanwhile.
"""

from __future__ import annotations

import random
from typing import Callable, Mapping

from drone_mesh.communication.interfaces import BROADCAST
from drone_mesh.communication.wire.messages import (
    TYPE_AT,
    GatewayPlace,
    GoToLocationMessage,
    LocationMessage,
    MovementNegotiationMessage,
    body,
    header,
    packet,
    readdressed,
)
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location
from drone_mesh.errors import MeshError
from drone_mesh.inprocess.radio import InProcessAir
from proofs import claims
from proofs.stranger import Stranger

ATTACK_S = 60.0
BIDDING_S = 300.0
SWALLOWING_S = 180.0
FRAMES_PER_S = 100  # more do hardly more
FAR = Location(4900.0, 4900.0, 0.0)  # 6.9 km away, within the bounds for goals
AWAY_M = 5.0  # to the west, of the owner's first order that is replayed
LARGEST_BID, PLAUSIBLE_BID = 1e9, 100.0

Attack = Callable[[Stranger], None]


def order_gateway_away(stranger: Stranger) -> None:
    """Send one order to fly to the gateway's own drone."""
    _order(stranger, 0, 0)
    stranger.network.run_for(ATTACK_S)


def order_all_away(stranger: Stranger) -> None:
    """Send an order to fly to each drone, far ones first, then one to all in range."""
    near = stranger.in_range()
    for node in sorted(stranger.network.nodes, reverse=True):
        _order(stranger, node if node in near else near[-1], node)
        stranger.network.run_for(0.1)
    for node in near:
        _order(stranger, node, BROADCAST)
    stranger.network.run_for(ATTACK_S)


def false_gateway(stranger: Stranger) -> None:
    """Claim to be a gateway and answer each heartbeat."""
    me = stranger.node_id

    def answer(payload: bytes) -> None:
        creator, from_, kind, _to, forward = header(payload)
        if kind == MessageType.HEARTBEAT and forward in (me, 0):
            stranger.say(MessageType.HEARTBEAT, me, from_, creator, bytes((1, me, 0)))

    stranger.on_packet = answer
    for node in stranger.targets(1.0, ATTACK_S):
        for addressee in (node, BROADCAST):
            stranger.say(MessageType.HEARTBEAT, me, node, addressee, bytes((1, me, 0)))


def black_hole(stranger: Stranger) -> None:
    """Introduce the radio as the best route to the gateway, and forward nothing."""
    me = stranger.node_id
    for node in stranger.targets(1.0, ATTACK_S):
        stranger.say(MessageType.PRESENT, me, node, BROADCAST, bytes((0, 1)))


def swallowing_relay(stranger: Stranger) -> None:
    """Act as a relay that answers and forwards heartbeats, and drops all other packets of others.

    In a mesh without a key, and among captured nodes, it is the router on most routes; otherwise it
    runs the mesh software without the key.
    """
    stranger.swallow_as_relay()
    stranger.network.run_for(SWALLOWING_S)


def missing_storm(stranger: Stranger) -> None:
    """Report once a second, with each id as sender, that the gateway is missing."""
    for node in stranger.targets(1.0, ATTACK_S):
        for creator in stranger.network.nodes:
            if creator != node:
                stranger.say(MessageType.MISSING, creator, node, BROADCAST, bytes((0,)))


def invented_ids(stranger: Stranger) -> None:
    """Send ten heartbeats a second, each from another invented node."""
    chance = random.Random(stranger.node_id)
    for _ in stranger.every(0.1, ATTACK_S):
        creator = chance.randrange(100, 250)
        for node in stranger.in_range():
            stranger.say(MessageType.HEARTBEAT, creator, node, node, bytes((0, 255, 0)))


def borrowed_names(stranger: Stranger) -> None:
    """Send frames that open for nobody, in the names of its living neighbours."""
    chance = random.Random(stranger.node_id)
    for _ in stranger.every(1.0 / FRAMES_PER_S, ATTACK_S):
        near = stranger.in_range()
        victim, name = chance.sample(near, 2)
        frame = packet(MessageType.HEARTBEAT, name, name, victim, victim, bytes((0, 255, 0)))
        stranger.play(victim, frame[:-1] + b"\1")


def far_place(stranger: Stranger) -> None:
    """Claim that the gateway is far away, in its name and as hearsay; then it is off."""
    own_word = LocationMessage.BODY.pack(FAR.latitude, FAR.longitude, 0, 0)
    hearsay = body(GatewayPlace(0, FAR, 0.0).to_payload(0, 0))
    me = stranger.node_id
    for node in stranger.network.nodes:
        for to in [node] if node in stranger.in_range() else stranger.in_range():
            if node != 0:
                stranger.say(MessageType.LOCATION, 0, to, node, own_word)
                stranger.say(MessageType.GATEWAY_PLACE, me, to, node, hearsay)
    stranger.network.power(0, False)
    stranger.network.run_for(claims.OUTAGE_S)
    stranger.network.power(0, True)
    stranger.network.run_for(ATTACK_S)


def jammed_requests(stranger: Stranger) -> None:
    """Destroy all requests for places, and nothing else."""
    air = stranger.network.air
    assert isinstance(air, InProcessAir)
    if not stranger.mute:
        air.carries = lambda payload: payload[TYPE_AT] != MessageType.REQUESTLOCATION
    stranger.network.run_for(SWALLOWING_S)
    air.carries = None


def highest_bid(stranger: Stranger) -> None:
    """Cut off the drones behind node 1, and send a higher bid than theirs every 3 s."""
    _bid(stranger, LARGEST_BID)


def plausible_bid(stranger: Stranger) -> None:
    """The same, with bids that a real drone could make."""
    _bid(stranger, PLAUSIBLE_BID)


def _bid(stranger: Stranger, score: float) -> None:
    stranger.network.power(1, False)
    body = MovementNegotiationMessage.BODY.pack(score)
    for bid, _ in enumerate(stranger.every(3.0, BIDDING_S)):
        absent, near = 100 + bid % 100, stranger.in_range()
        for place, node in enumerate(near):
            stranger.say(MessageType.MOVEMENT_NEGOTIATION, absent, node, node, body)
            # Of who brings too many winners that do not fly: now in a neighbour's name.
            relay = near[place - 1]
            stranger.say(MessageType.MOVEMENT_NEGOTIATION, absent, node, BROADCAST, body, relay)


def replayed_order(stranger: Stranger) -> None:
    """The owner sends a drone away and back; a second later the first order is replayed."""
    drone, order = _recorded_order(stranger)
    _replay(stranger, drone, order)


def replay_after_restart(stranger: Stranger) -> None:
    """The same, but drone and gateway restart before the order is replayed."""
    drone, order = _recorded_order(stranger)
    for node in (drone, 0):
        stranger.network.restart(node)
    stranger.network.run_for(15.0)
    _replay(stranger, drone, order)


def replay_on_another_path(stranger: Stranger) -> None:
    """The same, but the order is replayed through another neighbour of the drone."""
    drone, order = _recorded_order(stranger)
    beside = next(node for node in stranger.network.links(drone) if node in stranger.in_range())
    _replay(stranger, beside, readdressed(order, beside))


ATTACKS: Mapping[str, Attack] = {
    "forged order to the gateway": order_gateway_away,
    "forged orders to all": order_all_away,
    "order replayed after 1 s": replayed_order,
    "order replayed after a restart": replay_after_restart,
    "order replayed on another path": replay_on_another_path,
    "false gateway": false_gateway,
    "MISSING storm": missing_storm,
    "far place and an outage": far_place,
    "requests for places jammed": jammed_requests,
    "bids of 1e9": highest_bid,
    "bids of 100 m": plausible_bid,
    "black hole": black_hole,
    "relay that swallows": swallowing_relay,
    "heartbeats of invented ids": invented_ids,
    "frames in neighbours' names": borrowed_names,
    "a counter far ahead": claims.far_counter,
    "packets in receivers' own names": claims.own_names,
    "nonces in drones' names": claims.claimed_nonces,
    "false departures": claims.false_departures,
    "resignations in the gateway's name": claims.resigned_gateway,
    "beacons of a black hole": claims.beacon_black_hole,
    "beacons with numbers ahead": claims.beacons_ahead,
    "beacons that list all drones": claims.beacons_of_all,
    "beacons in neighbours' names": claims.beacons_in_names,
    "beacons of far places and an outage": claims.beacons_of_far_places,
    "beacons that hear all drones": claims.beacons_near_all,
    "a beacon, then silence": claims.beacon_and_silence,
    "numbers in the gateway's name": claims.numbers_of_gateway,
    "replayed beacons": claims.replayed_beacons,
    "wormhole": claims.wormhole,
}
RECORDING = (replayed_order, replay_after_restart, replay_on_another_path)


def _order(stranger: Stranger, to: int, forward: int) -> None:
    body = GoToLocationMessage.BODY.pack(FAR.latitude, FAR.longitude, 0)
    stranger.say(MessageType.MOVE_TO_LOCATION, stranger.node_id, to, forward, body)


def _recorded_order(stranger: Stranger) -> tuple[int, bytes]:
    """The owner sends the nearest drone away and back; returns it and its first order."""
    network = stranger.network
    stranger.listen()
    home = stranger.drone.get_location()
    live = [n for n in stranger.in_range() if n and network.nodes[n].antenna.powered]
    drone = min(live, key=lambda node: network.location(node).distance_m(home))
    here = network.location(drone)
    for place in (here._replace(longitude=here.longitude - AWAY_M), here):
        while network.location(drone) != place:  # an order may get lost
            network.order(drone, place.longitude, place.latitude, allow_shared_place=True)
            network.run_until(lambda at=place: network.location(drone) == at, within_s=30.0)  # type: ignore[misc]
    network.run_for(15.0)
    stranger.ordered[drone] = here
    for _at_s, receiver, payload in stranger.record:
        if receiver == drone and payload[TYPE_AT] == MessageType.MOVE_TO_LOCATION:
            return drone, payload
    raise MeshError(f"drone {drone} has heard no order")


def _replay(stranger: Stranger, receiver: int, order: bytes) -> None:
    stranger.network.run_for(1.0)
    stranger.play(receiver, order)
    stranger.network.run_for(ATTACK_S)
