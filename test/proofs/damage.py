"""The damage that an attack does to a mesh: nodes cut off, drones lured away."""

from __future__ import annotations

import enum
import functools
import math
import statistics
from typing import AbstractSet, NamedTuple

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.node.node_configuration import DEFAULT_ROUTING
from drone_mesh.communication.seals.keys import Keys, MeshKey
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.communication.wire.messages import present
from drone_mesh.drone.location import Location
from drone_mesh.errors import MeshError
from drone_mesh.inprocess.network import STEP_S, Network
from proofs.attacks import (
    ATTACKS,
    RECORDING,
    borrowed_names,
    highest_bid,
    invented_ids,
    plausible_bid,
)
from proofs.claims import BY_BEACONS, FOR_PACKETS_DOWN, order_west
from proofs.stranger import BESIDE, Stranger

NODES, SHARED_NODES, BIDDING_NODES = 25, 9, 4
SPACING_M = 6.0
REST_S = 20.0
JOINING_S = 12.0
STRANGER = 200
LURED_M = 50.0  # farther than any repair flies here
OFF_ORDER_M = 3.0  # tolerance for a drone that its owner ordered to a place
SAMPLE_PERIOD_S = 1.0
RECOVERY_S = 60.0
_SECRET = b"the key of a lab"
KEY = MeshKey(_SECRET)


class Threat(enum.Enum):
    """The kind of attacker, and whether the mesh has a key."""

    WITHOUT_KEY = "without key"
    WITH_KEY = "with key"
    CAPTURED = "captured node"  # with its own keys, in a mesh with a key


class Place(enum.Enum):
    """Where the attacker is: this part of the mesh's sides beyond a spot beside the gateway."""

    MIDDLE = (0.5, 0.5)
    GATEWAY = (0.0, 0.0)
    LEFT = (0.0, 0.5)
    FRONT = (0.5, 0.0)
    CORNER = (1.0, 1.0)  # the far one


class Moment(enum.Enum):
    """When the attack begins."""

    REST = "rest"
    HALF = "half a period later"  # between two checks of the neighbours
    FORMING = "start"  # of all nodes
    FORMED = "formed"  # as soon as all are connected
    FAILURE = "failure"  # of the router on most routes
    FLIGHT = "flight"  # of that router, ordered by the owner
    RESTART = "restart"  # of the gateway


class Case(NamedTuple):
    """One attack by this attacker, from this place, at this moment."""

    name: str
    threat: Threat
    place: Place = Place.GATEWAY
    moment: Moment = Moment.REST


class Damage(NamedTuple):
    """The damage of one attack on one mesh."""

    cut_off: float  # share of routers without a working path, mean during the attack
    later: float  # the same, one minute after the attack, if not said otherwise
    lured: int  # drones more than LURED_M from their proper positions
    metres: float  # distance of the farthest of them


def harm(case: Case, seed: int, recovery_s: float = RECOVERY_S) -> Damage:
    """What the attack costs more than the same time without one."""
    attacked = trial(case, seed, recovery_s=recovery_s)
    if not any(attacked):
        return attacked  # no worse than whatever happens without one
    # An attacker that does nothing is the same everywhere, with the keys of a node or without.
    threat = Threat.WITHOUT_KEY if case.threat is Threat.WITHOUT_KEY else Threat.WITH_KEY
    quiet = trial(Case(case.name, threat, moment=case.moment), seed, True, recovery_s)
    lured = attacked.lured - quiet.lured
    metres = attacked.metres if lured > 0 else 0.0
    return Damage(attacked.cut_off - quiet.cut_off, attacked.later - quiet.later, lured, metres)


def mesh_size(name: str) -> int:
    """Of the mesh that this attack is made on, with its gateway."""
    attack = ATTACKS[name]
    if attack in (invented_ids, borrowed_names):
        return SHARED_NODES  # on a shared channel, where strangers cost airtime
    return BIDDING_NODES if attack in (highest_bid, plausible_bid) else NODES


@functools.lru_cache(maxsize=None)  # the search for the worst case has made some of them
def trial(case: Case, seed: int, mute: bool = False, recovery_s: float = RECOVERY_S) -> Damage:
    """One attack, or the same time with an attacker that does nothing."""
    attack = ATTACKS[case.name]
    nodes = mesh_size(case.name)
    network = Network(
        seed,
        radio="shared" if nodes == SHARED_NODES else "disc",
        key=None if case.threat is Threat.WITHOUT_KEY else keys_of,
        routing="beacon" if attack in BY_BEACONS else DEFAULT_ROUTING,
    )
    if nodes == BIDDING_NODES:
        network.add_gateway(0, 0.0, 0.0)
        for node in range(1, nodes):
            network.add_router(node, SPACING_M * node, 0.0)
        sides_m = 2 * SPACING_M, 0.0
    else:
        network.add_fleet(1, nodes - 1, math.ceil(math.sqrt(nodes - 1)), SPACING_M)
        sides_m = (SPACING_M * (math.isqrt(nodes - 1) - 1),) * 2
    x, y = (part * side_m for part, side_m in zip(case.place.value, sides_m))
    stranger = Stranger(network, STRANGER, 2.0 + x, 3.0 + y)
    stranger.mute = mute
    proper = {node: network.location(node) for node in network.nodes}
    _wait_for(case, stranger)
    shares: list[float] = []
    is_down = attack in FOR_PACKETS_DOWN

    def sample(_: object) -> None:
        shares.append(share_cut_off(network, stranger.swallows, is_down))
        network.clock.call_at(network.now_s() + SAMPLE_PERIOD_S, sample, None)

    sample(None)
    attack(stranger)
    cut_off = statistics.fmean(shares)
    lured = _away(network, proper, stranger.ordered)
    stranger.antenna.stop_antenna()
    network.run_for(recovery_s)
    later = share_cut_off(network, stranger.swallows, is_down)
    return Damage(cut_off, later, len(lured), max(lured, default=0.0))


def _wait_for(case: Case, stranger: Stranger) -> None:
    """Let time pass until the attack begins; the attacker is then reachable, and has joined."""
    network, moment = stranger.network, case.moment
    network.run_for(STEP_S)  # all nodes have started
    early = moment in (Moment.FORMING, Moment.FORMED)
    if early:
        _join(case, stranger)
    if moment is Moment.FORMING:
        return
    if not network.run_until(network.all_connected, within_s=60.0):
        raise MeshError("the mesh does not connect without an attack")
    if early:
        return
    network.run_for(REST_S)
    _join(case, stranger)
    if case.threat is Threat.CAPTURED:
        network.run_for(JOINING_S)
    if moment is Moment.HALF:
        network.run_for(MeshTiming.check_period_s / 2)
    elif moment is Moment.FAILURE:
        network.power(stranger.busiest_relay(), False)
    elif moment is Moment.FLIGHT:
        order_west(stranger, stranger.busiest_relay())
    elif moment is Moment.RESTART:
        network.restart(0)


def _join(case: Case, stranger: Stranger) -> None:
    """Switch the attacker on; a captured node becomes a neighbour of the others."""
    captured = case.threat is Threat.CAPTURED and not stranger.mute
    if captured:
        stranger.join_with(KEY.for_node(STRANGER))
    stranger.switch_on()
    if captured:
        introduction = present(stranger.node_id, NO_ROUTE, know_gateway=False)
        stranger.antenna.broadcast_message(introduction)


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


def worst(name: str, threat: Threat) -> Case:
    """The place and the moment at which the first seed suffers most.

    Tries each place at rest, then each moment at the worst of them and beside the gateway, then
    each place at the worst moment.
    """
    everywhere = [Case(name, threat, place) for place in Place]
    at_rest = max(everywhere, key=_weight)
    spots = (at_rest, Case(name, threat, Place.GATEWAY))
    moments = [spot._replace(moment=moment) for spot in spots for moment in Moment]
    worst = max(moments, key=_weight)
    return max([worst, *(worst._replace(place=place) for place in Place)], key=_weight)


def _weight(case: Case) -> float:
    """Three shares of the mesh: cut off, cut off later, lured away."""
    cut_off, later, lured, _ = harm(case, seed=0)
    return round(cut_off + later + lured / mesh_size(case.name), 2)


def damage_row(name: str, runs: int) -> str:
    """A line of the Markdown table: means over the runs, and the farthest of all drones."""
    cells = []
    for threat in Threat:
        if threat is Threat.CAPTURED and ATTACKS[name] in RECORDING:
            cells.append("")  # a captured node replays recordings like any other radio
        else:
            cells.append(_cell(worst(name, threat), runs))
    return f"| {name} | " + " | ".join(cells) + " |"


def _cell(case: Case, runs: int) -> str:
    """What the attack does in the mean, and, if it does anything, where and when."""
    damages = [harm(case, seed) for seed in range(runs)]
    cut_off, later, lured, _ = (max(0.0, statistics.fmean(column)) for column in zip(*damages))
    text = f"{100 * cut_off:.0f} %, later {100 * later:.0f} %"
    if lured:
        text += f"; {lured:.1f} lured, {max(d.metres for d in damages):.0f} m"
    return (
        text
        if text == "0 %, later 0 %"
        else f"{text} ({case.place.name.lower()}, {case.moment.value})"
    )


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


def keys_of(node_id: int) -> Keys | None:
    """Each router has its own keys; the stranger's router beside the mesh has none."""
    if node_id == BESIDE:
        return None
    return MeshKey(_SECRET) if node_id == 0 else KEY.for_node(node_id)


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
