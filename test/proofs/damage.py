"""The damage that an attack does to a mesh: nodes cut off, drones lured away."""

from __future__ import annotations

import enum
import functools
import math
import statistics
from typing import AbstractSet, NamedTuple, Sequence

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.node.node_configuration import DEFAULT_ROUTING
from drone_mesh.communication.seals.keys import Keys, MeshKey
from drone_mesh.communication.wire.messages import present
from drone_mesh.drone.location import Location
from drone_mesh.errors import MeshError
from drone_mesh.inprocess.network import Network
from proofs.attacks import (
    ATTACKS,
    RECORDING,
    borrowed_names,
    highest_bid,
    invented_ids,
    plausible_bid,
    swallowing_relay,
)
from proofs.claims import BY_BEACONS, FOR_PACKETS_DOWN
from proofs.stranger import BESIDE, Stranger

NODES, SHARED_NODES = 25, 9
SPACING_M = 6.0
PLACES = ((0.0, 0.0), (0.0, 0.5), (0.5, 0.0), (0.5, 0.5), (1.0, 1.0))  # of the sides of the mesh
PLACED = (highest_bid, plausible_bid, swallowing_relay)  # in a line; on the routes of most
STRANGER = 200
LURED_M = 50.0  # farther than any repair flies here
OFF_ORDER_M = 3.0  # tolerance for a drone that its owner ordered to a place
SAMPLE_PERIOD_S = 1.0
RECOVERY_S = 60.0
_SECRET = b"the key of a lab"
KEY = MeshKey(_SECRET)


class Threat(enum.Enum):
    """The kind of attacker, and whether the mesh has a key."""

    NONE = "no attack"
    WITHOUT_KEY = "without key"
    WITH_KEY = "with key"
    CAPTURED = "captured node"  # with its own keys, in a mesh with a key


class Damage(NamedTuple):
    """The damage of one attack on one mesh."""

    cut_off: float  # share of routers without a working path, mean during the attack
    later: float  # the same, one minute after the attack
    lured: int  # drones more than LURED_M from their proper positions
    metres: float  # distance of the farthest of them


@functools.lru_cache(maxsize=None)  # a search for the worst place has made some of them
def trial(name: str, threat: Threat, seed: int, place: int = 0) -> Damage:
    """One attack with this threat, at this one of the PLACES, or the same time without one."""
    attack = ATTACKS[name]
    shared = attack in (invented_ids, borrowed_names)  # where strangers cost airtime
    radio = "shared" if shared else "disc"
    network = Network(
        seed,
        radio=radio,
        key=keys_of if threat in (Threat.WITH_KEY, Threat.CAPTURED) else None,
        routing="beacon" if attack in BY_BEACONS else DEFAULT_ROUTING,
    )
    if attack in (highest_bid, plausible_bid):
        network.add_gateway(0, 0.0, 0.0)
        for node in (1, 2, 3):
            network.add_router(node, SPACING_M * node, 0.0)
        at = (2 * SPACING_M, 3.0)
    else:
        nodes = SHARED_NODES if shared else NODES
        network.add_fleet(1, nodes - 1, math.ceil(math.sqrt(nodes - 1)), SPACING_M)
        side_m = SPACING_M * (math.isqrt(nodes - 1) - 1)
        at = (2.0 + PLACES[place][0] * side_m, 3.0 + PLACES[place][1] * side_m)
    if not network.run_until(network.all_connected, within_s=60.0):
        raise MeshError(f"seed {seed}: the mesh does not connect without an attack")
    network.run_for(20.0)
    places = {node: network.location(node) for node in network.nodes}
    stranger = Stranger(network, STRANGER, *at)
    if threat is Threat.CAPTURED:
        stranger.join_with(KEY.for_node(STRANGER))
    stranger.mute = threat is Threat.NONE
    stranger.switch_on()
    if threat is Threat.CAPTURED:
        _join_neighbours(stranger)
    shares: list[float] = []
    is_down = attack in FOR_PACKETS_DOWN

    def sample(_: object) -> None:
        shares.append(share_cut_off(network, stranger.swallows, is_down))
        network.clock.call_at(network.now_s() + SAMPLE_PERIOD_S, sample, None)

    sample(None)
    attack(stranger)
    cut_off = statistics.fmean(shares)
    lured = _away(network, places, stranger.ordered)
    stranger.antenna.stop_antenna()
    network.run_for(RECOVERY_S)
    later = share_cut_off(network, stranger.swallows, is_down)
    return Damage(cut_off, later, len(lured), max(lured, default=0.0))


def share_cut_off(network: Network, swallow: AbstractSet[int], down: bool = False) -> float:
    """The share of powered routers whose packets would not arrive at a gateway.

    `down`: to which the gateway's would not arrive. `swallow`: nodes that drop packets for other
    nodes; they do not count.
    """
    routers = [n for n, node in network.nodes.items() if not node.is_gateway and n not in swallow]
    powered = [n for n in routers if network.nodes[n].antenna.powered]
    arrives = _arrives_down if down else _arrives
    return sum(not arrives(network, n, swallow) for n in powered) / len(powered)


TABLE_HEAD = (
    "| attack | " + " | ".join(threat.value for threat in Threat) + " |",
    "|---" * (1 + len(Threat)) + "|",
)


def worst_place(name: str, threat: Threat) -> int:
    """The one of the PLACES from where an attack does most, with the first seed.

    Recordings are made beside the gateway.
    """
    if threat is Threat.NONE or ATTACKS[name] in (*RECORDING, *PLACED):
        return 0
    harm = [trial(name, threat, 0, place) for place in range(len(PLACES))]
    return max(range(len(PLACES)), key=lambda place: (harm[place].cut_off, harm[place].lured))


def damage_row(name: str, runs: int) -> str:
    """A line of the Markdown table: means over the runs, and the farthest of all drones."""
    cells = []
    for threat in Threat:
        if threat is Threat.CAPTURED and ATTACKS[name] in RECORDING:
            cells.append("")  # a captured node replays recordings like any other radio
            continue
        place = worst_place(name, threat)
        cells.append(_in_words([trial(name, threat, seed, place) for seed in range(runs)]))
    return f"| {name} | " + " | ".join(cells) + " |"


def with_row(page: str, row: str) -> str:
    """The page with this row in its table of attacks: in place of its old one, or at the end."""
    lines = page.split("\n")
    first = lines.index(TABLE_HEAD[0])
    end = next(at for at in range(first, len(lines)) if not lines[at].startswith("|"))
    name = row.split("|")[1]
    old = [at for at in range(first, end) if lines[at].split("|")[1] == name]
    if old:
        lines[old[0]] = row
    else:
        lines.insert(end, row)
    return "\n".join(lines)


def _in_words(damage: Sequence[Damage]) -> str:
    cut_off, later, lured, _ = (statistics.fmean(column) for column in zip(*damage))
    text = f"{100 * cut_off:.0f} %, later {100 * later:.0f} %"
    if lured:
        text += f"; {lured:.1f} lured, {max(d.metres for d in damage):.0f} m"
    return text


def keys_of(node_id: int) -> Keys | None:
    """Each router has its own keys; the stranger's router beside the mesh has none."""
    if node_id == BESIDE:
        return None
    return MeshKey(_SECRET) if node_id == 0 else KEY.for_node(node_id)


def _join_neighbours(stranger: Stranger) -> None:
    """A captured node becomes a neighbour of the others before it attacks."""
    me = stranger.node_id
    stranger.antenna.broadcast_message(present(me, NO_ROUTE, know_gateway=False))
    stranger.network.run_for(12.0)


def _arrives(network: Network, node: int, swallow: AbstractSet[int]) -> bool:
    """Whether a packet for the node's gateway would arrive over live links."""
    component = network.nodes[node].component
    gateway = component.get_preferred_gateway()
    if not component.get_connected_to_gateway() or gateway not in network.nodes:
        return False
    return _leads(network, node, gateway, swallow)


def _arrives_down(network: Network, node: int, swallow: AbstractSet[int]) -> bool:
    """The same for a packet of the node's gateway for it."""
    gateway = network.nodes[node].component.get_preferred_gateway()
    return gateway in network.nodes and _leads(network, gateway, node, swallow)


def _leads(network: Network, from_: int, to: int, swallow: AbstractSet[int]) -> bool:
    """Whether the next hops lead there over live links."""
    path = [from_]
    while path[-1] != to:
        step = network.nodes[path[-1]].component.get_direction_to(to)
        if step == NO_ROUTE or step in path or step not in network.links(path[-1]):
            return False
        if step not in network.nodes or step in swallow:
            return False  # the stranger, or a node that swallows
        path.append(step)
    return True


def _away(
    network: Network, before: dict[int, Location], ordered: dict[int, Location]
) -> list[float]:
    """How far drones are, or will be, from their proper positions, in metres."""
    distances = []
    for node, was_at in before.items():
        place = ordered.get(node, was_at)
        allowed_m = OFF_ORDER_M if node in ordered else LURED_M
        drone = network.nodes[node].drone
        goal = drone.get_location() if drone.path is None else Location.from_vector(drone.path.goal)
        if goal.distance_m(place) > allowed_m:
            distances.append(goal.distance_m(place))
    return distances
